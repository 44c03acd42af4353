//! A world without threads, for simulations: whoever has it says who works when.

use std::time::Instant;

use crate::session::journal::Workers;
use crate::session::registry::Sessions;

use super::engine::Engine;
use super::{Durability, OpenBackend, StartError, World, WorldConfig};

/// What the world's thread does, turn by turn.
pub struct ManualWorld(Engine);

/// What the journal's threads do, turn by turn.
pub struct ManualJournal(Workers);

impl ManualWorld {
    /// As [`World::open`], without threads.
    ///
    /// # Errors
    /// As [`World::open`].
    pub fn open(
        open: OpenBackend,
        config: WorldConfig,
        durability: Durability,
    ) -> Result<(Sessions, ManualWorld, ManualJournal), StartError> {
        let (sessions, engine, workers) = World::prepare(open, config, durability)?;
        Ok((sessions, ManualWorld(engine), ManualJournal(workers)))
    }

    /// Takes in what has arrived, and does a frame. False means that the world is at its end.
    pub fn turn(&mut self) -> bool {
        self.0.go_on(None)
    }

    /// When the next beat is due.
    pub fn next_beat(&self) -> Instant {
        self.0.next_beat
    }

    /// Ends the world; what may be saved before a deadline is.
    pub fn stop(mut self, deadline: Instant) {
        self.0.stop = Some(deadline);
        self.0.close();
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
