//! One snowpack's work, in parts of any size.

use firn_snow::{Column, Grid, Progress, Snowpack, TILE_COLUMNS};

use crate::frame::{ColumnRead, Edit, TileCells, Work, WorkOutcome};
use crate::published::TileColumns;

use super::edit::{Done, carry_out, cells_of};

/// Work that has begun.
#[derive(Debug)]
pub struct Job {
    work: Work,
    /// The edits that are due: those of the work, later those of a step.
    edits: Vec<Edit>,
    /// The edit that is under way, and the first row of tiles, or tile, that it still has to do.
    edit: usize,
    next: u32,
    /// How far the moves have come, while objects move.
    moving: Option<Moving>,
    /// An object was put since contacts were last evaluated.
    put: bool,
    /// What has to be evaluated now, or run.
    progress: Option<Progress>,
    /// The cycles have begun.
    runs: bool,
    outcome: WorkOutcome,
    /// Tiles whose masses have been summed.
    tallied: u32,
}

/// How far the moves of some work have come.
#[derive(Debug)]
struct Moving {
    cycle: usize,
    step: u32,
    /// The edits of the step have been carried out, and its cycle has begun.
    begun: bool,
}

impl Job {
    /// Work that is about to begin.
    pub fn new(mut work: Work) -> Job {
        let outcome = WorkOutcome { slot: work.slot, ..WorkOutcome::default() };
        Job {
            edits: std::mem::take(&mut work.edits),
            work,
            edit: 0,
            next: 0,
            moving: None,
            put: false,
            progress: None,
            runs: false,
            outcome,
            tallied: 0,
        }
    }

    /// Takes what a frame says that resumes it.
    pub fn resume(&mut self, work: &Work) {
        self.work.publish = work.publish;
        self.work.limit = work.limit;
    }

    /// Goes on until the frame's limit. Returns whether all of it is done.
    pub fn go_on(&mut self, snowpack: &mut Snowpack) -> bool {
        let most = self.work.limit.unwrap_or(u64::MAX);
        self.outcome.units = 0;
        loop {
            let left = most.saturating_sub(self.outcome.units);
            if left == 0 {
                return false;
            }
            match self.step(snowpack, left) {
                Some(units) => self.outcome.units += units,
                None => return true,
            }
        }
    }

    /// Does the next part. Returns its units; nothing where all of it is done.
    fn step(&mut self, snowpack: &mut Snowpack, most: u64) -> Option<u64> {
        if let Some(progress) = &mut self.progress {
            let units = snowpack.go_on(progress, most);
            if progress.is_over() {
                let before = self.moving.as_ref().map_or(0, |moving| moving.cycle as u32);
                if progress.last_change() > 0 {
                    self.outcome.last_change = before + progress.last_change();
                }
                self.progress = None;
            }
            return Some(units);
        }
        if self.edit < self.edits.len() {
            return Some(self.go_on_editing(snowpack, most));
        }
        if self.moving.is_some() {
            self.go_on_moving(snowpack);
            return Some(1);
        }
        if !self.runs {
            self.runs = true;
            self.begin_run(snowpack);
            return Some(1);
        }
        let tiles = snowpack.grid().tiles();
        if self.work.tally && self.tallied < tiles {
            let end = self.tallied.saturating_add(cells_fit(most, snowpack.grid())).min(tiles);
            self.outcome.mass += snowpack.mass_of(self.tallied..end);
            let count = u64::from(end - std::mem::replace(&mut self.tallied, end));
            return Some(count * cells_of(snowpack.grid()));
        }
        let gathered = self.outcome.gathered.len();
        if gathered < self.work.gather.len() {
            let most = cells_fit(most, snowpack.grid()) as usize;
            let part = self.work.gather[gathered..].iter().take(most);
            let cells = part.map(|&tile| tile_cells(snowpack, tile));
            self.outcome.gathered.extend(cells);
            let count = (self.outcome.gathered.len() - gathered) as u64;
            return Some(count * cells_of(snowpack.grid()));
        }
        let read = self.work.columns.get(self.outcome.columns.len())?;
        self.outcome.columns.push(topmost(snowpack, read));
        Some(read.cells())
    }

    /// Begins the cycles, or what is evaluated where there are none.
    fn begin_run(&mut self, snowpack: &mut Snowpack) {
        // What is restored is left as it was saved.
        let edited = self.edits.last().is_some_and(|edit| !matches!(edit, Edit::Restore(_)));
        if self.work.wake {
            snowpack.wake();
        }
        let run = self.work.run;
        if run.cycles > 0 {
            snowpack.set_pressing(self.work.pressing);
        }
        if !self.work.moves.is_empty() {
            self.begin_moves(snowpack, 0);
        } else if run.cycles > 0 {
            self.progress = Some(snowpack.begin_run(run.cycles, run.dt));
        } else if edited {
            self.progress = Some(snowpack.begin_evaluation());
        }
    }

    /// Begins a cycle in which objects move, or what follows the last one.
    fn begin_moves(&mut self, snowpack: &mut Snowpack, cycle: usize) {
        let Some(moves) = self.work.moves.get_mut(cycle) else {
            self.moving = None;
            return;
        };
        if moves.move_something() {
            self.outcome.last_change = cycle as u32 + 1;
        }
        let grid = *snowpack.grid();
        snowpack.begin_moves(moves.tiles(&grid));
        self.moving = Some(Moving { cycle, step: 0, begun: false });
        self.take_edits_of_step(0, cycle);
    }

