//! The steps of a job, stage by stage.

use std::collections::BTreeSet;
use std::ops::Range;

use firn_snow::TILE_COLUMNS;

use crate::frame::{Edit, Moves, Run, contact_units};
use crate::gpu::resident::Resident;

use super::part::{Part, Step, When};
use super::{Job, Stage};

/// Units of a tile on which snow falls, for each of its cells.
pub(super) const EDIT: u64 = 2;

/// Units of writing the ground of a tile.
const GROUND: u64 = 4 * TILE_COLUMNS as u64;

/// Cells of columns that a part reads, about: they come back in one piece.
const COLUMN_CELLS_AT_ONCE: u64 = 1 << 20;

impl Job {
    /// Adds the next step to a part. Returns whether the part ends with it.
    pub(super) fn step(&mut self, resident: &Resident, most: u64, part: &mut Part) -> bool {
        match self.stage {
            Stage::Write | Stage::Snow | Stage::Weather | Stage::Objects => {
                self.edit(resident, most, part)
            }
            Stage::TouchAfterEdits | Stage::PressAfterEdits => {
                self.evaluate_edits(resident, most, part)
            }
            Stage::Weigh => self.weigh(resident, most, part),
            Stage::Touch | Stage::Press => {
                self.evaluate_cycle(resident, most, part);
                false
            }
            Stage::Free | Stage::Loaded => self.compact(resident, most, part),
            Stage::Move => {
                self.move_objects(resident, most, part);
                true
            }
            Stage::Gather => {
                self.gather(resident, most, part);
                true
            }
            Stage::Columns => {
                self.read_columns(most, part);
                true
            }
            Stage::Over => true,
        }
    }

    /// Goes on with a round of edits.
    fn edit(&mut self, resident: &Resident, most: u64, part: &mut Part) -> bool {
        let cells = cells_of(resident);
        match self.stage {
            Stage::Write => {
                let tiles = tiles_of(resident);
                let units = match self.round().first() {
                    Some((_, Edit::SetGround(_))) => GROUND,
                    _ => cells,
                };
                let range = self.take(most, units, tiles);
                part.add(units * range.len() as u64, Step::Write(range));
                if self.next == tiles {
                    self.enter(Stage::Snow);
                }
                // The host writes ahead of the frame in which it says so.
                true
            }
            Stage::Snow => {
                let Some(tiles) = self.snowed() else {
                    self.enter(Stage::Objects);
                    return false;
                };
                self.next = self.next.max(tiles.z0);
                let (range, units) = self.take_rows(resident, most, tiles);
                part.add(units, Step::Snow(range));
                if self.next == tiles.z1 {
                    self.enter(Stage::Objects);
                }
                false
            }
            Stage::Weather => {
                self.take_weather(resident, most, part);
                false
            }
            _ => {
                part.add(1, Step::Objects);
                let evaluates = self.round().iter().any(|(_, e)| !matches!(e, Edit::Restore(_)));
                self.enter(match evaluates {
                    true => Stage::TouchAfterEdits,
                    false if self.rounds.len() > 1 => Stage::PressAfterEdits,
                    false => Stage::Weigh,
                });
                // Which objects there are then is only known when this has been done.
                true
            }
        }
    }

    /// Goes on with contacts and stresses after a round of edits.
    fn evaluate_edits(&mut self, resident: &Resident, most: u64, part: &mut Part) -> bool {
        let when = When { after_edits: true, runs: self.runs_next(), cycle: 0 };
        if self.stage == Stage::TouchAfterEdits {
            self.touch(resident, most, when, Stage::PressAfterEdits, part);
            return false;
        }
        let list = std::mem::take(&mut self.pressed);
        let ended = self.press(resident, &list, most, when, part);
        self.pressed = list;
        if ended {
            self.evaluated = self.runs_next();
            self.begin_round();
        }
        // What the next round says to the device would be ahead of this one.
        ended && !self.rounds.is_empty()
    }

