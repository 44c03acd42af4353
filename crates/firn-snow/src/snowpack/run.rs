//! Cycles, and what is evaluated before each, in parts of any size, which do not change the result.
//!
//! A part is measured in units: a cell, once evaluated or compacted.

use rayon::prelude::*;

use crate::column::Column;
use crate::grid::TILE_COLUMNS;

use super::{Collider, Snowpack, Tile};

/// How far a run has come, or an evaluation.
#[derive(Clone, Debug)]
pub struct Progress {
    /// Cycles of the run; none where contacts and stresses are evaluated alone.
    cycles: u32,
    /// Cycles that are over.
    done: u32,
    /// Cycles that tiles without objects take at once, after those.
    at_once: u32,
    /// The one of them that tiles under objects are in.
    cycle: u32,
    stage: Stage,
    /// The first object or tile that the stage still has to do.
    next: usize,
    /// Steps that the cycle has for tiles under objects: 1 where none moves.
    steps: u32,
    /// Tiles that are under no object meanwhile have had the cycle.
    under_objects: bool,
    /// A cell under an object has changed in this cycle.
    moved: bool,
    /// A contact is not what it was in the cycle before.
    restless: bool,
    /// 1 + index of the last cycle in which a cell changed; 0 for none.
    last_change: u32,
    over: bool,
}

/// What is done in a cycle, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// How objects touch the snow.
    Contacts,
    /// Stresses that are not what they were.
    Stresses,
    /// Compaction of tiles without objects, of several cycles at once.
    Free,
    /// Compaction of tiles under objects.
    Loaded,
}

impl Progress {
    fn new(cycles: u32) -> Progress {
        Progress {
            cycles,
            done: 0,
            at_once: 0,
            cycle: 0,
            stage: Stage::Contacts,
            next: 0,
            steps: 0,
            under_objects: false,
            moved: false,
            restless: false,
            last_change: 0,
            over: false,
        }
    }

    /// Whether all of it is done.
    pub fn is_over(&self) -> bool {
        self.over
    }

    /// 1 + the index of the last cycle so far in which a cell changed, 0 where none did.
    pub fn last_change(&self) -> u32 {
        self.last_change
    }

    /// Begins the next stage.
    fn enter(&mut self, stage: Stage) {
        (self.stage, self.next) = (stage, 0);
    }

    /// Ends a cycle of the tiles under objects. `stops` says that nothing changes in those that follow.
    fn end_cycle(&mut self, stops: bool) {
        if self.moved {
            self.last_change = self.last_change.max(self.done + self.cycle + 1);
        }
        self.moved = false;
        self.enter(Stage::Contacts);
        self.cycle += 1;
        if stops || self.cycle >= self.at_once {
            self.done += self.at_once;
            (self.cycle, self.at_once) = (0, 0);
            self.over = self.done >= self.cycles;
        }
    }
}

impl Snowpack {
    /// Evaluates contacts, and the stresses that have changed. It is due after edits; a run does it
    /// before every cycle.
    pub fn evaluate(&mut self) {
        let mut progress = self.begin_evaluation();
        self.go_on(&mut progress, u64::MAX);
    }

    /// Begins to evaluate contacts, and the stresses that have changed.
    pub fn begin_evaluation(&mut self) -> Progress {
        self.list_loads();
        Progress::new(0)
    }

    /// Runs a number of cycles of `dt` seconds each; returns 1 + the index of the last cycle in
    /// which a cell changed, 0 where none did.
    pub fn run(&mut self, cycles: u32, dt: f64) -> u32 {
        let mut progress = self.begin_run(cycles, dt);
        self.go_on(&mut progress, u64::MAX);
        progress.last_change
    }

    /// Begins a number of cycles of `dt` seconds each.
    pub fn begin_run(&mut self, cycles: u32, dt: f64) -> Progress {
        self.list_loads();
        if cycles > 0 && dt != self.dt {
            // What rests in short cycles may move in longer ones.
            self.dt = dt;
            self.wake();
        }
        Progress { over: cycles == 0, ..Progress::new(cycles) }
    }

