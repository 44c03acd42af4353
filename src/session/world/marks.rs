//! How far sessions have come, noted in the journal so that a restart loses less than a second of
//! what passes by itself.
//!
//! A session that is in frames is marked from time to time. When it leaves them it is marked once
//! more: from then on it stands still, or its ticks pass by themselves, and the one heartbeat of
//! the world says how many.

use super::engine::Engine;

/// Frames between two marks of a session that is in frames, and between two heartbeats. With the
/// time for which marks wait for company it makes less than a second.
const ROUND: u64 = 40;

impl Engine {
    /// Marks the sessions whose turn it is in this frame, and what comes of it the world.
    pub(super) fn mark_some(&mut self) {
        for key in self.simulations.active_in_turn(self.frame, ROUND) {
            self.mark(key);
            self.schedule(key);
        }
        if self.frame.is_multiple_of(ROUND) {
            self.beat_heart();
        }
    }

    /// Marks how far a session has come, where that is not known already.
    pub(super) fn mark(&mut self, key: u64) {
        // What is being woken has not come to what is marked already.
        if !self.journal.durable || !self.storage.is_settled() || self.coming.contains_key(&key) {
            return;
        }
        let Some(simulation) = self.simulations.get_mut(&key) else { return };
        let mark = simulation.mark();
        let rests = simulation.log.rests();
        self.simulations.set_at_rest(key, rests);
        if let Some(mark) = mark {
            self.submit(mark, Vec::new());
        }
    }

    /// Marks how far all sessions have come.
    pub(super) fn mark_all(&mut self) {
        for key in self.simulations.keys() {
            self.mark(key);
        }
        self.beat_heart();
        self.journal.send();
    }

    /// Notes how far the world has come, where that says something about a session.
    fn beat_heart(&mut self) {
        if self.simulations.is_any_at_rest() {
            self.journal.beat(self.frame);
        }
    }
}
