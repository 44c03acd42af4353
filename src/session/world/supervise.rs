//! What happens when frames can't be carried out any more: the device is opened anew, and every
//! session brought back. Each attempt that fails is followed by a longer wait, until nothing but a new
//! process helps.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use tracing::{error, info, warn};

use crate::machine;
use crate::session::error::SessionError;
use crate::session::handle::Session;
use crate::session::message::{Message, stopped};

use super::begin::Beginning;
use super::engine::{Engine, Silence};

/// Time between two looks at whether sessions have come back since the server was started.
const UNRECOVERED: Duration = Duration::from_millis(50);

/// What comes of a failure.
#[derive(Debug, PartialEq, Eq)]
enum Next {
    /// The device is open again.
    GoOn,
    /// The server was told to stop meanwhile.
    Stop,
    /// Nothing helps any more.
    GiveUp,
}

impl Engine {
    /// Runs until it is told to stop or nothing helps any more.
    pub(super) fn supervise(mut self) {
        loop {
            let next = match self.beginning {
                Beginning::OnDisk if self.busy => None,
                Beginning::OnDisk if self.vitals.is_recovered() => Some(self.next_beat),
                Beginning::Unwritten => None,
                _ => Some(machine::now() + UNRECOVERED),
            };
            let first = match next.map_or(Err(Silence::Time), |next| self.wait(next)) {
                Ok(message) => Some(message),
                Err(Silence::Time) => None,
                Err(Silence::Nobody) => break,
            };
            if !self.go_on(first) {
                break;
            }
        }
        self.close();
        self.records.values().for_each(|record| record.receipts().end(&stopped()));
    }

    /// Does what there is to do, and opens the device anew where that fails. False means that it was told to
    /// stop or nothing helps any more.
    pub(super) fn go_on(&mut self, first: Option<Message>) -> bool {
        let why = match catch_unwind(AssertUnwindSafe(|| self.turn(first))) {
            Ok(Ok(more)) => return more,
            Ok(Err(failure)) => {
                error!("{failure}");
                "the device has failed and is opened anew"
            }
            Err(_) => "the engine has failed and is started anew",
        };
        error!("{why}");
        match self.rebuild(why) {
            Next::GoOn => true,
            Next::Stop => false,
            Next::GiveUp => {
                self.give_up();
                false
            }
        }
    }

    /// Saves what is to be saved, and refuses everything from then on.
    pub(super) fn close(&mut self) {
        let ended = catch_unwind(AssertUnwindSafe(|| self.finish()));
        if ended.is_err() {
            error!("writing the last checkpoints panicked; the journal holds what they would");
        }
        self.vitals.healthy.store(false, Ordering::Relaxed);
        // Whoever still waits learns that nobody answers any more.
        self.inbox.close();
        if self.storage.is_to_be_rewritten() {
            self.rewrite();
        }
        self.journal.stop();
    }

    fn give_up(&mut self) {
        let failures = self.backoff.failures();
        error!(
            "giving up after {failures} failures in a row: only a restart helps; what was acknowledged \
             is stored"
        );
        self.stop = None;
        self.vitals.give_up();
    }

    /// Opens a device, after a wait where that is not the first attempt, and sees to it that every
    /// session is brought back on it.
    fn rebuild(&mut self, why: &str) -> Next {
        let began = machine::now();
        self.vitals.healthy.store(false, Ordering::Relaxed);
        self.refuse_everybody(why);
        loop {
            let Some(wait) = self.backoff.next(machine::now()) else { return Next::GiveUp };
            if !self.refuse_for(wait, why) {
                return Next::Stop;
            }
            self.vitals.rebuilds.fetch_add(1, Ordering::Relaxed);
            match catch_unwind(AssertUnwindSafe(|| (self.open)())) {
                Ok(Ok(backend)) => {
                    // The old one is dropped here; what it says about that is nobody's business.
                    let old = std::mem::replace(&mut self.backend, backend);
                    let _ = catch_unwind(AssertUnwindSafe(|| drop(old)));
                    info!("the device is open again after {:.1?}", machine::since(began));
                    self.vitals.healthy.store(true, Ordering::Relaxed);
                    return Next::GoOn;
                }
                Ok(Err(failure)) => warn!("opening the device: {failure}"),
                Err(_) => warn!("opening the device panicked"),
            }
        }
    }

    /// Lets some time pass. Whoever asks for something meanwhile is refused; false where that is to stop.
    fn refuse_for(&mut self, time: Duration, why: &str) -> bool {
        let why = SessionError::Unavailable(format!("{why}; try again"));
        let deadline = machine::now() + time;
        while machine::now() < deadline {
            match self.wait(deadline) {
                Ok(Message::Stop(until)) => {
                    self.stop = Some(until);
                    return false;
                }
                Ok(message) => message.refuse(&why),
                Err(Silence::Nobody) => return false,
                Err(Silence::Time) => {}
            }
        }
        true
    }

    /// Tells everybody who waits that it was for nothing, and takes all sessions off the device.
    fn refuse_everybody(&mut self, why: &str) {
        let why = SessionError::Unavailable(format!("{why}; nothing was changed, try again"));
        std::mem::take(&mut self.mail).into_values().for_each(|inbox| inbox.refuse(&why));
        self.journal.send();
        self.fallen.clear();
        self.slots = Default::default();
        self.saving = false;
        // What was read for the old device is of no use on another.
        let coming: Vec<Arc<Session>> =
            self.coming.values().map(|coming| coming.session().clone()).collect();
        coming.into_iter().for_each(|session| self.come_back(session));
        for (_, simulation) in std::mem::take(&mut self.simulations).into_iter() {
            self.evict(simulation, &why);
        }
    }
}