    /// Begins a cycle in which objects move over some tiles. Until it ends, these and all under objects are stepped
    /// together, and no others.
    pub fn begin_moves(&mut self, tiles: impl Iterator<Item = u32>) {
        self.list_loads();
        self.swept = self.loaded.iter().copied().chain(tiles.map(|tile| tile as usize)).collect();
        self.relist = true;
    }

    /// Begins one of so many equal steps of such a cycle, which takes `dt` seconds. All other tiles take the cycle
    /// with the `first`.
    pub fn begin_step(&mut self, dt: f64, steps: u32, first: bool) -> Progress {
        Progress { steps, under_objects: !first, ..self.begin_run(1, dt) }
    }

    /// Ends such a cycle.
    pub fn end_moves(&mut self) {
        self.swept.clear();
        self.relist = true;
    }

    /// Goes on with a run or an evaluation, until about so many units are done or all of it is over; at
    /// least one object or tile is. Nothing else may happen to the snowpack in between. Returns the units
    /// that were done.
    pub fn go_on(&mut self, progress: &mut Progress, most: u64) -> u64 {
        let mut units = 0;
        while !progress.over && units < most {
            if progress.at_once == 0 {
                let left = progress.cycles - progress.done;
                let most_cycles = (most / self.units_in_a_cycle()).max(1);
                progress.at_once = u32::try_from(most_cycles).unwrap_or(u32::MAX).min(left);
            }
            let left = most - units;
            units += match progress.stage {
                Stage::Contacts => self.touch(progress, left),
                Stage::Stresses => self.press(progress, left),
                Stage::Free => self.compact_free(progress, left),
                Stage::Loaded => self.compact_loaded(progress, left),
            };
        }
        units
    }

    /// Units of a cycle in which every cell changes.
    fn units_in_a_cycle(&self) -> u64 {
        self.tiles.len() as u64 * self.units_of_a_tile()
    }

    fn units_of_a_tile(&self) -> u64 {
        u64::from(TILE_COLUMNS * self.grid.height)
    }

    /// Evaluates how objects touch the snow.
    fn touch(&mut self, progress: &mut Progress, most: u64) -> u64 {
        let (tiles, always) = (&self.tiles, self.always_awake);
        let runs = progress.cycles > 0;
        let mut units = 0;
        for collider in self.colliders.values_mut().skip(progress.next) {
            if units >= most {
                return units;
            }
            if always || collider.changed || collider.tiles.iter().any(|&tile| tiles[tile].moved) {
                collider.evaluate(tiles);
                units += collider.columns();
            }
            let contact = &mut collider.contact;
            contact.resting = contact.last_cycle == Some(contact.footing());
            if runs {
                contact.last_cycle = Some(contact.footing());
                progress.restless |= !contact.resting;
            }
            units += 1;
            progress.next += 1;
        }
        progress.enter(Stage::Stresses);
        units
    }

    /// Evaluates the stresses that have changed: of any tile before the first cycle, later of those under
    /// objects.
    fn press(&mut self, progress: &mut Progress, most: u64) -> u64 {
        let all = progress.cycle == 0 && !progress.under_objects;
        let colliders: Vec<&Collider> = self.colliders.values().collect();
        let (grid, material, always) = (&self.grid, &self.material, self.always_awake);
        let is_due = |tile: &Tile| {
            let changed = tile.loads.iter().any(|&load| colliders[load].changed);
            always || tile.stale || changed || (tile.moved && !tile.loads.is_empty())
        };
        // The loads of some tiles cost far more than their snow.
        let units_of = |tile: &Tile| match is_due(tile) {
            true => (tile.cells() * (1 + tile.loads.len() as u64)).max(1),
            false => 1,
        };
        let part = if all {
            let count = fitting(self.tiles[progress.next..].iter().map(&units_of), most);
            next_of(&mut self.tiles, &mut progress.next, count)
        } else {
            let left = self.loaded[progress.next..].iter().map(|&tile| units_of(&self.tiles[tile]));
            let count = fitting(left, most);
            next_among(&mut self.tiles, &self.loaded, &mut progress.next, count)
        };
        let ended = part.is_empty();
        let evaluated = part.into_par_iter().map(|tile| {
            let (due, units) = (is_due(tile), units_of(tile));
            tile.moved = false;
            if due {
                tile.stress(grid, material, &colliders);
            }
            units
        });
        let units = evaluated.sum();
        if ended {
            self.colliders.values_mut().for_each(|collider| collider.changed = false);
            progress.over = progress.cycles == 0;
            progress.enter(if all { Stage::Free } else { Stage::Loaded });
        }
        units
    }

