//! How many cycles a frame takes on, and runs of more, which are carried out in portions.
//!
//! A step takes as many ticks at a time as a frame should have cycles. But a single tick may have
//! thousands of cycles. Nobody else waits for all of them: other snowpacks have their frames in between.
//! The snowpack itself is between two ticks only when the last portion is done; until then its orders
//! wait, and nothing of it is published.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::engine::frame::{Run, SampleBox, Work, WorkOutcome};

/// Shortest and longest time that a frame should take: others wait no longer than two.
pub(super) const FRAME_TIME: (Duration, Duration) =
    (Duration::from_millis(5), Duration::from_millis(11));

/// The same where sessions are brought back: nobody waits for the frame's answer, but a device may
/// take one that is much too long for a failure.
pub(super) const REPLAY_TIME: (Duration, Duration) =
    (Duration::from_millis(50), Duration::from_millis(200));

/// Cycles of a snowpack's first frame.
const FIRST: u32 = 8;

/// The same where a session is brought back.
const FIRST_OF_REPLAY: u32 = 64;

/// Cycles that are never parted: many snowpacks that tick in one frame may make it a long one, and
/// would only make more of them.
const LEAST: u32 = 8;

/// How a snowpack's runs are parted, and the one that is under way.
#[derive(Debug)]
pub(super) struct Portions {
    /// Cycles that a frame should have.
    size: u32,
    /// Cycles in the newest frame.
    cycles: u32,
    under_way: Option<UnderWay>,
}

/// A run of which some frames are done.
#[derive(Debug)]
struct UnderWay {
    /// What is still to be done, and what is wanted at the end.
    rest: Work,
    /// Cycles before those of the frame in flight.
    done: u32,
    /// 1 + index of the last of these in which a cell changed; 0 for none.
    last_change: u32,
    /// What the edits before the first cycle did.
    edits: Vec<u64>,
}

impl Default for Portions {
    fn default() -> Self {
        Portions { size: FIRST, cycles: 0, under_way: None }
    }
}

impl Portions {
    /// Whether a run has begun and not ended.
    pub fn are_under_way(&self) -> bool {
        self.under_way.is_some()
    }

    /// Cycles that a frame should have at the most.
    pub fn size(&self) -> u32 {
        self.size
    }

    /// The same for ticks that are due, of which a frame has at least a few.
    pub fn least(&self) -> u32 {
        self.size.max(LEAST)
    }

    /// Forgets how many cycles were right: there is more to do in each of them now.
    pub fn begin_anew(&mut self) {
        self.size = self.size.min(FIRST);
    }

    /// For a session that is brought back: nobody waits for its first frames.
    pub fn for_replay() -> Portions {
        Portions { size: FIRST_OF_REPLAY, ..Portions::default() }
    }

    /// Begins with some work. Returns the part of it that goes into the coming frame.
    pub fn begin(&mut self, mut work: Work) -> Work {
        self.cycles = work.run.cycles.min(self.least());
        if work.run.cycles <= self.least() {
            return work;
        }
        let edits = std::mem::take(&mut work.edits);
        let wake = std::mem::take(&mut work.wake);
        let first = Work { edits, wake, ..self.part_of(&mut work) };
        let rest = UnderWay { rest: work, done: 0, last_change: 0, edits: Vec::new() };
        self.under_way = Some(rest);
        first
    }

    /// Goes on with the run that is under way, of which the end is published or not. Returns what
    /// goes into the coming frame: nothing where `room` is too small for the cells of the fixed grid
    /// that are wanted at the end.
    pub fn go_on(&mut self, publish: bool, room: &AtomicU64) -> Option<Work> {
        let mut under_way = self.under_way.take()?;
        let rest = &mut under_way.rest;
        rest.publish = publish;
        let work = if rest.run.cycles > self.least() {
            Some(self.part_of(rest))
        } else {
            let wanted = rest.samples.iter().map(SampleBox::cells).sum();
            let left = |room: u64| room.checked_sub(wanted);
            let fits = room.try_update(Ordering::Relaxed, Ordering::Relaxed, left).is_ok();
            fits.then(|| std::mem::take(rest))
        };
        self.cycles = work.as_ref().map_or(0, |work| work.run.cycles);
        self.under_way = Some(under_way);
        work
    }

    /// Takes the next portion off a run.
    fn part_of(&self, work: &mut Work) -> Work {
        work.run.cycles -= self.least();
        let run = Run { cycles: self.least(), dt: work.run.dt };
        Work { slot: work.slot, run, ..Work::default() }
    }

    /// Takes in the outcome of a frame. Returns that of the whole, where this was the end of it.
    pub fn take_in(&mut self, outcome: WorkOutcome) -> Option<WorkOutcome> {
        let Some(mut under_way) = self.under_way.take() else { return Some(outcome) };
        if outcome.last_change > 0 {
            under_way.last_change = under_way.done + outcome.last_change;
        }
        under_way.done += self.cycles;
        under_way.edits.extend(&outcome.edits);
        if under_way.rest.run.cycles > 0 {
            self.under_way = Some(under_way);
            return None;
        }
        let UnderWay { last_change, edits, .. } = under_way;
        Some(WorkOutcome { last_change, edits, ..outcome })
    }

