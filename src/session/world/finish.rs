//! The end of the world's thread: runs come to their end, and what is not covered yet is saved.

use std::time::{Duration, Instant};

use tracing::{info, warn};

use crate::session::journal::Feedback;

use super::engine::Engine;

/// Cells of which checkpoints are made in one frame when the server stops.
const LAST_CHECKPOINTS: u64 = 4 << 20;

impl Engine {
    /// Writes the last checkpoints and marks, where it was told to stop.
    pub(super) fn finish(&mut self) {
        let Some(deadline) = self.stop.filter(|_| self.journal.durable) else { return };
        let began = Instant::now();
        let frame = self.frame;
        self.mark_all();
        let mut left = Vec::new();
        for (key, simulation) in self.simulations.iter_mut() {
            simulation.catch_up(frame);
            simulation.frozen = true;
            if !simulation.log.is_covered() {
                left.push(key);
            }
        }
        self.end_runs(deadline);
        let count = left.len();
        let mut missing = 0;
        while !left.is_empty() && Instant::now() < deadline {
            let mut cells = 0;
            self.simulations.take_active();
            while let Some(&key) = left.last()
                && cells < LAST_CHECKPOINTS
            {
                left.pop();
                if let Some(simulation) = self.simulations.get_mut(&key) {
                    simulation.next.checkpoint = true;
                    cells += simulation.session.spec.grid.cells();
                    self.simulations.set_active(key, true);
                    missing += 1;
                }
            }
            if let Err(failure) = self.carry_out_frame(false) {
                warn!("no last checkpoints: {failure}");
                break;
            }
        }
        while missing > 0 && Instant::now() < deadline {
            let patience = deadline.saturating_duration_since(Instant::now());
            match self.journal.wait(patience.min(Duration::from_secs(1))) {
                Some(Feedback::Checkpoint { .. }) => missing -= 1,
                Some(_) => {}
                None if self.journal.refusal().is_some() => break,
                None => {}
            }
        }
        info!("{} of {count} last checkpoints after {:.1?}", count - left.len(), began.elapsed());
    }

    /// Lets the runs that are under way come to their end; nobody begins another.
    fn end_runs(&mut self, deadline: Instant) {
        let under_way = |engine: &mut Engine| {
            engine.simulations.iter_mut().any(|(_, simulation)| simulation.portions.are_under_way())
        };
        while under_way(self) && Instant::now() < deadline {
            if let Err(failure) = self.carry_out_frame(false) {
                warn!("runs were not ended: {failure}");
                return;
            }
        }
    }
}