    /// Compacts tiles without objects, of all cycles that they take at once.
    fn compact_free(&mut self, progress: &mut Progress, most: u64) -> u64 {
        let cycles = progress.at_once;
        let most_tiles = most / (self.units_of_a_tile() * u64::from(cycles));
        let (grid, material, always) = (&self.grid, &self.material, self.always_awake);
        let dt = self.dt as f32;
        let part = next_of(&mut self.tiles, &mut progress.next, most_tiles);
        if part.is_empty() {
            progress.enter(Stage::Loaded);
        }
        let due = part.into_par_iter().filter(|tile| !tile.under_objects);
        let compacted = due.map(|tile| {
            tile.run_if_due(always, cycles, |column| column.compact(grid, material, cycles, dt))
        });
        let (last, units) = compacted.reduce(|| (0, 0), |a, b| (a.0.max(b.0), a.1 + b.1));
        if last > 0 {
            progress.last_change = progress.last_change.max(progress.done + last);
        }
        units
    }

    /// Compacts tiles under objects, of one cycle.
    fn compact_loaded(&mut self, progress: &mut Progress, most: u64) -> u64 {
        let most_tiles = most / self.units_of_a_tile();
        let (grid, material, always) = (&self.grid, &self.material, self.always_awake);
        // What rests in a step need not rest in a cycle, which is longer.
        let (dt, in_steps) = (self.dt / f64::from(progress.steps.max(1)), progress.steps > 0);
        let step = self.pressing.step(dt);
        let dt = dt as f32;
        let part = next_among(&mut self.tiles, &self.loaded, &mut progress.next, most_tiles);
        if part.is_empty() {
            let stops = !progress.moved && !progress.restless && !always;
            progress.restless = false;
            progress.end_cycle(stops);
            return 0;
        }
        let run = |column: &mut Column| u32::from(column.cycle(grid, material, step, dt));
        let compacted = part.into_par_iter().map(|tile| {
            let was_awake = tile.awake;
            let compacted = tile.run_if_due(always, 1, run);
            tile.awake |= was_awake && in_steps;
            compacted
        });
        let (last, units) = compacted.reduce(|| (0, 0), |a, b| (a.0.max(b.0), a.1 + b.1));
        progress.moved |= last > 0;
        units
    }
}

/// How many of the first have about so many units together.
fn fitting(units: impl Iterator<Item = u64>, most: u64) -> u64 {
    let mut sum = 0u64;
    let fits = |units: &u64| {
        let fits = sum < most;
        sum = sum.saturating_add(*units);
        fits
    };
    units.take_while(fits).count() as u64
}

/// The next of all tiles: about so many of them, and at least one where there is one.
fn next_of<'a>(tiles: &'a mut [Tile], next: &mut usize, most: u64) -> Vec<&'a mut Tile> {
    let count = usize::try_from(most.max(1)).unwrap_or(usize::MAX).min(tiles.len() - *next);
    let part = &mut tiles[*next..*next + count];
    *next += count;
    part.iter_mut().collect()
}

/// The next of some tiles, which are listed in ascending order.
fn next_among<'a>(
    tiles: &'a mut [Tile],
    list: &[usize],
    next: &mut usize,
    most: u64,
) -> Vec<&'a mut Tile> {
    let count = usize::try_from(most.max(1)).unwrap_or(usize::MAX).min(list.len() - *next);
    let mut part = Vec::with_capacity(count);
    let (mut rest, mut first) = (tiles, 0);
    for &tile in &list[*next..*next + count] {
        let (head, tail) = rest.split_at_mut(tile - first + 1);
        part.extend(head.last_mut());
        (rest, first) = (tail, tile + 1);
    }
    *next += count;
    part
}