    /// Goes on with the stresses of tiles without objects on which snow fell, where something needs them.
    fn weigh(&mut self, resident: &Resident, most: u64, part: &mut Part) -> bool {
        if !self.runs {
            self.runs = true;
            part.work.wake = self.work.wake;
        }
        let creeps = !resident.is_alpine();
        let needed = creeps && self.work.run.cycles > 0 || self.work.reads_cells();
        let left = resident.unweighed.len() as u32;
        if needed && left > 0 {
            let cells = cells_of(resident);
            let count = self.take(most, cells, left).len() as u32;
            part.add(cells * u64::from(count), Step::Weigh(count));
            // They are taken out of the list when this is planned.
            self.next = 0;
            if count < left {
                return true;
            }
        }
        self.begin_cycles(resident);
        false
    }

    /// Goes on with contacts and stresses before a cycle.
    fn evaluate_cycle(&mut self, resident: &Resident, most: u64, part: &mut Part) {
        let when = When { after_edits: false, runs: true, cycle: self.cycle };
        if self.stage == Stage::Touch {
            self.touch(resident, most, when, Stage::Press, part);
        } else if self.press(resident, &loaded(resident), most, when, part) {
            self.enter(if self.cycle == 0 { Stage::Free } else { Stage::Loaded });
        }
    }

    /// Goes on with compaction.
    fn compact(&mut self, resident: &Resident, most: u64, part: &mut Part) -> bool {
        self.tell_cycles(part);
        let cells = cells_of(resident);
        if self.stage == Stage::Free {
            let list: Vec<u32> = resident.free().collect();
            let units = cells * u64::from(self.at_once);
            let range = self.take(most, units, list.len() as u32);
            let tiles = list[range.start as usize..range.end as usize].to_vec();
            part.add(units * tiles.len() as u64, Step::Free(tiles));
            if self.next as usize == list.len() {
                self.enter(Stage::Loaded);
            }
            return false;
        }
        let list = loaded(resident);
        let range = self.take(most, cells, list.len() as u32);
        if !range.is_empty() {
            let tiles = list[range.start as usize..range.end as usize].to_vec();
            part.add(cells * tiles.len() as u64, Step::Loaded(tiles, self.cycle));
        }
        self.next == list.len() as u32 && self.end_cycle(resident, list.is_empty())
    }

    /// Goes on with reading cells.
    fn gather(&mut self, resident: &Resident, most: u64, part: &mut Part) {
        let (cells, count) = (cells_of(resident), self.work.gather.len() as u32);
        let range = self.take(most, cells, count);
        part.units += cells * range.len() as u64;
        let tiles = &self.work.gather[range.start as usize..range.end as usize];
        part.work.gather = tiles.to_vec();
        if self.next == count {
            let reads = !self.work.columns.is_empty();
            self.enter(if reads { Stage::Columns } else { Stage::Over });
        }
    }

    /// Goes on with reading columns.
    fn read_columns(&mut self, most: u64, part: &mut Part) {
        let first = self.next as usize;
        let mut cells = 0;
        for read in &self.work.columns[first..] {
            if cells >= most.min(COLUMN_CELLS_AT_ONCE) {
                break;
            }
            cells += read.cells();
            self.next += 1;
        }
        part.units += cells;
        part.work.columns = self.work.columns[first..self.next as usize].to_vec();
        if self.next as usize == self.work.columns.len() {
            self.enter(Stage::Over);
        }
    }

    /// Says which cycles the steps of a part are of.
    fn tell_cycles(&self, part: &mut Part) {
        part.run = Run { cycles: self.at_once, dt: self.work.run.dt };
        part.done = self.done;
    }

    /// Whether the cycles follow what is evaluated now.
    fn runs_next(&self) -> bool {
        self.rounds.is_empty() && self.work.run.cycles > 0
    }

    /// The next objects or tiles of so many, about as many as fit, at least one where there is one.
    fn take(&mut self, most: u64, units: u64, end: u32) -> Range<u32> {
        let count = u32::try_from(most / units.max(1)).unwrap_or(u32::MAX).max(1);
        let first = self.next;
        self.next = first.saturating_add(count).min(end);
        first..self.next
    }

    fn touch(&mut self, resident: &Resident, most: u64, when: When, then: Stage, part: &mut Part) {
        self.tell_cycles(part);
        let (first, mut units, mut row) = (self.next, 0, 0);
        for body in resident.bodies.values() {
            row += body.rows();
            if units < most && row > self.next {
                units += contact_units(body.placement.columns());
                self.next = row;
            }
        }
        if self.next > first {
            part.add(units, Step::Touch(first..self.next, when));
        }
        if self.next == row {
            self.enter(then);
        }
    }

