//! A frame from one session's point of view: the ticks it takes, the work it has, and what came of
//! them.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use firn_engine::frame::{Run, Work};

use crate::core::session::{
    Advance, Clock, Flight, Goal, MOST_SAMPLES, Orders, Simulation, weather_units,
};

/// Cycles that are taken at once where they change nothing, and none of them is carried out.
const CYCLES_AT_REST: u32 = 1 << 24;

/// Cycles that are taken at once where they are due, although they may have to be parted: between two ticks
/// a session is published.
const CYCLES_THAT_ARE_DUE: u32 = 8;

/// A frame, as it is offered to every session.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turn<'a> {
    /// Number of the beat.
    pub frame: u64,
    /// Number of the frame of the device.
    pub round: u64,
    /// Whether publications are due that nobody asked for.
    pub publish: bool,
    /// Whether a snowpack at rest may be left alone.
    pub sleep: bool,
    /// Time by which ticks have slipped \[µs\].
    pub slipped_us: &'a AtomicU64,
    /// Steps of weather taken.
    pub weather_steps: &'a AtomicU64,
}

impl Simulation {
    /// Lets the time up to a frame pass, where nothing happens in it: a pause has no ticks, and in
    /// the ticks of a session at rest nothing moves.
    pub(crate) fn catch_up(&mut self, frame: u64) {
        if self.portions.are_under_way() || self.replay.is_some() {
            return;
        }
        if self.state.settings.paused || self.frozen {
            self.frame = frame;
        } else if self.passes() {
            let due = self.state.clock.ticks_between(self.frame, frame);
            let free = self.state.ticks_without_weather();
            self.state.clock.pass(due.min(free));
            // The tick with a step of weather is left for a frame.
            let before_weather = |clock: &Clock| clock.frame_before(self.frame, free + 1);
            self.frame = if due > free { before_weather(&self.state.clock) } else { frame };
        }
    }

