//! What happens when frames can't be carried out any more: the device is opened anew, and every
//! session brought back. Each attempt that fails is followed by a longer wait, until nothing but a new
//! process helps.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use tracing::{error, info, warn};

use crate::session::error::SessionError;
use crate::session::message::Message;

use super::backoff::Backoff;
use super::engine::Engine;
use super::revive::Revival;

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
        let mut backoff = Backoff::default();
        loop {
            let why = match catch_unwind(AssertUnwindSafe(|| self.run())) {
                Ok(Ok(())) => break,
                Ok(Err(failure)) => {
                    error!("{failure}");
                    "the device has failed and is opened anew"
                }
                Err(_) => "the engine has failed and is started anew",
            };
            error!("{why}");
            match self.rebuild(why, &mut backoff) {
                Next::GoOn => {}
                Next::Stop => break,
                Next::GiveUp => {
                    self.give_up(backoff.failures());
                    break;
                }
            }
        }
        let ended = catch_unwind(AssertUnwindSafe(|| self.finish()));
        if ended.is_err() {
            error!("writing the last checkpoints panicked; the journal holds what they would");
        }
        self.vitals.healthy.store(false, Ordering::Relaxed);
        // Whoever still waits learns that nobody answers any more.
        self.inbox.close();
        self.journal.stop();
    }

    fn give_up(&mut self, failures: u32) {
        error!(
            "giving up after {failures} failures in a row: only a restart helps; what was acknowledged \
             is stored"
        );
        self.stop = None;
        self.vitals.give_up();
    }

    /// Opens a device, after a wait where that is not the first attempt, and sees to it that every
    /// session is brought back on it.
    fn rebuild(&mut self, why: &str, backoff: &mut Backoff) -> Next {
        let began = Instant::now();
        self.vitals.healthy.store(false, Ordering::Relaxed);
        self.refuse_everybody(why);
        loop {
            let Some(wait) = backoff.next(self.now()) else { return Next::GiveUp };
            if !self.wait(wait, why) {
                return Next::Stop;
            }
            self.vitals.rebuilds.fetch_add(1, Ordering::Relaxed);
            match catch_unwind(AssertUnwindSafe(|| (self.open)())) {
                Ok(Ok(backend)) => {
                    // The old one is dropped here; what it says about that is nobody's business.
                    let old = std::mem::replace(&mut self.backend, backend);
                    let _ = catch_unwind(AssertUnwindSafe(|| drop(old)));
                    info!("the device is open again after {:.1?}", began.elapsed());
                    self.vitals.healthy.store(true, Ordering::Relaxed);
                    return Next::GoOn;
                }
                Ok(Err(failure)) => warn!("opening the device: {failure}"),
                Err(_) => warn!("opening the device panicked"),
            }
        }
    }

    /// The present time of the world's clock.
    fn now(&self) -> Instant {
        let _inside = self.clock.enter();
        tokio::time::Instant::now().into_std()
    }

    /// Lets some time pass. Whoever asks for something meanwhile is refused; false where that is to stop.
    fn wait(&mut self, time: Duration, why: &str) -> bool {
        let why = SessionError::Unavailable(format!("{why}; try again"));
        let deadline = self.now() + time;
        while self.now() < deadline {
            let inbox = &mut self.inbox;
            let next = async { tokio::time::timeout_at(deadline.into(), inbox.recv()).await };
            match self.clock.block_on(next) {
                Ok(Some(Message::Stop(until))) => {
                    self.stop = Some(until);
                    return false;
                }
                Ok(Some(message)) => message.refuse(&why),
                Ok(None) => return false,
                Err(_) => {}
            }
        }
        true
    }

    /// Tells everybody who waits that it was for nothing, and takes all sessions off the device.
    fn refuse_everybody(&mut self, why: &str) {
        let why = SessionError::Unavailable(format!("{why}; nothing was changed, try again"));
        self.journal.abandon(&why);
        self.journal.flush();
        self.fallen.clear();
        self.slots = Default::default();
        self.checkpointing = None;
        self.reviving = false;
        for (session, stored) in self.give_up_all_waking(&why) {
            self.comebacks.insert(session.key, Revival::anew(session, stored));
        }
        for (key, mut simulation) in std::mem::take(&mut self.simulations).into_iter() {
            let session = simulation.session.clone();
            let until = simulation.until(self.frame);
            simulation.refuse_all(&why);
            if self.comebacks.contains_key(&key) {
                continue;
            }
            match self.journal.new_life(key, until) {
                Some(stored) => {
                    self.comebacks.insert(key, Revival::anew(session, stored));
                }
                // It was still being made.
                None => self.forget(key, &session),
            }
        }
    }
}
