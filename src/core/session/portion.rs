//! How much a frame does of a session, and work that takes several frames.
//!
//! What a frame does is counted in units: cells that are looked at once. A session has as many of them in a
//! frame as take a few milliseconds, so that nobody else waits long: other snowpacks have their frames in
//! between, also in the middle of a cycle. The snowpack itself is between two ticks only when all of it is
//! done; until then its orders wait, and nothing of it is published.

use std::time::Duration;

use firn_engine::frame::{ColumnRead, Edit, SampleBox, Slot, Weathering, Work, WorkOutcome};
use firn_snow::{Grid, TILE_COLUMNS};

use crate::core::session::{MOST_SAMPLES, Reach};

/// Shortest and longest time that one session's part of a frame should take: others wait no longer than
/// two.
const FRAME_TIME: (Duration, Duration) = (Duration::from_millis(5), Duration::from_millis(11));

/// The same where sessions are brought back: nobody waits for the frame's answer, but a device may
/// take one that is much too long for a failure.
const REPLAY_TIME: (Duration, Duration) = (Duration::from_millis(50), Duration::from_millis(200));

/// Units of a session's first frame.
const FIRST: u64 = 1 << 20;

/// The same where it is brought back.
const FIRST_OF_REPLAY: u64 = 1 << 23;

/// Fewest units of a frame: two processors without a GPU take 8 ms for them. Where others are in the way they
/// take longer, and smaller parts would only be more frames that wait for them.
const LEAST: u64 = 1 << 19;

/// Units of a column on which snow falls or is cleared.
const FALL: u64 = 4;

/// Units of other ground under a column.
const GROUND: u64 = 4;

/// How much a frame does of a session, and the work that is under way.
#[derive(Debug)]
pub(crate) struct Portions {
    /// Units that a frame should have at the most.
    size: u64,
    /// Shortest and longest time that they should take.
    time: (Duration, Duration),
    /// Tiles that may be awake.
    awake: u64,
    /// Units of the work in the frame in flight, if all of it is done there.
    expected: u64,
    /// Units that the next work costs beside what it says.
    beside: u64,
    /// It may do no more than `size` of them.
    limited: bool,
    /// Where work is of which some frames are done.
    under_way: Option<Slot>,
}

impl Default for Portions {
    fn default() -> Self {
        Portions {
            size: FIRST,
            time: FRAME_TIME,
            awake: 0,
            expected: 0,
            beside: 0,
            limited: false,
            under_way: None,
        }
    }
}

impl Portions {
    /// For a session that is brought back while nobody waits for a frame.
    pub fn for_replay() -> Portions {
        Portions { size: FIRST_OF_REPLAY, time: REPLAY_TIME, ..Portions::default() }
    }

    /// Whether work has begun and not ended.
    pub fn are_under_way(&self) -> bool {
        self.under_way.is_some()
    }

    /// Whether that many units are more than a frame should have.
    pub fn part(&self, units: u64) -> bool {
        units > self.size
    }

    /// Units that a frame should have at the most.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Cycles that a frame should have, each of so many units: one at least.
    pub fn cycles(&self, units: u64) -> u32 {
        u32::try_from(self.size / units.max(1)).unwrap_or(u32::MAX).max(1)
    }

    /// Notes that the first work costs so many units beside what it says.
    pub fn furnish(&mut self, units: u64) {
        self.beside = units;
    }

    /// Notes that so many tiles may be awake now that were not.
    pub fn disturb(&mut self, tiles: u64) {
        self.awake = self.awake.saturating_add(tiles);
    }

    /// Notes how many tiles are awake.
    pub fn awake(&mut self, tiles: u32) {
        self.awake = tiles.into();
    }

