//! What happens when frames can't be carried out any more: the device is opened anew, and every
//! session brought back. Each attempt that fails is followed by a longer wait, until nothing but a new
//! process helps.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering;
use std::time::Duration;

use tracing::{error, info, warn};

use crate::machine;
use crate::session::error::SessionError;
use crate::session::message::{Message, stopped};

use super::engine::{Beginning, Engine, Silence};
use super::revive::Revival;

/// Time between two looks at whether the beginning of this life is on disk.
const UNWRITTEN: Duration = Duration::from_millis(50);

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
                Beginning::HandedOver => Some(machine::now() + UNWRITTEN),
                _ if self.busy || !self.comebacks.is_empty() => None,
                _ => Some(self.next_beat),
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
        self.reviving = false;
        for session in self.give_up_all_waking(&why) {
            if let Some(stored) = self.new_life(session.key, 0) {
                self.comebacks.insert(session.key, Revival::anew(session, stored));
            }
        }
        for (key, simulation) in std::mem::take(&mut self.simulations).into_iter() {
            // Where it was being brought back, that begins anew.
            if self.comebacks.contains_key(&key) {
                simulation.refuse_all(&why);
            } else {
                self.evict(simulation, &why);
            }
        }
    }
}
