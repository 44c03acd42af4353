//! Objects that move by themselves, cycle by cycle.

use std::sync::Arc;

use firn_engine::frame::{Edit, Moves, Placement, Run};
use firn_snow::ColumnSet;

use crate::core::session::{Collider, Counted, Orders, Reach, SessionState};

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

    /// Moves objects through some cycles, after the edits of some orders. Returns what the device does of that, cycle by
    /// cycle; nothing where none moves in the first.
    pub fn move_objects(&mut self, run: Run, orders: &mut Orders) -> Vec<Moves> {
        if !self.moves() {
            return Vec::new();
        }
        let mut edits = orders.edits.len();
        let mut cycle = |_| self.move_through_cycle(run.dt, &mut edits, &mut orders.counted);
        (0..run.cycles).map(&mut cycle).collect()
    }

    /// Moves objects through a cycle; `edits` numbers what the device does.
    fn move_through_cycle(
        &mut self,
        dt: f64,
        edits: &mut usize,
        counted: &mut Vec<Counted>,
    ) -> Moves {
        if !self.moves() {
            return Moves::default();
        }
        let steps = self.steps_of_cycle(dt);
        let step = |left| self.step(dt / f64::from(steps), left, edits, counted);
        let moves = Moves { steps: (1..=steps).rev().map(step).collect() };
        for id in std::mem::take(&mut self.movers) {
            let Some(mover) = self.colliders.get_mut(&id) else { continue };
            mover.reach = Reach::new(&mover.body, &self.grid);
            if !mover.body.motion.is_still() {
                self.movers.insert(id);
            }
        }
        moves
    }

    /// Moves every object by the first of the steps that are left of a cycle. What it leaves behind is laid down
    /// before.
    fn step(
        &mut self,
        dt: f64,
        left: u32,
        edits: &mut usize,
        counted: &mut Vec<Counted>,
    ) -> Vec<Edit> {
        let (mut laid, mut put) = (Vec::new(), Vec::new());
        for id in &self.movers {
            let Some(mover) = self.colliders.get_mut(id) else { continue };
            let Some(footprints) = mover.body.step(&self.grid, dt, left) else { continue };
            let before = mover.carried.mass();
            if let Some(snow) = mover.unload(&ColumnSet::under(&footprints)) {
                self.ledger.carried -= before - mover.carried.mass();
                for (edit, count) in snow.edits(id, *edits + laid.len()) {
                    laid.push(edit);
                    counted.push(count);
                }
            }
            let mass = Collider::weight(&mover.body, &mover.carried, &self.grid);
            let cover = mover.body.cover();
            mover.placement = Arc::new(Placement { mass, cover, footprints });
            let collider = mover.placement.clone();
            put.push(Edit::PutCollider { id: id.clone(), collider, placed: true });
        }
        laid.append(&mut put);
        *edits += laid.len();
        laid
    }
}
