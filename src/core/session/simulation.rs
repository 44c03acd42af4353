//! One session whose snow is on the device: what it is, what it has to do in the next frame, and what
//! came of it.

use std::sync::Arc;

use firn_engine::frame::{Contents, Edit, Layout, SampleBox, Slot, TileCells};
use firn_protocol::{Reference, SessionSpec};
use firn_snow::{Elevation, Floor, Grid, TILE_COLUMNS};

use crate::core::object_rows::ObjectRows;
use crate::core::record::{Log, Replay};
use crate::core::session::{
    Alpine, Answer, Beginning, CellBox, Charge, Command, Flight, Ground, Orders, Outlet, Portions,
    Receipted, Reply, SessionError, SessionState, StepJob,
};
use crate::core::snapshot::Snapshot;

/// A session whose snow is on the device.
#[derive(Debug)]
pub struct Simulation {
    pub(crate) session: Arc<Outlet>,
    pub(crate) slot: Slot,
    /// Place among all simulations.
    pub(crate) place: usize,
    pub(crate) state: SessionState,
    /// It is to be in the coming frame, as a step of weather falls into it.
    pub(crate) weather_due: bool,
    /// Frame up to which ticks have been counted, and ticks counted but not taken yet.
    pub(crate) frame: u64,
    pub(crate) owed: u64,
    /// What they take in the device's tables.
    pub(crate) object_rows: ObjectRows,
    /// The last executed cycle changed no cell, and nothing was disturbed since.
    pub(crate) settled: bool,
    /// As `settled`, and no later cycle can change a cell either.
    pub(crate) still: bool,
    /// Cycle length of the last run: tiles that rested at one length may move at another.
    pub(crate) last_dt: Option<f64>,
    /// Something has happened that the mirror doesn't show.
    pub(crate) unpublished: bool,
    /// A publication was due while it waited for a frame.
    pub(crate) missed: bool,
    /// What the next frame has to do.
    pub(crate) next: Orders,
    /// What the run under way does.
    pub(crate) flight: Flight,
    /// How runs are parted into frames.
    pub(crate) portions: Portions,
    /// Device time that it has taken.
    pub(crate) charge: Charge,
    pub(crate) step: Option<StepJob>,
    /// What is still to be handed to the journal.
    pub(crate) log: Log,
    /// What it has to go through again before anything else.
    pub(crate) replay: Option<Replay>,
    /// The newest frame has put off its ticks, so that waiting requests are answered first.
    pub(crate) answered_first: bool,
    /// Time stands still: it is about to hibernate.
    pub(crate) frozen: bool,
    /// The mirror shows a state that was published before the session was brought back.
    pub(crate) brought_back: bool,
}

impl Simulation {
    /// A new session without snow.
    pub(crate) fn new(
        session: Arc<Outlet>,
        slot: Slot,
        frame: u64,
        log: Log,
        object_rows: ObjectRows,
    ) -> Simulation {
        let spec = &session.spec;
        Simulation {
            slot,
            place: 0,
            state: SessionState::new(spec),
            frame,
            weather_due: false,
            owed: 0,
            object_rows,
            settled: spec.initial_snow.is_empty(),
            still: false,
            last_dt: None,
            unpublished: true,
            missed: false,
            next: Orders::default(),
            flight: Flight::default(),
            portions: Portions::default(),
            charge: Charge::default(),
            step: None,
            log,
            replay: None,
            answered_first: false,
            frozen: false,
            brought_back: false,
            session: session.clone(),
        }
    }

    /// Frames that it has waited for, because others had taken less device time.
    pub fn waits(&self) -> u64 {
        self.charge.waits
    }

    /// Lays the initial snow, or restores what was saved.
    pub(crate) fn begin(&mut self, saved: Option<&Snapshot>) {
        if let Some(snapshot) = saved {
            self.restore(snapshot);
            // What was due when it was saved is due before the next tick.
            self.deposit_falling();
            return;
        }
        let session = self.session.clone();
        for layer in &session.spec.initial_snow {
            let (density, celsius) = self.state.new_snow();
            let density = layer.density.unwrap_or(density);
            let celsius = layer.temperature.unwrap_or(celsius) as f32;
            let (columns, (depth, mass)) =
                (self.state.grid.all(), self.state.quanta(layer.depth, density));
            self.carry_out(&Command::Deposit { columns, depth, mass, celsius });
        }
    }