    /// Has the edits of a step carried out next.
    fn take_edits_of_step(&mut self, step: u32, cycle: usize) {
        let steps = self.work.moves.get_mut(cycle).map(|moves| &mut moves.steps);
        let edits = steps.and_then(|steps| steps.get_mut(step as usize));
        self.edits = edits.map(std::mem::take).unwrap_or_default();
        (self.edit, self.next) = (0, 0);
    }

    /// Goes on with the moves: begins the step whose edits have been carried out, or ends it.
    fn go_on_moving(&mut self, snowpack: &mut Snowpack) {
        let Some(Moving { cycle, step, begun }) = self.moving else { return };
        let steps = self.work.moves[cycle].count();
        if !begun {
            self.put = false;
            self.progress = Some(snowpack.begin_step(self.work.run.dt, steps, step == 0));
            self.moving = Some(Moving { cycle, step, begun: true });
        } else if step + 1 < steps {
            self.moving = Some(Moving { cycle, step: step + 1, begun: false });
            self.take_edits_of_step(step + 1, cycle);
        } else {
            snowpack.end_moves();
            self.begin_moves(snowpack, cycle + 1);
        }
    }

    /// Goes on with the edit that is under way: a row of tiles of what falls or is cleared, a tile of what
    /// is restored or gets other ground, all of any other.
    fn go_on_editing(&mut self, snowpack: &mut Snowpack, most: u64) -> u64 {
        let edit = &self.edits[self.edit];
        // The depth an object sinks counts from where it was put, not from later snow.
        if self.put && edit.columns().is_some() {
            self.put = false;
            self.progress = Some(snowpack.begin_evaluation());
            return 1;
        }
        if let Some(units) = self.stamp_many(snowpack, most) {
            return units;
        }
        let edit = &self.edits[self.edit];
        self.put |= matches!(edit, Edit::PutCollider { .. });
        if self.next == 0 {
            self.outcome.edits.push(0);
        }
        let (Done { result, units, end, exchanged }, joining) =
            (carry_out(edit, self.next, snowpack), edit.joining());
        self.outcome.exchanged.add(exchanged);
        if let Some(all) = self.outcome.edits.last_mut() {
            *all = joining(*all, result);
        }
        self.next += 1;
        if self.next >= end {
            (self.edit, self.next) = (self.edit + 1, 0);
        }
        units
    }

    /// Carries out the stamps that follow each other, as many as fit, all at once. Returns their units; nothing where
    /// there are not several.
    fn stamp_many(&mut self, snowpack: &mut Snowpack, most: u64) -> Option<u64> {
        let height = snowpack.grid().height;
        let (mut units, mut stamps) = (0, Vec::new());
        for edit in &self.edits[self.edit..] {
            let Edit::Stamp(stamp) = edit else { break };
            let own = stamp.units(height);
            if units + own > most {
                break;
            }
            units += own;
            stamps.push((&stamp.coverage, stamp.load));
        }
        if self.next > 0 || stamps.len() < 2 {
            return None;
        }
        let all = snowpack.grid().all();
        let dents = snowpack.stamp(all, &stamps);
        self.edit += dents.len();
        self.outcome.edits.extend(dents.into_iter().map(u64::from));
        Some(units)
    }

    /// What came of all of it, and the heights of the tiles that changed where it publishes.
    pub fn report(self, snowpack: &mut Snowpack) -> (WorkOutcome, Vec<(u32, TileColumns)>) {
        let Job { work, mut outcome, .. } = self;
        let mut changed = Vec::new();
        if work.publish {
            outcome.active_tiles = snowpack.active_tiles();
            outcome.contacts = snowpack.contacts().map(|(id, c)| (id.clone(), *c)).collect();
            changed = snowpack.take_dirty().collect();
        }
        let sample = work.samples.iter();
        let sample =
            sample.map(|s| snowpack.sample(s.columns, s.floor, s.y0..s.y0 + s.height, s.dt));
        outcome.samples = sample.collect();
        let totals = work.totals.iter().map(|&columns| snowpack.column_totals(columns));
        outcome.totals = totals.collect();
        (outcome, changed)
    }

    /// What is known of it before all of it is done.
    pub fn so_far(&self) -> WorkOutcome {
        let WorkOutcome { slot, units, .. } = self.outcome;
        WorkOutcome { slot, units, unfinished: true, ..WorkOutcome::default() }
    }
}

/// Tiles whose cells are about so many, at least one.
fn cells_fit(units: u64, grid: &Grid) -> u32 {
    u32::try_from(units / cells_of(grid)).unwrap_or(u32::MAX).max(1)
}

/// The topmost cells of some columns.
fn topmost(snowpack: &Snowpack, read: &ColumnRead) -> Vec<Column> {
    let column = |&index: &u32| {
        let tile = snowpack.tile(index / TILE_COLUMNS).unwrap_or_default();
        let cells = tile.get((index % TILE_COLUMNS) as usize).map_or(&[][..], |c| &c.cells);
        Column { cells: cells[cells.len().saturating_sub(read.cells as usize)..].to_vec() }
    };
    read.columns.iter().map(column).collect()
}

/// A tile's cells, slot by slot; without columns, all of them empty.
fn tile_cells(snowpack: &Snowpack, tile: u32) -> TileCells {
    let mut cells = TileCells::empty(snowpack.grid().height);
    cells.surfaces = snowpack.surfaces(tile).to_vec();
    for (index, column) in snowpack.tile(tile).unwrap_or_default().iter().enumerate() {
        for (slot, cell) in column.cells.iter().enumerate() {
            let at = slot * TILE_COLUMNS as usize + index;
            cells.mass[at] = cell.mass;
            cells.thickness[at] = cell.thickness;
            cells.temperature[at] = cell.temperature;
            cells.stress[at] = cell.stress;
        }
    }
    cells
}
