//! The end of everything: time stands still, what is under way comes to its end, and what is not covered yet is
//! saved.

use std::collections::BTreeSet;
use std::time::Instant;

use tracing::info;

use crate::core::session::{SessionError, Simulation};
use crate::core::{Effect, World};

/// Cells of which checkpoints are made at a time when the server stops: their snapshots are in memory
/// until they are compressed.
const LAST_CHECKPOINTS: u64 = 4 << 20;

/// How far everything has come to its end.
pub(crate) struct Stop {
    /// Nothing is begun after this.
    until: Instant,
    began: Instant,
    stage: Stage,
    /// Sessions of which checkpoints are being made, and those that are left.
    wave: BTreeSet<u64>,
    left: Vec<u64>,
    /// Checkpoints that are wanted, and those that are stored.
    wanted: usize,
    made: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Told,
    /// Steps end where they are, and runs come to their end.
    StandingStill,
    Saving,
    Over,
}

impl Stop {
    /// By some time.
    pub fn by(until: Instant, began: Instant) -> Stop {
        let (wave, left, stage) = (BTreeSet::new(), Vec::new(), Stage::Told);
        Stop { until, began, stage, wave, left, wanted: 0, made: 0 }
    }

    /// Notes that a checkpoint is stored, or never will be.
    pub fn checkpointed(&mut self, key: u64, stored: bool) {
        if self.wave.remove(&key) {
            self.made += usize::from(stored);
        }
    }
}

impl World {
    /// Does the next of what is to be done at the end.
    pub(crate) fn go_on_stopping(&mut self) {
        let Some(Stop { until, stage, .. }) = self.stop else { return };
        let in_time = self.now.instant < until;
        self.busy = false;
        match stage {
            Stage::Told if self.durable => self.stand_still(),
            Stage::StandingStill if in_time && self.have_runs_ended() => {}
            Stage::StandingStill => self.begin_saving(),
            Stage::Saving if in_time && self.storage.refusal().is_none() && self.save_more() => {}
            Stage::Told | Stage::Saving => self.be_over(),
            Stage::Over => {}
        }
    }

    fn set_stage_of_stop(&mut self, stage: Stage) {
        if let Some(stop) = &mut self.stop {
            stop.stage = stage;
        }
        self.busy = true;
    }

    /// Has time stand still everywhere.
    fn stand_still(&mut self) {
        let why = SessionError::Unavailable("the server is stopping".to_owned());
        // What is stored of sessions that panicked, or come back, is right, and what is here is not.
        let coming: Vec<u64> = self.coming.keys().copied().collect();
        for key in std::mem::take(&mut self.fallen).into_iter().chain(coming) {
            self.give_up_coming(key, &why);
            self.remove(key, &why);
        }
        let frame = self.frame;
        for (_, simulation) in self.simulations.iter_mut() {
            simulation.catch_up(frame);
            simulation.frozen = true;
        }
        self.set_stage_of_stop(Stage::StandingStill);
    }

    /// Has a frame carried out for what is under way. Returns whether anything is.
    fn have_runs_ended(&mut self) -> bool {
        self.drain_mail();
        self.simulations.iter_mut().for_each(|(_, simulation)| simulation.end_step());
        let busy = self.sound_ones(Simulation::has_orders);
        let any = !busy.is_empty();
        busy.into_iter().for_each(|key| self.simulations.set_active(key, true));
        if any {
            self.begin_frame(false, false);
            self.busy = true;
        }
        any
    }

    /// Writes how far all have come, and begins the last checkpoints.
    fn begin_saving(&mut self) {
        self.anchor_all();
        let left = self.sound_ones(|simulation| !simulation.log.is_covered());
        if let Some(stop) = &mut self.stop {
            (stop.wanted, stop.left) = (left.len(), left);
        }
        self.set_stage_of_stop(Stage::Saving);
    }

    /// Has the next checkpoints made once those before are stored. Returns whether there are more to come.
    fn save_more(&mut self) -> bool {
        let Some(stop) = &mut self.stop else { return false };
        stop.wave.retain(|key| !self.fallen.contains(key) && self.simulations.contains_key(key));
        if !stop.wave.is_empty() {
            return true;
        }
        self.simulations.clear_active();
        let mut cells = 0;
        while cells < LAST_CHECKPOINTS
            && let Some(key) = stop.left.pop()
        {
            if let Some(simulation) = self.simulations.get_mut(&key) {
                simulation.next.checkpoint = true;
                cells += simulation.session.spec.grid.padded_cells();
                self.simulations.set_active(key, true);
                stop.wave.insert(key);
            }
        }
        let any = !stop.wave.is_empty();
        if any {
            self.begin_frame(false, false);
        }
        any
    }

    fn be_over(&mut self) {
        if let Some(Stop { began, wanted, made, .. }) = self.stop {
            let took = self.now.instant.saturating_duration_since(began);
            info!("{made} of {wanted} last checkpoints after {took:.1?}");
        }
        self.set_stage_of_stop(Stage::Over);
        self.effects.push(Effect::Stopped);
    }

    /// Keys of the sessions of which something holds, those left out that panicked.
    fn sound_ones(&mut self, holds: impl Fn(&Simulation) -> bool) -> Vec<u64> {
        let fallen = &self.fallen;
        let all = self.simulations.iter_mut();
        let found = all.filter(|(key, simulation)| !fallen.contains(key) && holds(simulation));
        found.map(|(key, _)| key).collect()
    }
}
