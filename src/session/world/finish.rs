//! The end of the world's thread: everything comes to its end, and what is not covered yet is saved.

use std::collections::HashSet;
use std::time::{Duration, Instant};

use tracing::{info, warn};

use crate::machine;
use crate::session::error::SessionError;
use crate::session::journal::{Record, Verdict};
use crate::session::simulation::Simulation;

use super::engine::Engine;

/// Cells of which checkpoints are made at a time when the server stops: their snapshots are in memory
/// until they are compressed.
const LAST_CHECKPOINTS: u64 = 4 << 20;

impl Engine {
    /// Writes how far all have come, and the last checkpoints, where it was told to stop.
    pub(super) fn finish(&mut self) {
        let Some(deadline) = self.stop.filter(|_| self.journal.durable) else { return };
        let began = machine::now();
        let why = SessionError::Unavailable("the server is stopping".to_owned());
        // What is stored of sessions that panicked, or come back, is right, and what is here is not.
        let coming: Vec<u64> = self.coming.keys().copied().collect();
        for key in std::mem::take(&mut self.fallen).into_iter().chain(coming) {
            self.give_up_coming(key, &why);
            self.remove(key, &why);
        }
        self.stand_still(deadline);
        self.anchor_all();
        let mut left = self.sound_ones(|simulation| !simulation.log.is_covered());
        let (count, mut made) = (left.len(), 0);
        while !left.is_empty() && machine::now() < deadline && self.storage.refusal().is_none() {
            let mut wave = self.next_to_save(&mut left);
            if let Err(failure) = self.carry_out_frame(false) {
                warn!("no last checkpoints: {failure}");
                break;
            }
            wave.retain(|key| !self.fallen.contains(key));
            made += self.wait_for_checkpoints(wave, deadline);
        }
        info!("{made} of {count} last checkpoints after {:.1?}", machine::since(began));
    }

    /// Has time stand still everywhere: steps end where they are, and what is under way is brought
    /// to its end.
    fn stand_still(&mut self, deadline: Instant) {
        let frame = self.frame;
        for (_, simulation) in self.simulations.iter_mut() {
            simulation.catch_up(frame);
            simulation.frozen = true;
        }
        while machine::now() < deadline {
            self.drain_mail();
            self.simulations.iter_mut().for_each(|(_, simulation)| simulation.end_step());
            let busy = self.sound_ones(Simulation::has_orders);
            if busy.is_empty() {
                return;
            }
            busy.into_iter().for_each(|key| self.simulations.set_active(key, true));
            if let Err(failure) = self.carry_out_frame(false) {
                warn!("runs were not ended: {failure}");
                return;
            }
        }
    }

    /// Keys of the sessions of which something holds, those left out that panicked.
    fn sound_ones(&mut self, holds: impl Fn(&Simulation) -> bool) -> Vec<u64> {
        let fallen = &self.fallen;
        let all = self.simulations.iter_mut();
        let found = all.filter(|(key, simulation)| !fallen.contains(key) && holds(simulation));
        found.map(|(key, _)| key).collect()
    }

    /// Has checkpoints made of some sessions in the next frame, and of no others.
    fn next_to_save(&mut self, left: &mut Vec<u64>) -> HashSet<u64> {
        let (mut wave, mut cells) = (HashSet::new(), 0);
        self.simulations.take_active();
        while cells < LAST_CHECKPOINTS
            && let Some(key) = left.pop()
        {
            if let Some(simulation) = self.simulations.get_mut(&key) {
                simulation.next.checkpoint = true;
                cells += simulation.session.spec.grid.padded_cells();
                self.simulations.set_active(key, true);
                wave.insert(key);
            }
        }
        wave
    }

    /// Waits until checkpoints are stored. Returns how many are.
    fn wait_for_checkpoints(&mut self, mut wave: HashSet<u64>, deadline: Instant) -> usize {
        let (mut packed, mut made) = (HashSet::new(), 0);
        while !wave.is_empty() && machine::now() < deadline && self.storage.refusal().is_none() {
            let patience = deadline.saturating_duration_since(machine::now());
            let Some(verdict) = self.journal.wait(patience.min(Duration::from_secs(1))) else {
                continue;
            };
            match &verdict {
                Verdict::Packed { key, checkpoint: Some(_), .. } => drop(packed.insert(*key)),
                Verdict::Packed { key, checkpoint: None, .. } => drop(wave.remove(key)),
                _ => {}
            }
            self.hear(verdict);
            let stored = |key: &u64| self.records.get(key).is_none_or(Record::is_quiet);
            let before = wave.len();
            wave.retain(|key| !(packed.contains(key) && stored(key)));
            made += before - wave.len();
        }
        made
    }
}