    /// Units of a cycle, with some objects on the snow, under which it is taken in so many steps.
    pub fn cycle<'a>(
        &self,
        grid: &Grid,
        objects: impl Iterator<Item = &'a Reach>,
        steps: u32,
    ) -> u64 {
        let snow = self.awake.min(grid.tiles().into()) * cells_of_tile(grid);
        let units = |object: &Reach| object.units(grid).saturating_mul(steps.into());
        objects.fold(snow, |sum, object| sum.saturating_add(units(object)))
    }

    /// Has what fits a frame go as it is, and the rest in parts. `cycle` is what a cycle costs.
    pub fn begin(&mut self, work: Work, cycle: u64, grid: &Grid) -> Work {
        let read = work.gather.len() + if work.tally { grid.tiles() as usize } else { 0 };
        let samples = work.samples.iter().map(SampleBox::cells).sum::<u64>();
        let columns = work.columns.iter().map(ColumnRead::cells).sum::<u64>();
        self.expected = (work.edits.iter().map(|edit| units_of(edit, grid)))
            .chain([cycle.saturating_mul(work.run.cycles.into()), samples, columns])
            .chain([std::mem::take(&mut self.beside)])
            .fold(read as u64 * cells_of_tile(grid), u64::saturating_add);
        self.limited = self.part(self.expected) || columns > MOST_SAMPLES;
        if !self.limited {
            return work;
        }
        self.under_way = Some(work.slot);
        Work { limit: Some(self.size), ..work }
    }

    /// Goes on with the work that is under way, of which the end is published or not.
    pub fn go_on(&mut self, publish: bool) -> Option<Work> {
        let slot = self.under_way?;
        Some(Work::resume(slot, publish, Some(self.size)))
    }

    /// Units that an outcome stands for: those that were counted, or that were expected.
    pub fn units(&self, outcome: &WorkOutcome) -> u64 {
        if outcome.units > 0 { outcome.units } else { self.expected }
    }

    /// Takes in the outcome of a frame. Returns it where that is the end of the work.
    pub fn take_in(&mut self, outcome: WorkOutcome) -> Option<WorkOutcome> {
        if outcome.unfinished {
            return None;
        }
        self.under_way = None;
        Some(outcome)
    }

    /// Fits the size to the time that so many units took.
    pub fn fit(&mut self, units: u64, took: Duration) {
        let (shortest, longest) = self.time;
        if took > longest {
            // Half as much at the least, less where it was much too long.
            let wanted = (units as f64 * shortest.div_duration_f64(took)) as u64;
            self.size = self.size.min(wanted.max(units / 8)).max(LEAST);
        } else if self.limited && took < shortest {
            self.size = self.size.saturating_mul(2);
        }
    }

    /// Forgets what was right where nobody waited.
    pub fn begin_anew(&mut self) {
        self.size = self.size.min(FIRST);
        self.time = FRAME_TIME;
    }
}

fn cells_of_tile(grid: &Grid) -> u64 {
    u64::from(TILE_COLUMNS) * u64::from(grid.height)
}

/// Units of a step of weather.
pub(crate) fn weather_units(grid: &Grid) -> u64 {
    Weathering::UNITS * u64::from(grid.tiles()) * cells_of_tile(grid)
}