    /// Fits the size to the time that the newest frame took, and the shortest and longest that it
    /// should take.
    pub fn fit(&mut self, frame: Duration, (shortest, longest): (Duration, Duration)) {
        if self.cycles == 0 {
            return;
        }
        if frame > longest {
            self.size = self.size.min((self.cycles / 2).max(1));
        } else if frame < shortest {
            self.size = self.size.max(self.cycles.saturating_mul(2));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::frame::Edit;

    const ROOM: u64 = 1000;

    fn work(cycles: u32) -> Work {
        let edits = vec![Edit::RemoveCollider { id: "a".into() }];
        Work {
            slot: 7,
            edits,
            wake: true,
            run: Run { cycles, dt: 0.25 },
            publish: true,
            gather: vec![3],
            ..Work::default()
        }
    }

    #[test]
    fn what_is_short_goes_as_it_is() {
        let mut portions = Portions::default();
        let whole = portions.begin(work(FIRST));
        assert_eq!((whole.run.cycles, whole.edits.len(), whole.publish), (FIRST, 1, true));
        assert!(!portions.are_under_way());
        let outcome = WorkOutcome { last_change: 5, edits: vec![9], ..WorkOutcome::default() };
        let outcome = portions.take_in(outcome).unwrap();
        assert_eq!((outcome.last_change, outcome.edits), (5, vec![9]));
    }

    #[test]
    fn portions_are_one_run() {
        let (mut portions, room) = (Portions::default(), AtomicU64::new(ROOM));
        let mut next = Some(portions.begin(work(1000)));
        let (mut cycles, mut frames) = (0, 0);
        let outcome = loop {
            let part = next.take().expect("there is room");
            let last = cycles + part.run.cycles == 1000;
            assert_eq!((part.slot, part.run.dt), (7, 0.25));
            assert_eq!((part.edits.len(), part.wake), (usize::from(frames == 0), frames == 0));
            assert_eq!((part.publish, part.gather.len()), (last, usize::from(last)));
            // A cell changes in cycle 700 and in none after.
            let last_change = if cycles < 700 { part.run.cycles.min(700 - cycles) } else { 0 };
            let edits = if frames == 0 { vec![4] } else { Vec::new() };
            cycles += part.run.cycles;
            frames += 1;
            let outcome = WorkOutcome { last_change, edits, ..WorkOutcome::default() };
            if let Some(whole) = portions.take_in(outcome) {
                break whole;
            }
            assert!(portions.are_under_way());
            portions.fit(Duration::from_millis(if frames < 6 { 1 } else { 7 }), FRAME_TIME);
            next = portions.go_on(true, &room);
        };
        assert_eq!((cycles, frames), (1000, 8), "8, 16, 32, 64, 128, 256, 256 and what is left");
        assert_eq!((outcome.last_change, outcome.edits), (700, vec![4]));
        assert!(!portions.are_under_way());
    }

    /// The size after a run of so many cycles, in a frame of so many milliseconds.
    fn fitted(portions: &mut Portions, cycles: u32, frame: u64) -> u32 {
        portions.begin(work(cycles));
        portions.under_way = None;
        portions.fit(Duration::from_millis(frame), FRAME_TIME);
        portions.size
    }

    #[test]
    fn slow_frames_make_small_portions_but_ticks_are_not_cut_too_small() {
        let mut portions = Portions { size: 64, ..Portions::default() };
        for (frame, size) in [(50, 32), (12, 16), (90, 8), (90, 4), (90, 4), (6, 4)] {
            assert_eq!(fitted(&mut portions, 5000, frame), size);
        }
        assert_eq!(portions.least(), LEAST);
        for (cycles, size) in [(4, 2), (2, 1), (1, 1)] {
            assert_eq!(fitted(&mut portions, cycles, 90), size, "steps take as few as it takes");
        }
    }

    #[test]
    fn only_a_frame_that_was_full_makes_larger_ones() {
        let mut portions = Portions { size: 64, ..Portions::default() };
        for (cycles, size) in [(1, 64), (32, 64), (33, 66), (66, 132), (5, 132)] {
            assert_eq!(fitted(&mut portions, cycles, 1), size);
        }
        portions.begin_anew();
        assert_eq!(portions.size, FIRST);
        portions.begin(Work { run: Run::default(), ..work(1) });
        portions.fit(Duration::from_millis(90), FRAME_TIME);
        assert_eq!(portions.size, FIRST, "a frame without cycles says nothing");
    }

    #[test]
    fn the_end_waits_for_room() {
        let mut portions = Portions::default();
        let columns = crate::snow::ColumnRect { x0: 0, z0: 0, x1: 10, z1: 10 };
        let wanted = SampleBox { columns, y0: 0, height: 10, dt: 0.1 };
        portions.begin(Work { samples: vec![wanted], ..work(16) });
        assert!(portions.take_in(WorkOutcome::default()).is_none());
        assert!(portions.go_on(true, &AtomicU64::new(ROOM - 1)).is_none());
        assert!(portions.are_under_way());
        let room = AtomicU64::new(ROOM);
        assert_eq!(portions.go_on(true, &room).unwrap().run.cycles, 8);
        assert_eq!(room.into_inner(), 0);
        assert!(portions.take_in(WorkOutcome::default()).is_some());
    }
}