    /// What this session does in a frame; `None` for nothing.
    pub(crate) fn plan(&mut self, turn: Turn) -> Option<Work> {
        self.flight.round = turn.round;
        self.weather_due = false;
        if self.portions.are_under_way() {
            debug_assert!(self.next.edits.is_empty(), "changes wait for the end of the run");
            self.slip(turn.frame, turn.slipped_us);
            let publish = turn.publish || std::mem::take(&mut self.missed);
            self.flight.publish |= publish && self.replay.is_none();
            return self.portions.go_on(self.flight.publish);
        }
        if self.state.alpine.is_some() && self.step.is_none() {
            self.catch_up(turn.frame);
        }
        let clock_before = self.state.clock;
        let mut advance = self.take_ticks(turn);
        let mut weathered = 0;
        if advance.ticks > 0 {
            let weighed = self.state.take_back(clock_before.tick(), &mut self.next);
            if weighed > 0 {
                self.disturb(weighed);
            }
            weathered = self.take_weather(clock_before.tick());
            turn.weather_steps.fetch_add(weathered, Ordering::Relaxed);
        }
        if self.state.lies_alone() {
            advance.run = Run::default();
        }
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
        self.state.weigh(&mut orders);
        let strides = Run { dt: advance.stride, ..run };
        let moves = self.state.move_objects(strides, advance.cycles_at_once(), &mut orders);
        let publish = match &self.replay {
            Some(replay) => replay.publishes(),
            None => orders.are_awaited() || (self.is_to_publish(turn) && self.unpublished),
        };
        self.missed &= !publish;
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
            moves,
            pressing: self.state.settings.pressing,
            publish,
            tally: !orders.tallies.is_empty(),
            samples: orders.samples.iter().map(|(wanted, _)| *wanted).collect(),
            columns: orders.gathers.iter().flat_map(|wanted| wanted.columns.clone()).collect(),
            gather: self.gather(&orders),
            totals: orders.gathers.iter().filter_map(|wanted| wanted.totals).collect(),
            ..Work::default()
        };
        let (round, clock_before) = (turn.round, Some(clock_before));
        self.flight = Flight { orders, advance, weathered, clock_before, publish, round };
        Some(self.portions.begin(work, self.units_of_cycle(), &self.session.spec.grid))
    }

    /// Cells of the fixed grid and of columns that it wants of a frame. More columns than a frame has room for are read
    /// in parts.
    pub(crate) fn read_cells(&self) -> u64 {
        let orders = if self.portions.are_under_way() { &self.flight.orders } else { &self.next };
        orders.read_cells().min(MOST_SAMPLES)
    }

    /// Whether it has something to do in a frame.
    pub(crate) fn claims(&self, turn: Turn) -> bool {
        let stands_still =
            self.state.settings.paused || self.frozen || (turn.sleep && self.is_still());
        let ticks = self.state.clock.ticks_between(self.frame, turn.frame);
        let moves = !stands_still && ticks > 0;
        let weathers = !self.frozen
            && !self.state.settings.paused
            && ticks > self.state.ticks_without_weather();
        let ticks = moves || weathers;
        ticks || self.has_orders() || (self.unpublished && self.is_to_publish(turn))
    }

    /// Waits for another frame than this. Ticks of no more than the beat before don't pile up meanwhile.
    pub(crate) fn wait(&mut self, turn: Turn) {
        self.charge.waits += 1;
        self.missed |= turn.publish;
        if self.frame + 1 < turn.frame {
            self.slip(turn.frame - 1, turn.slipped_us);
        }
    }

    /// Whether publications are due that nobody asked for, since one has been missed too.
    fn is_to_publish(&self, turn: Turn) -> bool {
        turn.publish || self.missed
    }

    /// Units that one of its cycles costs.
    fn units_of_cycle(&self) -> u64 {
        let objects = self.state.colliders.values().map(|collider| &collider.reach);
        let steps = self.state.clock.steady_cycle().map_or(1, |dt| self.state.steps_of_cycle(dt));
        self.portions.cycle(&self.session.spec.grid, objects, steps)
    }

    /// Lets the ticks up to a frame slip while those before them are under way: they don't pile up.
    fn slip(&mut self, frame: u64, slipped_us: &AtomicU64) {
        if self.step.is_none()
            && self.replay.is_none()
            && !self.state.settings.paused
            && !self.frozen
        {
            let ticks = self.state.clock.ticks_between(self.frame, frame);
            let lag_us = ticks as f64 * 1e6 / self.state.clock.tick_rate();
            slipped_us.fetch_add(lag_us as u64, Ordering::Relaxed);
        }
        self.frame = frame;
    }

    /// Tiles that are wanted: all of them for snapshots.
    fn gather(&self, orders: &Orders) -> Vec<u32> {
        let wanted = orders.checkpoint || !orders.snapshots.is_empty();
        (0..if wanted { self.session.spec.grid.tiles() } else { 0 }).collect()
    }

    /// Takes the ticks that a frame has for this session: none where a checkpoint is made of it, so
    /// that the frame doesn't take longer for that.
    fn take_ticks(&mut self, turn: Turn) -> Advance {
        let counts = self.step.is_none() && self.replay.is_none();
        let due = if let Some(replay) = &self.replay {
            replay.due(self.state.clock.tick())
        } else if let Some(job) = &self.step {
            job.remaining()
        } else if self.state.settings.paused || self.frozen {
            0
        } else if self.owed > 0 {
            self.slip(turn.frame, turn.slipped_us);
            self.owed
        } else {
            self.state.clock.ticks_between(self.frame, turn.frame)
        };
        self.frame = turn.frame;
        let taken = if self.next.checkpoint { 0 } else { due.min(self.most_ticks()) };
        let passes = self.state.lies_alone()
            || (turn.sleep && self.is_still() && taken <= self.state.ticks_without_weather());
        let units = self.units_of_cycle();
        let fitting = self.portions.cycles(units);
        let cycles = match counts {
            _ if passes => CYCLES_AT_REST,
            true => fitting.max(CYCLES_THAT_ARE_DUE),
            false => fitting,
        };
        let before = self.state.clock;
        let most = self.state.most_cycles_of_tick();
        let mut advance = self.state.clock.advance_within(taken, cycles, most);
        // Whatever falls at a tick is in its snapshot: that is not made in the frame of the tick.
        let units = if passes { 0 } else { units.saturating_mul(advance.run.cycles.into()) };
        let weather = self.state.steps_until(&self.state.clock);
        let weather = weather.saturating_mul(weather_units(&self.state.grid));
        let parted = self.portions.part(units.saturating_add(weather));
        let apart = parted || (advance.ticks > 0 && !self.next.snapshots.is_empty());
        self.answered_first = apart && !self.answered_first && self.answers_without_ticks();
        if self.answered_first {
            (self.state.clock, advance) = (before, Advance::default());
        }
        self.owed = if counts { due - advance.ticks } else { 0 };
        advance
    }

    /// Ticks that can be taken at once: nothing falls or comes back before the last of them.
    fn most_ticks(&self) -> u64 {
        if self.state.may_return(&self.next) {
            return 1.min(self.ticks_of_weather());
        }
        self.state.ticks_until_snow().unwrap_or(u64::MAX).min(self.ticks_of_weather())
    }

    /// Ticks that can be taken at once for the weather's sake. Where they are many, they take about two frames.
    fn ticks_of_weather(&self) -> u64 {
        let alone = self.state.lies_alone();
        let units = self.portions.size().saturating_mul(2);
        self.state.ticks_of_weather(units, weather_units(&self.state.grid), alone)
    }

    /// Takes the steps of weather that have ended; `tick` is the one before them. Returns how many they are.
    fn take_weather(&mut self, tick: u64) -> u64 {
        let steps = self.state.take_weather(tick, &mut self.next);
        // Under objects the snow has settled or grown soft.
        if steps > 0 && !self.state.lies_alone() {
            self.disturb(self.state.tiles_under_objects());
        }
        steps
    }

    /// Takes in that it took some time of a frame, and fits to that what the next one takes on.
    pub(crate) fn charge(&mut self, units: u64, took: Duration) {
        self.portions.fit(units, took);
        self.charge.add(took, self.frame);
        self.session.charge(took);
    }

    /// Whether there is somebody to be answered in a frame without ticks.
    fn answers_without_ticks(&self) -> bool {
        self.next.are_awaited() && self.replay.is_none()
    }

    /// Takes in what a run found: whether the snow has settled, and since when.
    pub(crate) fn conclude_run(&mut self, last_change: u32) {
        let flight = &self.flight;
        if flight.advance.run.cycles == 0 {
            self.advance_goal(flight.advance.ticks);
            return;
        }
        let settled_after = flight.advance.settled_after(last_change);
        self.settled = settled_after.is_some();
        self.still = self.settled;
        let mut ticks = flight.advance.ticks;
        let waits = self.step.as_ref().is_some_and(|job| matches!(job.goal, Goal::Settled(_)));
        if let (true, true, Some(reached), Some(mut clock)) =
            (waits, self.is_settled(), settled_after, flight.clock_before)
        {
            // The state has been the same since: only the clock has gone on.
            clock.advance(reached, u32::MAX);
            self.state.clock = clock;
            ticks = reached;
        }
        self.advance_goal(ticks);
    }

    fn advance_goal(&mut self, ticks: u64) {
        let (settled, paused) = (self.is_settled(), self.state.settings.paused);
        if let Some(job) = &mut self.step {
            job.took(ticks);
            if job.is_over(settled, paused) {
                self.end_step();
            }
        }
    }
}
