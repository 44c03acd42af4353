//! Objects that move by themselves, cycle by cycle.

use std::sync::Arc;

use firn_engine::frame::{Edit, Moves, Placement, Run};
use firn_snow::ColumnSet;

use crate::core::session::{Collider, Counted, Orders, SessionState};

/// Places of objects that are made for cycles which are taken at once, about.
const MOST_PLACES: usize = 1 << 17;

/// How objects move through cycles.
struct Pace {
    /// Length of a cycle \[s\].
    dt: f64,
    /// Steps of a cycle in which they move.
    steps: u32,
    /// They move in one of so many cycles.
    every: u32,
}

impl SessionState {
    /// Whether an object moves by itself.
    pub fn moves(&self) -> bool {
        !self.movers.is_empty()
    }

    /// Whether ticks do more than let snow settle.
    pub fn is_restless(&self) -> bool {
        self.moves() || self.returned
    }

    /// Steps of a cycle of `dt` seconds in which objects move: as many as the fastest of them takes.
    pub fn steps_of_cycle(&self, dt: f64) -> u32 {
        let movers = self.movers.iter().filter_map(|id| self.colliders.get(id));
        movers.map(|mover| mover.body.steps(&self.grid, dt)).max().unwrap_or(1)
    }

    /// Moves objects through some cycles, so many at once, after the edits of some orders. Returns what the device does
    /// of that, cycle by cycle; nothing where none moves in the first.
    pub fn move_objects(&mut self, run: Run, at_once: u32, orders: &mut Orders) -> Vec<Moves> {
        if !self.moves() {
            return Vec::new();
        }
        let mut edits = orders.edits.len();
        let mut all = Vec::with_capacity(run.cycles as usize);
        while all.len() < run.cycles as usize {
            let pace = self.pace(run.dt, at_once);
            for cycle in 0..at_once {
                // Of very many, objects move in some: as far as in all of them.
                let part = pace.every.min(at_once - cycle);
                all.push(match cycle % pace.every {
                    0 => self.move_through_cycle(&pace, part, &mut edits, &mut orders.counted),
                    _ => Moves::default(),
                });
            }
        }
        all
    }

    /// How objects move through cycles of `dt` seconds of which so many are taken at once.
    fn pace(&self, dt: f64, at_once: u32) -> Pace {
        let most = (MOST_PLACES / self.movers.len().max(1)).max(1);
        let steps = (self.steps_of_cycle(dt) as usize).min(most);
        let every = (at_once as usize * steps).div_ceil(most).min(at_once as usize);
        Pace { dt, steps: steps as u32, every: every.max(1) as u32 }
    }

    /// Moves objects as far as in so many cycles, in the steps of one; `edits` numbers what the device does.
    fn move_through_cycle(
        &mut self,
        pace: &Pace,
        cycles: u32,
        edits: &mut usize,
        counted: &mut Vec<Counted>,
    ) -> Moves {
        if !self.moves() {
            return Moves::default();
        }
        let step_dt = pace.dt * f64::from(cycles) / f64::from(pace.steps);
        let step = |left| self.step(step_dt, left, edits, counted);
        let moves = Moves { steps: (1..=pace.steps).rev().map(step).collect() };
        let still =
            |id: &Arc<str>| self.colliders.get(id).is_none_or(|it| it.body.motion.is_still());
        let stopped: Vec<Arc<str>> = self.movers.iter().filter(|id| still(id)).cloned().collect();
        for id in stopped {
            self.movers.remove(&id);
        }
        moves
    }

    /// Moves every object by the first of the steps that are left of a cycle. What it leaves behind is laid down
    /// before.
    fn step(
        &mut self,
        step_dt: f64,
        left: u32,
        edits: &mut usize,
        counted: &mut Vec<Counted>,
    ) -> Vec<Edit> {
        let (mut laid, mut put) = (Vec::new(), Vec::new());
        for id in &self.movers {
            let Some(mover) = self.colliders.get_mut(id) else { continue };
            let Some(footprints) = mover.body.step(&self.grid, step_dt, left) else { continue };
            if let Some(snow) = mover.unload(&ColumnSet::under(&footprints), &mut self.ledger) {
                for (edit, count) in snow.edits(Some(id), *edits + laid.len()) {
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
