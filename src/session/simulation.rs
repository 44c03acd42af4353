//! One session on the world's thread: what it is, what it has to do in the next frame, and what
//! came of it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::engine::frame::{Deposit, Edit, Layout, Run, Slot, Work};
use crate::snow::{CELL, ColumnRect, Contact, MASS_QUANTA, Material, Position, Shape};

use super::clock::{Advance, Clock};
use super::error::SessionError;
use super::falling::{Falling, Snowing};
use super::gather::Ledger;
use super::handle::Session;
use super::journal::{Event, Log, Replay};
use super::orders::{Answer, Flight, Orders, Reply, ReplyKind, refuse};
use super::portion::Portions;
use super::snapshot::Snapshot;
use super::spec::SessionSpec;
use super::step::{Goal, StepJob};
use super::view::Settings;

/// A session on the world's thread.
#[derive(Debug)]
pub struct Simulation {
    pub(super) session: Arc<Session>,
    pub(super) slot: Slot,
    pub(super) clock: Clock,
    /// Frame up to which ticks have been counted, and ticks counted but not taken yet.
    pub(super) frame: u64,
    owed: u64,
    pub(super) settings: Settings,
    pub(super) material: Material,
    pub(super) colliders: BTreeMap<Arc<str>, Collider>,
    pub(super) ledger: Ledger,
    pub(super) falling: Falling,
    /// The last executed cycle changed no cell, and nothing was disturbed since.
    pub(super) settled: bool,
    /// As `settled`, and no later cycle can change a cell either.
    still: bool,
    /// Cycle length of the last run: tiles that rested at one length may move at another.
    pub(super) last_dt: Option<f64>,
    /// Something has happened that the mirror doesn't show.
    pub(super) unpublished: bool,
    /// What the next frame has to do.
    pub(super) next: Orders,
    /// What the run under way does.
    pub(super) flight: Flight,
    /// How runs are parted into frames.
    pub(super) portions: Portions,
    pub(super) step: Option<StepJob>,
    /// What is still to be handed to the journal.
    pub(super) log: Log,
    /// What it has to go through again before anything else.
    pub(super) replay: Option<Replay>,
    /// Time stands still: it is about to hibernate.
    pub(super) frozen: bool,
    /// The mirror shows a state that was published before the session was brought back.
    pub(super) brought_back: bool,
    /// Reads that wait for the end of the replay.
    pub(super) waiting_reads: Orders,
}