    /// Notes that something may move again in so many tiles.
    pub(crate) fn disturb(&mut self, tiles: u64) {
        self.settled = false;
        self.still = false;
        self.portions.disturb(tiles);
    }

    /// Notes that every tile has to be looked at again.
    pub(crate) fn wake(&mut self) {
        self.still = false;
        self.next.wake = true;
        self.portions.disturb(self.session.spec.grid.tiles().into());
    }

    /// Back to the state it was created in, or to what a snapshot holds. Seqs go on.
    pub(crate) fn reset(&mut self, to: Beginning, answer: Answer<Receipted<()>>) {
        match to {
            Beginning::Origin(saved) => {
                self.log.record(self.state.clock.tick(), Command::Reset);
                self.begin_anew(saved.as_deref());
            }
            Beginning::Snapshot(snapshot, bytes) => {
                self.log.begin_anew(bytes);
                self.begin_anew(Some(&snapshot));
            }
        }
        self.next.replies.push(Reply::Done(answer));
    }

    pub(crate) fn begin_anew(&mut self, saved: Option<&Snapshot>) {
        let session = self.session.clone();
        let spec: &SessionSpec = &session.spec;
        self.last_dt = None;
        self.owed = 0;
        self.next.reset = true;
        // What came before in this frame is of a ledger that is gone.
        self.next.counted.clear();
        self.next.weighed.clear();
        self.object_rows.take(0);
        let before = std::mem::replace(&mut self.state, SessionState::new(spec));
        if before.ground.is_some() {
            self.next.edits.push(Edit::SetGround(session.ground.heights().clone()));
        }
        let removed = before.colliders.into_keys();
        self.next.edits.extend(removed.map(|id| Edit::RemoveCollider { id }));
        // What is restored leaves slots above it as they are: nothing may lie in those.
        self.next.edits.push(Edit::Clear { columns: spec.grid.all(), depth: 0 });
        self.next.edits.extend(self.state.alpine.as_ref().map(|alpine| bare(&spec.grid, alpine)));
        self.next.edits.push(Edit::SetMaterial(spec.material));
        self.wake();
        self.settled = spec.initial_snow.is_empty();
        self.begin(saved);
        self.next.changed = true;
    }

    /// What the backend makes the snowpack with.
    pub(crate) fn layout(spec: &SessionSpec) -> Layout {
        let ground = spec.terrain.as_ref().map(|terrain| terrain.heights.clone());
        Layout {
            grid: spec.grid,
            material: spec.material,
            ground: ground.unwrap_or_default(),
            surface: Alpine::new(spec).map(|alpine| alpine.surface()),
        }
    }

    /// The ground as it is now.
    pub(crate) fn ground(&self) -> &Ground {
        self.state.ground.as_ref().unwrap_or(&self.session.ground)
    }

    /// What the backend is asked for some cells of the fixed grid.
    pub(crate) fn sample_box(&self, wanted: &CellBox) -> SampleBox {
        let CellBox { columns, reference, y0, height } = *wanted;
        let floor = match reference {
            Reference::Lowest => {
                Floor::Level(Elevation::new(&self.state.grid, self.ground().lowest()))
            }
            Reference::Ground => Floor::Ground,
        };
        SampleBox { columns, floor, y0, height, dt: self.cycle_length() }
    }

    /// Length of the last cycle \[s\]; of the next one where there was none.
    pub(crate) fn cycle_length(&self) -> f64 {
        self.last_dt.or(self.state.clock.steady_cycle()).unwrap_or(0.0)
    }

    /// Whether no snow falls, no object moves, and the last executed cycle changed no cell.
    pub(crate) fn is_settled(&self) -> bool {
        (self.settled || self.state.lies_alone())
            && self.state.settings.snowfall_rate == 0.0
            && !self.state.moves()
    }

    /// Whether nothing can move in any later tick, so that ticks pass by themselves.
    pub(crate) fn is_resting(&self) -> bool {
        self.state.settings.snowfall_rate == 0.0 && self.is_still()
    }

