//! A frame from one session's point of view: the ticks it takes, the work it has, and what came of
//! them.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::engine::frame::{Run, Work};

use super::clock::Advance;
use super::orders::{Flight, Orders, Reply};
use super::simulation::Simulation;
use super::step::Goal;

/// A frame, as it is offered to every session.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn<'a> {
    /// Number of the beat.
    pub frame: u64,
    /// Whether publications are due that nobody asked for.
    pub publish: bool,
    /// Whether a snowpack at rest may be left alone.
    pub sleep: bool,
    /// Cells of the fixed grid that the frame still has room for; what finds none waits for the
    /// next.
    pub samples: &'a AtomicU64,
    /// Time by which ticks have slipped \[µs\].
    pub slipped_us: &'a AtomicU64,
}

impl Simulation {
    /// Lets the time up to a frame pass, where nothing happens in it: a pause has no ticks, and in
    /// the ticks of a session at rest nothing moves.
    pub(super) fn catch_up(&mut self, frame: u64) {
        if self.settings.paused || self.frozen {
            self.frame = frame;
        } else if self.passes() {
            self.clock.pass(self.clock.ticks_between(self.frame, frame));
            self.frame = frame;
        }
    }

    /// What this session does in a frame; `None` for nothing.
    pub(super) fn plan(&mut self, turn: Turn) -> Option<Work> {
        if self.portions.are_under_way() {
            self.slip(turn);
            self.flight.publish |= turn.publish && self.replay.is_none();
            return self.portions.go_on(self.flight.publish, turn.samples);
        }
        let clock_before = self.clock;
        let mut advance = self.take_ticks(turn.frame);
        if advance.run.cycles > 0 {
            if self.last_dt != Some(advance.run.dt) {
                self.wake();
                self.last_dt = Some(advance.run.dt);
            }
            if self.still && turn.sleep {
                advance.run = Run::default();
            }
        }
        let run = advance.run;
        self.unpublished |= advance.ticks > 0 || self.has_orders();
        let mut orders = std::mem::take(&mut self.next);
        self.next.samples = orders.hold_back_samples(turn.samples);
        let publish = match &self.replay {
            Some(replay) => replay.publishes(),
            None => orders.want_answers() || (turn.publish && self.unpublished),
        };
        if !publish && run.cycles == 0 && orders.edits.is_empty() {
            self.next.wake |= orders.wake;
            self.next.changed |= orders.changed;
            self.advance_goal(advance.ticks);
            self.deposit_falling();
            return None;
        }
        let work = Work {
            slot: self.slot,
            edits: std::mem::take(&mut orders.edits),
            wake: orders.wake,
            run,
            publish,
            tally: !orders.tallies.is_empty(),
            samples: orders.samples.iter().map(|(wanted, _)| *wanted).collect(),
            gather: self.gather(&orders),
        };
        self.flight = Flight { orders, advance, clock_before: Some(clock_before), publish };
        Some(self.portions.begin(work))
    }

    /// Lets the ticks slip that fall while a run is under way: they don't pile up.
    fn slip(&mut self, turn: Turn) {
        if self.step.is_none() && self.replay.is_none() && !self.settings.paused && !self.frozen {
            let ticks = self.clock.ticks_between(self.frame, turn.frame);
            let lag_us = ticks as f64 * 1e6 / self.clock.tick_rate();
            turn.slipped_us.fetch_add(lag_us as u64, Ordering::Relaxed);
        }
        self.frame = turn.frame;
    }

    /// Tiles that are wanted: those of each request, and all of them for snapshots.
    fn gather(&self, orders: &Orders) -> Vec<u32> {
        let wanted = orders.checkpoint || !orders.snapshots.is_empty();
        let all = if wanted { self.session.spec.grid.tiles() } else { 0 };
        orders.gathers.iter().flat_map(|(tiles, _)| tiles.iter().copied()).chain(0..all).collect()
    }

    /// Takes the ticks that a frame has for this session.
    fn take_ticks(&mut self, frame: u64) -> Advance {
        let (due, cycles) = if let Some(replay) = &self.replay {
            replay.due(self.clock.tick())
        } else if let Some(job) = &self.step {
            (job.remaining(), job.slice)
        } else if self.settings.paused || self.frozen {
            (0, 0)
        } else {
            (self.owed + self.clock.ticks_between(self.frame, frame), u32::MAX)
        };
        self.frame = frame;
        let snow = self.falling.ticks_until_due(self.clock.tick(), self.snowing());
        let advance = self.clock.advance(due.min(snow.unwrap_or(u64::MAX)), cycles);
        let counts = self.step.is_none() && self.replay.is_none();
        self.owed = if counts { due - advance.ticks } else { 0 };
        advance
    }

    /// Takes in what a run found: whether the snow has settled, and since when.
    pub(super) fn conclude_run(&mut self, last_change: u32) {
        let flight = &self.flight;
        if flight.advance.run.cycles == 0 {
            self.advance_goal(flight.advance.ticks);
            return;
        }
        let settled_after = flight.advance.settled_after(last_change);
        // What has arrived while the run was under way comes after it.
        let disturbed = !self.next.edits.is_empty();
        self.settled = settled_after.is_some() && !disturbed;
        self.still = self.settled && !self.next.wake;
        let mut ticks = flight.advance.ticks;
        let waits = self.step.as_ref().is_some_and(|job| matches!(job.goal, Goal::Settled(_)))
            && !self.next.changed;
        if let (true, true, Some(reached), Some(mut clock)) =
            (waits, self.is_settled(), settled_after, flight.clock_before)
        {
            // The state has been the same since: only the clock has gone on.
            clock.advance(reached, u32::MAX);
            self.clock = clock;
            ticks = reached;
        }
        self.advance_goal(ticks);
    }

    fn advance_goal(&mut self, ticks: u64) {
        let (settled, paused) = (self.is_settled(), self.settings.paused);
        if let Some(job) = &mut self.step {
            job.took(ticks);
            if job.is_over(settled, paused) {
                self.end_step();
            }
        }
    }

    /// Ends a step; its answer goes out with the next frame.
    pub(super) fn end_step(&mut self) {
        if let Some(job) = self.step.take() {
            self.next.replies.push(Reply::Done(job.answer));
        }
    }
}
