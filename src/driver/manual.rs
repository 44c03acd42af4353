//! A world without threads, for simulations: who has it says who works when.

use std::time::Instant;

use firn_engine::parallel::Executor;

use crate::core::WorldConfig;
use crate::driver::thread::{End, Thread};
use crate::driver::{Driver, Durability, OpenBackend, StartError};
use crate::journal::Workers;
use crate::session::registry::Sessions;

/// What the world's thread does, turn by turn.
pub struct ManualWorld(Thread);

/// What the journal's threads do, turn by turn.
pub struct ManualJournal(Workers);

impl ManualWorld {
    /// As [`Driver::open`], without threads.
    ///
    /// # Errors
    /// As [`Driver::open`].
    pub fn open(
        open: OpenBackend,
        config: WorldConfig,
        durability: Durability,
    ) -> Result<(Sessions, ManualWorld, ManualJournal), StartError> {
        let (sessions, thread, workers) =
            Driver::prepare(open, config, durability, Executor::OneThread)?;
        Ok((sessions, ManualWorld(thread), ManualJournal(workers)))
    }

    /// Takes in what the last frame has done and what has arrived, and does the next frame. False means that
    /// the world is at its end.
    pub fn turn(&mut self) -> bool {
        self.0.turn(None);
        self.0.end != Some(End::Over)
    }

    /// When there is something to do at the latest, as a beat.
    pub fn due(&self) -> Instant {
        self.0.due()
    }

    /// Ends the world; what may be saved before a deadline is.
    pub fn stop(self, deadline: Instant) {
        self.0.stop(deadline);
    }
}

impl ManualJournal {
    /// Commits what waits for it.
    pub fn commit(&mut self) {
        self.0.commit();
    }

    /// Makes a checkpoint of a snapshot, where one waits for that.
    pub fn pack(&mut self) {
        self.0.pack();
    }

    /// Commits the last of it, once the world has ended.
    pub fn end(self) {
        self.0.end();
    }
}
