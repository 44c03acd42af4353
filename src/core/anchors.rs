//! How far sessions have come, noted in the journal so that a restart loses less than a second of
//! what passes by itself: one heartbeat of the world says it for all sessions whose ticks follow the beat, as
//! their anchors tell. Those that were stepped, or have slipped, get another anchor before it.

use crate::core::record::Heartbeat;
use crate::core::{Effect, World};

/// Beats between two heartbeats. With the time for which anchors wait for company it makes less than a
/// second.
const ROUND: u64 = 40;

impl World {
    /// Notes how far all have come, every so many beats.
    pub(crate) fn anchor_some(&mut self) {
        for key in self.simulations.active_in_turn(self.frame, ROUND) {
            self.schedule(key);
        }
        if self.frame.is_multiple_of(ROUND) && self.storage.is_settled() {
            for key in self.simulations.active_in_turn(0, 1) {
                self.anchor(key);
            }
            self.beat_heart();
        }
    }

    /// Notes how far a session has come, where that is not known already.
    pub(crate) fn anchor(&mut self, key: u64) {
        // What is on its way back has not come to where its anchor is.
        if !self.durable || !self.storage.is_settled() || self.coming.contains_key(&key) {
            return;
        }
        let Some(simulation) = self.simulations.get_mut(&key) else { return };
        let append = simulation.change_anchor();
        let ticks = simulation.log.ticks();
        self.simulations.set_ticking(key, ticks);
        if let Some(append) = append {
            self.submit(append, Vec::new());
        }
    }

    /// Notes how far all sessions have come.
    pub(crate) fn anchor_all(&mut self) {
        for key in self.simulations.keys() {
            self.anchor(key);
        }
        self.beat_heart();
    }

    /// How far the world has come.
    pub(crate) fn heartbeat(&self) -> Heartbeat {
        Heartbeat { frame: self.frame, round: self.round }
    }

    /// Notes how far the world has come, where that says something about a session.
    fn beat_heart(&mut self) {
        if self.simulations.is_any_ticking() {
            self.effects.push(Effect::Heartbeat(self.heartbeat()));
        }
    }
}