/// An object on the snow.
#[derive(Clone, Debug)]
pub(super) struct Collider {
    pub mass: f64,
    pub shape: Shape,
    pub position: Position,
    /// As last published.
    pub contact: Contact,
}

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
    /// A new session without snow.
    pub(super) fn new(session: Arc<Session>, slot: Slot, frame: u64, log: Log) -> Simulation {
        let spec = &session.spec;
        Simulation {
            slot,
            clock: Clock::new(spec.tick_rate, spec.time_scale),
            frame,
            owed: 0,
            settings: spec.settings(),
            material: spec.material,
            colliders: BTreeMap::new(),
            ledger: Ledger::default(),
            falling: Falling::default(),
            settled: spec.initial_snow.is_empty(),
            still: false,
            last_dt: None,
            unpublished: true,
            next: Orders::default(),
            flight: Flight::default(),
            portions: Portions::default(),
            step: None,
            log,
            replay: None,
            frozen: false,
            brought_back: false,
            waiting_reads: Orders::default(),
            session: session.clone(),
        }
    }

    /// Lays the initial snow, or restores what was saved.
    pub(super) fn begin(&mut self, saved: Option<&Snapshot>) {
        if let Some(snapshot) = saved {
            self.restore(snapshot);
            // What was due when it was saved is due before the next tick.
            self.deposit_falling();
            return;
        }
        let session = self.session.clone();
        for layer in &session.spec.initial_snow {
            let density = layer.density.unwrap_or(self.material.fresh_density);
            let celsius = layer.temperature.unwrap_or(self.settings.air_temperature);
            self.deposit(session.spec.grid.all(), layer.depth, density, celsius);
            self.next.replies.push(Reply::Snowfall { edit: self.next.edits.len() - 1 });
        }
    }

    /// Lets snow fall in the next frame.
    pub(super) fn deposit(
        &mut self,
        columns: ColumnRect,
        depth: f64,
        density: f64,
        celsius: f64,
    ) -> ReplyKind {
        let grid = self.session.spec.grid;
        let mass = (depth * density * MASS_QUANTA).round() as u64;
        self.deposit_quanta(columns, grid.thickness_quanta(depth), mass, celsius)
    }

    fn deposit_quanta(
        &mut self,
        columns: ColumnRect,
        depth: u64,
        mass: u64,
        celsius: f64,
    ) -> ReplyKind {
        // No column takes more than all its slots; the rest is refused without asking.
        let room = u64::from(self.session.spec.grid.height) * u64::from(CELL);
        let (kept_depth, kept_mass) = if depth > room {
            (room, (u128::from(mass) * u128::from(room) / u128::from(depth)) as u64)
        } else {
            (depth, mass)
        };
        let fallen = u128::from(mass) * u128::from(columns.columns());
        let refused = u128::from(mass - kept_mass) * u128::from(columns.columns());
        self.ledger.fallen += fallen;
        self.ledger.refused += refused;
        self.disturb();
        self.next.edits.push(Edit::Deposit(Deposit {
            columns,
            depth: kept_depth as u32,
            mass: kept_mass as u32,
            temperature: celsius as f32,
        }));
        ReplyKind::Snowfall { edit: self.next.edits.len() - 1, fallen, refused }
    }

    /// Notes that something may move again.
    pub(super) fn disturb(&mut self) {
        self.settled = false;
        self.still = false;
        if let Some(job) = &mut self.step {
            job.begin_anew();
        }
    }

    /// Notes that every tile has to be looked at again.
    pub(super) fn wake(&mut self) {
        self.still = false;
        self.next.wake = true;
    }

    /// Back to the state it was created in. Seqs go on.
    pub(super) fn reset(&mut self, saved: Option<&Snapshot>, answer: Answer<()>) {
        self.log.record(self.clock.tick(), Event::Reset);
        self.begin_anew(saved);
        self.next.replies.push(Reply::Done(answer));
    }

    pub(super) fn begin_anew(&mut self, saved: Option<&Snapshot>) {
        let session = self.session.clone();
        let spec: &SessionSpec = &session.spec;
        self.clock = Clock::new(spec.tick_rate, spec.time_scale);
        self.settings = spec.settings();
        self.material = spec.material;
        self.ledger = Ledger::default();
        self.falling = Falling::default();
        self.last_dt = None;
        self.owed = 0;
        self.next.reset = Some(self.next.edits.len());
        let removed = std::mem::take(&mut self.colliders).into_keys();
        self.next.edits.extend(removed.map(|id| Edit::RemoveCollider { id }));
        self.next.edits.push(Edit::Clear { columns: spec.grid.all(), depth: 0 });
        self.next.edits.push(Edit::SetMaterial(spec.material));
        self.wake();
        self.settled = spec.initial_snow.is_empty();
        self.begin(saved);
        self.next.changed = true;
    }

    /// What the backend makes the snowpack with.
    pub(super) fn layout(spec: &SessionSpec) -> Layout {
        let ground = spec.terrain.as_ref().map(|terrain| {
            let (lowest, _) = spec.ground_range();
            let units = |height: f64| (spec.grid.thickness_quanta(height - lowest) >> 1) as u32;
            terrain.heights.iter().map(|&height| units(height)).collect()
        });
        Layout { grid: spec.grid, material: spec.material, ground: ground.unwrap_or_default() }
    }

    /// Length of the last cycle \[s\]; of the next one where there was none.
    pub(super) fn cycle_length(&self) -> f64 {
        self.last_dt.or(self.clock.steady_cycle()).unwrap_or(0.0)
    }

    /// Whether no snow falls and the last executed cycle changed no cell.
    pub(super) fn is_settled(&self) -> bool {
        self.settled && self.settings.snowfall_rate == 0.0
    }

    /// Whether nothing can move in any later tick, so that ticks pass by themselves.
    pub(super) fn is_resting(&self) -> bool {
        self.still
            && self.settings.snowfall_rate == 0.0
            && self.clock.steady_cycle().is_none_or(|dt| Some(dt) == self.last_dt)
    }

    /// Whether its ticks pass by themselves: nothing moves, and its time goes on.
    pub(super) fn passes(&self) -> bool {
        !self.settings.paused && !self.frozen && self.is_resting()
    }

    /// Whether the session wants to be in the coming frames.
    pub(super) fn wants_frames(&self) -> bool {
        self.replay.is_some()
            || self.has_orders()
            || (!self.frozen && (self.unpublished || (!self.settings.paused && !self.is_resting())))
    }

    /// Whether somebody waits for a frame.
    pub(super) fn has_orders(&self) -> bool {
        self.portions.are_under_way()
            || self.step.is_some()
            || self.owed > 0
            || self.next.are_urgent()
    }

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

    /// What falls in a tick.
    pub(super) fn snowing(&self) -> Snowing {
        let rate = self.settings.snowfall_rate;
        let density = self.material.fresh_density;
        Snowing::new(rate, density, self.clock.dt(), &self.session.spec.grid)
    }

    /// Deposits the continuous snowfall, once there is enough of it.
    pub(super) fn deposit_falling(&mut self) {
        if let Some((depth, mass)) = self.falling.take(self.clock.tick(), self.snowing()) {
            let celsius = self.settings.air_temperature;
            let all = self.session.spec.grid.all();
            self.deposit_quanta(all, depth, mass, celsius);
            self.next.replies.push(Reply::Snowfall { edit: self.next.edits.len() - 1 });
        }
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

    /// Lets time go on after it stood still, and has that published.
    pub(super) fn thaw(&mut self, frame: u64) {
        self.frozen = false;
        self.frame = frame;
        self.unpublished = true;
    }

    /// Tick that it should have reached when it is brought back in a frame to what is stored: what
    /// has passed by itself is not lost.
    pub(super) fn until(&mut self, frame: u64) -> u64 {
        self.catch_up(frame);
        if self.settings.paused { 0 } else { self.clock.tick() }
    }

    /// Tells everybody who waits for this session why there is no answer.
    pub(super) fn refuse_all(mut self, why: &SessionError) {
        self.next.refuse(why);
        self.waiting_reads.refuse(why);
        self.flight.orders.refuse(why);
        if let Some(job) = self.step {
            refuse(job.answer, why);
        }
        for ack in self.log.take_acks() {
            ack(Err(why.clone()));
        }
    }
}
