//! What happens when frames can't be carried out any more: the device is opened anew, and every
//! session brought back.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use tracing::{error, info, warn};

use crate::session::error::SessionError;

use super::engine::Engine;
use super::revive::Revival;

/// Attempts to open a device, and time between them.
const ATTEMPTS: u32 = 20;
const BETWEEN_ATTEMPTS: Duration = Duration::from_millis(500);

/// Failures within some time after which going on makes no sense.
const MOST_FAILURES: usize = 5;
const FAILURES_WITHIN: Duration = Duration::from_secs(60);

impl Engine {
    /// Runs until it is told to stop or nothing helps any more.
    pub(super) fn supervise(mut self) {
        let mut failures: Vec<Instant> = Vec::new();
        loop {
            let why = match catch_unwind(AssertUnwindSafe(|| self.run())) {
                Ok(Ok(())) => break,
                Ok(Err(failure)) => {
                    error!("{failure}");
                    "the device has failed and is opened anew"
                }
                Err(_) => "the engine has failed and is started anew",
            };
            failures.retain(|failure| failure.elapsed() < FAILURES_WITHIN);
            failures.push(Instant::now());
            error!("{why}");
            if failures.len() > MOST_FAILURES || !self.open_anew(why) {
                error!("giving up: only a restart helps");
                self.vitals.healthy.store(false, Ordering::Relaxed);
                self.stop = None;
                break;
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

    /// Opens a device and sees to it that every session is brought back on it.
    fn open_anew(&mut self, why: &str) -> bool {
        let began = Instant::now();
        self.refuse_everybody(why);
        for attempt in 1..=ATTEMPTS {
            match (self.open)() {
                Ok(backend) => {
                    // The old one is dropped here; what it says about that is nobody's business.
                    let old = std::mem::replace(&mut self.backend, backend);
                    let _ = catch_unwind(AssertUnwindSafe(|| drop(old)));
                    info!("the device is open again after {:.1?}", began.elapsed());
                    return true;
                }
                Err(failure) => warn!("opening the device, attempt {attempt}: {failure}"),
            }
            std::thread::sleep(BETWEEN_ATTEMPTS);
        }
        false
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
