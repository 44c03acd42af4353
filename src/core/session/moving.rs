//! Objects that move by themselves, cycle by cycle.

use std::sync::Arc;

use firn_engine::frame::{Edit, Moves, Placement, Run};

use crate::core::session::{Collider, SessionState};

impl SessionState {
    /// Whether an object moves by itself.
    pub fn moves(&self) -> bool {
        !self.movers.is_empty()
    }

    /// Steps of a cycle of `dt` seconds in which objects move: as many as the fastest of them takes.
    pub fn steps_of_cycle(&self, dt: f64) -> u32 {
        let movers = self.movers.iter().filter_map(|id| self.colliders.get(id));
        movers.map(|mover| mover.body.steps(&self.grid, dt)).max().unwrap_or(1)
    }

    /// Moves objects through some cycles. Returns what the device does of that, cycle by cycle; nothing where none
    /// moves in the first.
    pub fn move_objects(&mut self, run: Run) -> Vec<Moves> {
        if !self.moves() {
            return Vec::new();
        }
        (0..run.cycles).map(|_| self.move_through_cycle(run.dt)).collect()
    }

    fn move_through_cycle(&mut self, dt: f64) -> Moves {
        if !self.moves() {
            return Moves::default();
        }
        let steps = self.steps_of_cycle(dt);
        let step = |left| self.step(dt / f64::from(steps), left);
        let moves = Moves { steps: (1..=steps).rev().map(step).collect() };
        for id in std::mem::take(&mut self.movers) {
            let Some(mover) = self.colliders.get_mut(&id) else { continue };
            *mover = Collider {
                contact: mover.contact,
                ..Collider::new(mover.body.clone(), &self.grid)
            };
            if !mover.body.motion.is_still() {
                self.movers.insert(id);
            }
        }
        moves
    }

    /// Moves every object by the first of the steps that are left of a cycle.
    fn step(&mut self, dt: f64, left: u32) -> Vec<Edit> {
        let mut edits = Vec::new();
        for id in &self.movers {
            let Some(mover) = self.colliders.get_mut(id) else { continue };
            let Some(footprints) = mover.body.step(&self.grid, dt, left) else { continue };
            let collider = Arc::new(Placement { mass: mover.body.load(), footprints });
            edits.push(Edit::PutCollider { id: id.clone(), collider, placed: true });
        }
        edits
    }
}