    /// Has stresses of some of the listed tiles evaluated. Returns whether that were all.
    fn press(
        &mut self,
        resident: &Resident,
        list: &[u32],
        most: u64,
        when: When,
        part: &mut Part,
    ) -> bool {
        self.tell_cycles(part);
        let (first, mut units) = (self.next, 0);
        for tile in &list[first as usize..] {
            if units >= most {
                break;
            }
            let loads = resident.loads.get(tile).map_or(0, Vec::len) as u64;
            units += cells_of(resident) * (1 + loads);
            self.next += 1;
        }
        if self.next > first {
            let tiles = list[first as usize..self.next as usize].to_vec();
            part.add(units, Step::Press(tiles, when));
        }
        self.next as usize == list.len()
    }

    /// Begins as many cycles as fit, or what follows them where there are no more.
    fn begin_cycles(&mut self, resident: &Resident) {
        let most = self.work.limit.unwrap_or(u64::MAX);
        let left = self.work.run.cycles - self.done;
        if self.steps > 0 {
            self.enter(Stage::Move);
            return;
        }
        if left == 0 {
            self.enter(match &self.work {
                work if !work.gather.is_empty() => Stage::Gather,
                work if !work.columns.is_empty() => Stage::Columns,
                _ => Stage::Over,
            });
            return;
        }
        let units = cells_of(resident) * (resident.most_free() + resident.loads.len()) as u64;
        let fitting = u32::try_from(most / units.max(1)).unwrap_or(u32::MAX).max(1);
        (self.at_once, self.cycle) = (fitting.min(left), 0);
        let evaluated = std::mem::take(&mut self.evaluated) || resident.bodies.is_empty();
        self.enter(if evaluated { Stage::Free } else { Stage::Touch });
    }

    /// Goes on with cycles in which objects move, step by step.
    fn move_objects(&mut self, resident: &Resident, most: u64, part: &mut Part) {
        if !self.moves.is_empty() && self.units_of_step == 0 {
            self.units_of_step = self.units_of_moves(resident) / u64::from(self.steps);
        }
        // Its cycles are numbered from the first on, whatever the parts.
        part.run = self.work.run;
        let fitting = most / self.units_of_step.max(1);
        part.moves = u32::try_from(fitting).unwrap_or(u32::MAX).clamp(1, self.steps);
        part.units += self.units_of_step * u64::from(part.moves);
        self.steps -= part.moves;
        if self.steps == 0 {
            self.done = self.work.run.cycles;
            self.begin_cycles(resident);
        }
    }

    /// Units of all cycles in which objects move.
    fn units_of_moves(&self, resident: &Resident) -> u64 {
        let (cells, grid) = (cells_of(resident), &resident.layout.grid);
        let bodies = resident.bodies.values().map(|body| contact_units(body.placement.columns()));
        let (bodies, loaded) = (bodies.sum::<u64>(), resident.loads.len());
        let cycle = |moves: &Moves| {
            let tiles = loaded + moves.tiles(grid).collect::<BTreeSet<u32>>().len();
            let step = bodies + cells * tiles as u64;
            step * u64::from(moves.count()) + cells * resident.most_free() as u64
        };
        self.moves.iter().map(cycle).sum()
    }

    /// Ends a cycle of the tiles under objects; where there are none, all that are taken at once. Returns
    /// whether a part ends with it: the sums of a frame are those of cycles that were taken at once.
    fn end_cycle(&mut self, resident: &Resident, unloaded: bool) -> bool {
        self.cycle += 1;
        if self.cycle < self.at_once && !unloaded {
            self.enter(Stage::Touch);
            return false;
        }
        self.done += self.at_once;
        self.begin_cycles(resident);
        self.done < self.work.run.cycles
    }
}

/// Cells of a tile.
pub(super) fn cells_of(resident: &Resident) -> u64 {
    u64::from(TILE_COLUMNS * resident.layout.grid.height)
}

/// Tiles of a snowpack.
fn tiles_of(resident: &Resident) -> u32 {
    resident.lot.places.len() as u32
}

/// Tiles under objects.
fn loaded(resident: &Resident) -> Vec<u32> {
    resident.loads.keys().copied().collect()
}
