//! A device that is lost: it is opened anew, and every session brought back. Each attempt that fails is followed
//! by a longer wait, until nothing but a new process helps.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use tracing::{error, info};

use crate::core::backoff::Backoff;
use crate::core::session::{Outlet, SessionError};
use crate::core::{Effect, World};

/// The device, as far as the core has heard.
#[derive(Debug, Default)]
pub(crate) struct Device {
    lost: Option<Lost>,
    backoff: Backoff,
}

#[derive(Debug)]
struct Lost {
    since: Instant,
    why: &'static str,
    /// When it is opened anew; nothing where that is under way, or helps no more.
    next: Option<Instant>,
}

impl Device {
    /// Whether it can be used.
    pub fn is_open(&self) -> bool {
        self.lost.is_none()
    }

    /// When it is opened anew, where that is to be waited for.
    pub fn next_attempt(&self) -> Option<Instant> {
        self.lost.as_ref()?.next
    }

    /// Why it can't be used, if it can't.
    pub fn refusal(&self) -> Option<SessionError> {
        let lost = self.lost.as_ref()?;
        Some(SessionError::Unavailable(format!("{}; try again", lost.why)))
    }
}

impl World {
    /// Takes all sessions off a device that can't be used any more. Everybody who waits is told that it was
    /// for nothing.
    pub(crate) fn lose_device(&mut self, why: &'static str) {
        let since = self.device.lost.take().map_or(self.now.instant, |lost| lost.since);
        self.device.lost = Some(Lost { since, why, next: None });
        self.vitals.healthy.store(false, Ordering::Relaxed);
        self.effects.retain(|effect| !effect.needs_device());
        self.in_flight = None;
        let why = SessionError::Unavailable(format!("{why}; nothing was changed, try again"));
        std::mem::take(&mut self.mail).into_values().for_each(|inbox| inbox.refuse(&why));
        std::mem::take(&mut self.making).into_values().for_each(|making| making.refuse(&why));
        self.fallen.clear();
        self.slots = Default::default();
        self.saving = false;
        // What was read for the old device is of no use on another.
        let coming: Vec<Arc<Outlet>> =
            self.coming.values().map(|coming| coming.session().clone()).collect();
        coming.into_iter().for_each(|session| self.come_back(session));
        for (_, simulation) in std::mem::take(&mut self.simulations).into_iter() {
            self.evict(simulation, &why);
        }
        self.try_again();
    }

    /// Takes in whether the device could be opened again.
    pub(crate) fn opened(&mut self, is_open: bool) {
        if !is_open {
            self.try_again();
        } else if let Some(lost) = self.device.lost.take() {
            let took = self.now.instant.saturating_duration_since(lost.since);
            info!("the device is open again after {took:.1?}");
            self.vitals.healthy.store(true, Ordering::Relaxed);
            self.busy = true;
        }
    }

    /// Has the device opened anew after a while, where that may help.
    fn try_again(&mut self) {
        let wait = self.device.backoff.next(self.now.instant);
        let next = wait.and_then(|wait| self.now.instant.checked_add(wait));
        if let Some(lost) = &mut self.device.lost {
            lost.next = next;
        }
        if next.is_none() {
            let failures = self.device.backoff.failures();
            error!(
                "giving up after {failures} failures in a row: only a restart helps; what was acknowledged \
                 is stored"
            );
            self.effects.push(Effect::GiveUp);
        }
    }

    /// Whether there is a device; where it is time for that, one is opened.
    pub(crate) fn has_device(&mut self) -> bool {
        let Some(lost) = &mut self.device.lost else { return true };
        if lost.next.take_if(|next| *next <= self.now.instant).is_some() {
            self.vitals.rebuilds.fetch_add(1, Ordering::Relaxed);
            self.effects.push(Effect::OpenDevice);
        }
        false
    }
}

/// Why requests are refused after the device has failed.
pub(crate) const DEVICE_FAILED: &str = "the device has failed and is opened anew";

/// The error that requests get once the server has stopped stepping.
pub(crate) fn stopped() -> SessionError {
    SessionError::Unavailable("the engine has stopped".to_owned())
}