    /// Whether nothing can move in any tick until it is disturbed, by snow that falls too.
    pub(crate) fn is_still(&self) -> bool {
        if self.state.lies_alone() {
            return true;
        }
        let cycle = self.state.clock.steady_cycle();
        cycle.is_none_or(|dt| self.still && Some(dt) == self.last_dt && !self.state.is_restless())
    }

    /// Whether its ticks pass by themselves: nothing moves, and its time goes on.
    pub(crate) fn passes(&self) -> bool {
        !self.state.settings.paused && !self.frozen && self.is_resting()
    }

    /// Beat at which it is to be in a frame, although nothing happens before: a step of weather falls into it.
    pub(crate) fn wakes_at(&self) -> Option<u64> {
        let ticks = self.state.ticks_until_weather().filter(|_| self.passes())?;
        Some(self.state.clock.frame_before(self.frame, ticks).saturating_add(1))
    }

    /// Takes part in the coming frame, where a step of weather falls into it.
    pub(crate) fn wake_for_weather(&mut self, frame: u64) {
        if self.wakes_at().is_some_and(|wakes| wakes <= frame) {
            self.catch_up(frame);
            self.weather_due = true;
        }
    }

    /// Whether nobody has wanted it for so long that it hibernates.
    pub(crate) fn is_tired(&self) -> bool {
        let idle = self.session.idle_for();
        self.state.settings.idle_timeout_s.is_some_and(|timeout| idle >= timeout)
    }

    /// Whether the session wants to be in the coming frames.
    pub(crate) fn wants_frames(&self) -> bool {
        self.replay.is_some()
            || self.has_orders()
            || (!self.frozen
                && (self.unpublished
                    || self.weather_due
                    || (!self.state.settings.paused && !self.is_resting())))
    }

    /// Whether somebody waits for a frame.
    pub(crate) fn has_orders(&self) -> bool {
        self.portions.are_under_way()
            || self.step.is_some()
            || self.owed > 0
            || self.next.are_urgent()
    }

    /// Deposits the continuous snowfall, where there is enough of it. Nobody waits for that: it goes with the
    /// next frame.
    pub(crate) fn deposit_falling(&mut self) {
        let SessionState { clock, grid, .. } = &self.state;
        let (tick, grid) = (clock.tick(), *grid);
        let celsius = self.state.snowing_celsius() as f32;
        let snowing = self.state.snowing();
        for command in self.state.falling.lay(tick, snowing, celsius, &grid) {
            self.carry_out(&command);
        }
    }

    /// Has the coming frame show what has come of a replay. No time has passed until then.
    pub(crate) fn show(&mut self, frame: u64) {
        self.frame = frame;
        self.unpublished = true;
        self.missed = true;
    }

    /// Lets time go on after it stood still, and has that published.
    pub(crate) fn thaw(&mut self, frame: u64) {
        self.frozen = false;
        self.frame = frame;
        self.unpublished = true;
    }

    /// Tick that it should have reached when it is brought back in a frame to what is stored: what
    /// has passed by itself is not lost.
    pub(crate) fn until(&mut self, frame: u64) -> u64 {
        self.catch_up(frame);
        match self.flight.clock_before {
            _ if self.state.settings.paused => 0,
            Some(before) if self.portions.are_under_way() => before.tick(),
            _ => self.state.clock.tick(),
        }
    }

    /// Tells everybody who waits for this session why there is no answer.
    pub(crate) fn refuse_all(self, why: &SessionError) {
        self.next.refuse(why);
        self.flight.orders.refuse(why);
        if let Some(job) = self.step {
            job.answer.refuse(why);
        }
    }
}

/// Makes of the columns of a grid on which no snow lies what those of alpine snow begin as.
fn bare(grid: &Grid, alpine: &Alpine) -> Edit {
    let surfaces = vec![alpine.surface(); TILE_COLUMNS as usize];
    let tile = TileCells { surfaces, ..TileCells::empty(0) };
    let tiles = Arc::new(vec![tile; grid.tiles() as usize]);
    Edit::Restore(Arc::new(Contents { tiles, colliders: Vec::new() }))
}
