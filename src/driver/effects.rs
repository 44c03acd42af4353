//! What the core wants done, carried out.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use firn_engine::frame::{EngineError, Frame, Outcome};
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use tracing::warn;

use crate::core::reading::Wanted;
use crate::core::vitals::FrameTime;
use crate::core::{Effect, Input};
use crate::driver::thread::{End, Thread};
use crate::machine;

/// Longest wait for the device at a time.
const PATIENCE: Duration = Duration::from_millis(100);

impl Thread {
    /// Carries out what the core wants done.
    ///
    /// # Errors
    /// Those of the device.
    pub(super) fn carry_out(&mut self) -> Result<(), EngineError> {
        while let Some(effect) = self.effects.pop_front() {
            match effect {
                Effect::Make { slot, made } => {
                    let result = self.backend.take_in(slot, made);
                    self.inputs.push_back(Input::Made { slot, result });
                }
                Effect::Free(slot) => self.backend.release(slot),
                Effect::Submit(frame) => {
                    self.journal.send();
                    self.outcome = Some(self.carry_out_frame(frame)?);
                }
                Effect::OpenDevice => {
                    let is_open = self.reopen();
                    self.inputs.push_back(Input::Opened(is_open));
                }
                Effect::Read(wave) => self.read(wave),
                Effect::Append(append) => self.journal.add(append),
                Effect::Heartbeat(heartbeat) => self.journal.beat(heartbeat),
                Effect::Rewrite { sessions, heartbeat, heard } => {
                    self.journal.rewrite(sessions, heartbeat, heard);
                }
                Effect::Pack(job) => self.journal.checkpoint(job),
                Effect::Forget(keys) => keys.iter().for_each(|key| self.keyed.forget(key)),
                Effect::Recovered => self.next_beat = machine::now(),
                Effect::GiveUp => {
                    self.vitals.give_up();
                    self.end = Some(End::Over);
                }
                Effect::Stopped => self.end = Some(End::Over),
            }
        }
        self.journal.send();
        self.vitals.memory.store(self.backend.memory(), Ordering::Relaxed);
        Ok(())
    }

    /// Has the device carry a frame out.
    fn carry_out_frame(&mut self, frame: Frame) -> Result<(Outcome, FrameTime), EngineError> {
        let mut lap = Lap(machine::now());
        let mut time = FrameTime { sessions: frame.work.len() as u32, ..FrameTime::default() };
        self.backend.submit(frame)?;
        time.parts.submitting = lap.next();
        let outcome = loop {
            if let Some(outcome) = self.backend.poll(PATIENCE)? {
                break outcome;
            }
        };
        time.parts.waiting = lap.next();
        Ok((outcome, time))
    }

    /// Opens the device anew. Returns whether it is open.
    fn reopen(&mut self) -> bool {
        match catch_unwind(AssertUnwindSafe(|| (self.open)())) {
            Ok(Ok(backend)) => {
                // The old one is dropped here; what it says about that is nobody's business.
                let old = std::mem::replace(&mut self.backend, backend);
                let _ = catch_unwind(AssertUnwindSafe(|| drop(old)));
                return true;
            }
            Ok(Err(failure)) => warn!("opening the device: {failure}"),
            Err(_) => warn!("opening the device panicked"),
        }
        false
    }

    /// Has stored sessions read on another thread, several at a time.
    fn read(&self, wave: Vec<Wanted>) {
        let (maker, mailbox) = (self.backend.maker(), self.mailbox.clone());
        let work = move || {
            let read = wave.into_par_iter().map(|wanted| wanted.read(maker)).collect();
            // Where the world has ended, nobody waits for it.
            if let Some(mailbox) = mailbox.upgrade() {
                let _ = mailbox.blocking_send(Input::Read(read));
            }
        };
        machine::aside(Box::new(work), |work| drop(self.runtime.spawn_blocking(work)));
    }
}

/// Takes the times from one moment to the next.
pub(super) struct Lap(pub Instant);

impl Lap {
    pub fn next(&mut self) -> Duration {
        let now = machine::now();
        now.duration_since(std::mem::replace(&mut self.0, now))
    }
}