/// Units of a change.
fn units_of(edit: &Edit, grid: &Grid) -> u64 {
    match edit {
        Edit::Deposit(fall) | Edit::Lay(fall) => FALL * fall.columns.columns(),
        Edit::Clear { columns, .. } | Edit::Strip { columns, .. } => FALL * columns.columns(),
        Edit::Stamp(stamp) => stamp.units(grid.height),
        Edit::PutCollider { collider, .. } => 1 + collider.columns(),
        Edit::RemoveCollider { .. } => 1,
        Edit::SetGround(_) => GROUND * grid.columns(),
        Edit::SetMaterial(_) => u64::from(grid.tiles()),
        Edit::Restore(_) => u64::from(grid.tiles()) * cells_of_tile(grid),
        Edit::Weather(weathering) => {
            weather_units(grid).saturating_mul(weathering.steps.len() as u64)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use firn_engine::frame::{Run, contact_units};
    use firn_snow::{Body, Shape};

    const GRID: Grid = Grid { width: 64, depth: 64, height: 10, cell_size: 0.2 };
    const TILE: u64 = 640;

    fn work(cycles: u32) -> Work {
        let edits = vec![Edit::RemoveCollider { id: "a".into() }];
        let run = Run { cycles, dt: 0.25 };
        Work { slot: 7, edits, wake: true, run, publish: true, gather: vec![3], ..Work::default() }
    }

    #[test]
    fn what_is_short_goes_as_it_is() {
        let mut portions = Portions::default();
        let whole = portions.begin(work(5), 1000, &GRID);
        assert_eq!((whole.limit, whole.resume, whole.edits.len()), (None, false, 1));
        assert!(!portions.are_under_way());
        let outcome = WorkOutcome { last_change: 5, ..WorkOutcome::default() };
        assert_eq!(portions.units(&outcome), 5001 + TILE);
        assert_eq!(portions.take_in(outcome).unwrap().last_change, 5);
    }

    #[test]
    fn what_is_long_is_done_in_parts() {
        let mut portions = Portions::default();
        let first = portions.begin(work(1000), FIRST, &GRID);
        assert_eq!((first.limit, first.run.cycles, first.edits.len()), (Some(FIRST), 1000, 1));
        let part = || WorkOutcome { unfinished: true, units: FIRST, ..WorkOutcome::default() };
        for publish in [true, false] {
            assert!(portions.take_in(part()).is_none());
            assert!(portions.are_under_way());
            let next = portions.go_on(publish).unwrap();
            assert_eq!((next.slot, next.resume, next.publish), (7, true, publish));
            assert_eq!((next.limit, next.edits.len(), next.run.cycles), (Some(FIRST), 0, 0));
        }
        assert!(portions.take_in(WorkOutcome::default()).is_some());
        assert!(!portions.are_under_way());
        assert!(portions.go_on(true).is_none());
    }

    #[test]
    fn only_what_is_awake_costs_and_what_stands_on_it() {
        let mut portions = Portions::default();
        let shape = Some(Shape::Box { width: 0.6, depth: 0.6 });
        let object = Body { shape, ..Body::default() };
        let reach = Reach::new(&object, &GRID);
        let object = contact_units(16) + 4 * TILE;
        portions.disturb(3);
        assert_eq!(portions.cycle(&GRID, [].into_iter(), 1), 3 * TILE);
        assert_eq!(portions.cycle(&GRID, [&reach, &reach].into_iter(), 1), 3 * TILE + 2 * object);
        assert_eq!(portions.cycle(&GRID, [&reach].into_iter(), 5), 3 * TILE + 5 * object);
        portions.disturb(100);
        assert_eq!(portions.cycle(&GRID, [].into_iter(), 1), 64 * TILE, "no more than there are");
        portions.awake(1);
        assert_eq!(portions.cycle(&GRID, [].into_iter(), 1), TILE);
        assert_eq!(portions.cycles(FIRST / 5), 5);
        assert_eq!(portions.cycles(10 * FIRST), 1);
    }

    #[test]
    fn slow_frames_make_small_parts_and_only_full_ones_make_them_larger() {
        let mut portions = Portions { size: FIRST, ..Portions::default() };
        let mut fitted = |units: u64, limited: bool, milliseconds: u64| {
            portions.limited = limited;
            portions.fit(units, Duration::from_millis(milliseconds));
            portions.size
        };
        assert_eq!(fitted(FIRST, true, 8), FIRST);
        assert_eq!(fitted(FIRST, false, 1), FIRST, "it had no more to do");
        assert_eq!(fitted(FIRST, true, 4), 2 * FIRST);
        assert_eq!(fitted(2 * FIRST, true, 20), FIRST / 2);
        assert_eq!(fitted(FIRST / 2, true, 5000), LEAST);
        assert_eq!(fitted(100 * FIRST, false, 20), LEAST, "others were in the way");
        assert_eq!(fitted(LEAST, true, 4), 2 * LEAST, "and are not any more");
    }
}
