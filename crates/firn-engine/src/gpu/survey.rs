//! A first look through a frame: what its work amounts to.

use std::collections::BTreeMap;
use std::ops::Range;

use firn_snow::ColumnRect;

use crate::frame::{ColumnRead, Edit, EngineError, Frame, Moves, Run, SampleBox, Work};
use crate::parallel;

use super::plan::{Moving, Round};
use super::resident::{self, LARGEST_ROUND, Resident, Residents};

/// What the work of a frame amounts to.
///
/// Each snowpack is looked at once: of thousands, none is in the processor's cache.
#[derive(Debug, Default)]
pub struct Survey {
    /// The edits, round by round, each with its number in the frame.
    pub rounds: Vec<Vec<Round>>,
    /// Rows that each of them takes, about.
    rows: Vec<u64>,
    /// Snowpacks in which objects move, by their places among the work: their runs, and how they move.
    pub moving: BTreeMap<usize, (Run, Moving)>,
    /// What each work is about.
    pub parts: Vec<Part>,
    /// How much there is in all.
    pub totals: Totals,
}

/// What one work is about.
#[derive(Clone, Debug)]
pub struct Part {
    /// Its edits, by their numbers in the frame.
    pub edits: Range<u32>,
    /// Tiles of its snowpack.
    pub tiles: Range<u32>,
    /// Whether there may be objects on the snowpack.
    pub may_be_loaded: bool,
    /// Whether stresses are needed that may not have been evaluated yet.
    pub weighs: bool,
}

/// How much the work of a frame is.
#[derive(Clone, Debug, Default)]
pub struct Totals {
    /// Snowpacks.
    pub work: u64,
    /// Edits.
    pub edits: u32,
    /// Whether a snowpack takes steps of weather.
    pub weathers: bool,
    /// Whether all tiles of a snowpack are to be woken.
    pub wakes: bool,
    /// Most cycles of a snowpack.
    pub cycles: u32,
    /// Tiles of the snowpacks that run.
    pub running: usize,
    /// Most tiles that can be published.
    pub tiles: u64,
    /// Groups of 64 tiles that they are among.
    pub groups: Range<u32>,
    /// Cells of columns that are read.
    pub column_cells: u64,
    /// Cells of the fixed grid.
    pub samples: u64,
    /// Columns that are summed up.
    pub columns: u64,
    /// Whether masses are to be summed.
    pub tally: bool,
    /// Whether objects may have to be reported.
    pub contacts: bool,
}

/// What is to be known of a snowpack.
struct Found {
    loaded: bool,
    unweighed: bool,
    creeps: bool,
}

impl Found {
    fn new(resident: &Resident) -> Found {
        Found {
            loaded: !resident.bodies.is_empty(),
            unweighed: !resident.unweighed.is_empty(),
            creeps: !resident.is_alpine(),
        }
    }
}

/// Whether cycles are run on snow that creeps under its stress, or cells are read with their stresses.
fn needs_stress(work: &Work, creeps: bool) -> bool {
    creeps && work.run.cycles > 0 || work.reads_cells()
}

/// Edits of some moves.
pub fn count_edits<'a>(moves: impl Iterator<Item = &'a Moves>) -> u32 {
    moves.flat_map(|moves| &moves.steps).map(|step| step.len() as u32).sum()
}

impl Survey {
    /// Looks through the work of a frame, and takes the edits out of it.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`] where there is work for a snowpack that is not there.
    pub fn new(frame: &mut Frame, residents: &Residents) -> Result<Survey, EngineError> {
        let look = |work: &Work| {
            let resident = residents.get(work.slot)?;
            Some((resident.lot.tiles.clone(), Found::new(resident)))
        };
        let found = parallel::each(frame.work.iter().collect(), look);
        let mut survey =
            Survey { parts: Vec::with_capacity(frame.work.len()), ..Survey::default() };
        for (work, found) in frame.work.iter_mut().zip(found) {
            let (tiles, found) = found.ok_or_else(|| {
                let what = format!("a frame has work for slot {}, which is empty", work.slot);
                EngineError::DeviceFailed(what)
            })?;
            survey.take(work, tiles, found);
        }
        Ok(survey)
    }

    fn take(&mut self, work: &mut Work, tiles: Range<u32>, found: Found) {
        let totals = &mut self.totals;
        let first = totals.edits;
        totals.edits += work.edits.len() as u32;
        totals.work += 1;
        totals.wakes |= work.wake;
        totals.tally |= work.tally;
        let edited = !work.edits.is_empty();
        totals.weathers |= work.edits.iter().any(|edit| matches!(edit, Edit::Weather(_)));
        let may_be_loaded = found.loaded || edited;
        let weighs = (found.unweighed || edited) && needs_stress(work, found.creeps);
        if work.publish {
            let own = tiles.start / 64..tiles.end.div_ceil(64);
            totals.groups = match &totals.groups {
                groups if groups.is_empty() => own,
                groups => groups.start.min(own.start)..groups.end.max(own.end),
            };
            totals.tiles += tiles.len() as u64;
            totals.contacts |= may_be_loaded;
        }
        totals.column_cells += work.columns.iter().map(ColumnRead::cells).sum::<u64>();
        totals.columns += work.totals.iter().map(ColumnRect::columns).sum::<u64>();
        totals.samples += work.samples.iter().map(SampleBox::cells).sum::<u64>();
        if !work.moves.is_empty() {
            let (run, moves) = (std::mem::take(&mut work.run), std::mem::take(&mut work.moves));
            let next = totals.edits;
            totals.edits += count_edits(moves.iter());
            let place = self.parts.len();
            let moving = Moving::new(place, work.slot, run.dt, work.pressing, moves, next);
            self.moving.insert(place, (run, moving));
        }
        if work.run.cycles > 0 {
            totals.cycles = totals.cycles.max(work.run.cycles);
            totals.running += tiles.len();
        }
        self.parts.push(Part { edits: first..totals.edits, tiles, may_be_loaded, weighs });
        if edited {
            self.take_edits(work, first);
        }
    }

    /// Takes the edits of one snowpack, the first of which has a number.
    fn take_edits(&mut self, work: &mut Work, number: u32) {
        let place = self.parts.len() as u32 - 1;
        let edits: Vec<(u32, Edit)> = (number..).zip(std::mem::take(&mut work.edits)).collect();
        let mut next = 0;
        let mut rounds = resident::rounds(edits).into_iter().peekable();
        while let Some((edits, rows)) = rounds.next() {
            while self.rows.get(next).is_some_and(|taken| taken + rows > LARGEST_ROUND) {
                next += 1;
            }
            if self.rounds.len() <= next {
                self.rounds.push(Vec::new());
                self.rows.push(0);
            }
            let runs = work.run.cycles > 0 && rounds.peek().is_none();
            self.rounds[next].push(Round { slot: work.slot, place, edits, runs });
            self.rows[next] += rows;
            next += 1;
        }
    }
}
