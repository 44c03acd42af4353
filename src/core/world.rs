//! A step: what has happened is taken in, and what is due is done.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use firn_engine::frame::Slot;
use firn_engine::parallel::Executor;
use tracing::error;

use crate::core::back::Coming;
use crate::core::begin::Beginning;
use crate::core::device::Device;
use crate::core::frame::{InFlight, caught};
use crate::core::making::Making;
use crate::core::record::{Heartbeat, Record};
use crate::core::session::{FRAME_RATE, Inbox, Outlet, SessionError, Simulation};
use crate::core::simulations::Simulations;
use crate::core::slots::Slots;
use crate::core::stop::Stop;
use crate::core::storage::Storage;
use crate::core::timers::Deadlines;
use crate::core::vitals::Vitals;
use crate::core::{Directory, Effect, Input, Now, WorldConfig};

/// All sessions.
pub(crate) struct World {
    /// When the step under way happens.
    pub(super) now: Now,
    /// What it wants done.
    pub(super) effects: Vec<Effect>,
    pub(super) executor: Executor,
    pub(super) has_memory: HasMemory,
    pub(super) config: WorldConfig,
    pub(super) checkpoint_interval: Duration,
    /// Whether what is committed outlives the process.
    pub(super) durable: bool,
    pub(super) names: Arc<dyn Directory>,
    pub(super) vitals: Arc<Vitals>,
    pub(super) frames: Arc<AtomicU64>,
    pub(super) frame: u64,
    /// A beat that has not been counted yet.
    pub(super) beat_due: bool,
    /// Frames of the device so far.
    pub(super) round: u64,
    pub(super) in_flight: Option<InFlight>,
    pub(super) device: Device,
    /// Fingerprint of what carries frames out.
    pub(super) adapter: u64,
    /// Frame in which sessions were last looked after.
    pub(super) looked_after: u64,
    pub(super) simulations: Simulations,
    /// There is something to do that no beat has to be waited for.
    pub(super) busy: bool,
    /// When it is to be seen whether sessions are to be deleted, because nobody wants them.
    pub(super) ends: Deadlines,
    /// When checkpoints are to be made of them, before they hibernate or to cut their journals short.
    pub(super) saves: Deadlines,
    /// Beats at which sessions at rest are to be in a frame, as a step of weather falls into it.
    pub(super) wakes: Deadlines<u64>,
    /// Sessions whose memory is freed.
    pub(super) hibernating: BTreeMap<u64, Arc<Outlet>>,
    /// What waits for sessions.
    pub(super) mail: BTreeMap<u64, Inbox>,
    /// Snowpacks that the backend is about to take in.
    pub(super) making: BTreeMap<Slot, Making>,
    /// Sessions that are on their way back, and the order in which they come.
    pub(super) coming: BTreeMap<u64, Coming>,
    pub(super) queue: VecDeque<u64>,
    /// Those of them that somebody asks for.
    pub(super) asked: VecDeque<u64>,
    /// When the server was started.
    pub(super) began: Instant,
    /// What sessions come back from.
    pub(super) records: BTreeMap<u64, Record>,
    pub(super) storage: Storage,
    pub(super) slots: Slots,
    /// What the objects of all sessions take in the device's tables.
    pub(super) object_rows: Arc<AtomicU64>,
    /// Sessions that panicked.
    pub(super) fallen: Vec<u64>,
    /// The session of which a checkpoint is being made.
    pub(super) checkpointing: Option<u64>,
    /// The coming frame has a checkpoint.
    pub(super) saving: bool,
    pub(super) beginning: Beginning,
    /// All sessions are back that outlived the last stop.
    pub(super) recovered: bool,
    pub(super) stop: Option<Stop>,
}

/// Says whether there is memory for so many bytes.
pub(crate) type HasMemory = fn(u64) -> bool;

/// What a world begins with.
pub(crate) struct Setup {
    pub now: Now,
    pub executor: Executor,
    pub has_memory: HasMemory,
    pub config: WorldConfig,
    /// Time after a change until a checkpoint is due.
    pub checkpoint_interval: Duration,
    /// Whether what is committed outlives the process.
    pub durable: bool,
    pub names: Arc<dyn Directory>,
    pub vitals: Arc<Vitals>,
    /// Counts frames, for who reads mirrors.
    pub frames: Arc<AtomicU64>,
    /// Fingerprint of what carries frames out.
    pub adapter: u64,
    /// How far the last life had come.
    pub heartbeat: Heartbeat,
    /// Sessions that outlived it, and what they come back from.
    pub coming: BTreeMap<u64, Coming>,
    pub records: BTreeMap<u64, Record>,
}

impl World {
    /// A world in which nothing has happened yet.
    pub fn new(setup: Setup) -> World {
        let Setup { now, heartbeat, coming, records, .. } = setup;
        // Where nothing was stored nobody was ever told anything.
        let (new, recovered) = (coming.is_empty(), setup.vitals.is_recovered());
        World {
            now,
            effects: Vec::new(),
            executor: setup.executor,
            has_memory: setup.has_memory,
            config: setup.config,
            checkpoint_interval: setup.checkpoint_interval,
            durable: setup.durable,
            names: setup.names,
            vitals: setup.vitals,
            frames: setup.frames,
            frame: heartbeat.frame,
            beat_due: false,
            round: heartbeat.round,
            in_flight: None,
            device: Device::default(),
            adapter: setup.adapter,
            looked_after: heartbeat.frame,
            simulations: Simulations::default(),
            busy: false,
            ends: Deadlines::default(),
            saves: Deadlines::default(),
            wakes: Deadlines::default(),
            hibernating: BTreeMap::new(),
            mail: BTreeMap::new(),
            making: BTreeMap::new(),
            queue: coming.keys().copied().collect(),
            asked: VecDeque::new(),
            coming,
            began: now.instant,
            records,
            storage: Storage::default(),
            slots: Slots::default(),
            object_rows: Arc::default(),
            fallen: Vec::new(),
            checkpointing: None,
            saving: false,
            beginning: if new { Beginning::OnDisk } else { Beginning::Unwritten },
            recovered,
            stop: None,
        }
    }

    /// Takes in what has happened, and goes on from there, up to the next frame. What it wants done is to be done
    /// in order, and before anything else is told.
    pub fn step(&mut self, now: Now, inputs: &mut VecDeque<Input>, effects: &mut VecDeque<Effect>) {
        self.take(now, inputs, effects);
        self.retry_rewriting();
        if self.stop.is_some() {
            self.go_on_stopping();
        } else {
            // Either is to be seen to, whatever the other is.
            let (has_begun, has_device) = (self.has_begun(), self.has_device());
            if has_begun && has_device {
                self.do_what_is_due();
            }
        }
        effects.extend(self.effects.drain(..));
    }

    /// Takes in what has happened.
    pub fn take(&mut self, now: Now, inputs: &mut VecDeque<Input>, effects: &mut VecDeque<Effect>) {
        self.now = now;
        while let Some(input) = inputs.pop_front() {
            self.take_input(input);
        }
        effects.extend(self.effects.drain(..));
    }

    /// Writes what is left to be written when everything ends.
    pub fn finish(&mut self, effects: &mut VecDeque<Effect>) {
        if self.storage.is_to_be_rewritten() {
            self.rewrite();
        }
        effects.extend(self.effects.drain(..));
    }

    fn do_what_is_due(&mut self) {
        // The frame with a checkpoint takes on nothing that falls on a beat.
        let beat = !std::mem::take(&mut self.saving) && std::mem::take(&mut self.beat_due);
        let publish = beat && self.beat();
        self.look_after_sessions();
        self.read_next();
        self.drain_mail();
        self.feed_coming();
        self.begin_frame(publish, beat);
    }

    /// Whether there is something to do that no beat has to be waited for.
    pub fn is_busy(&self) -> bool {
        match self.beginning {
            _ if self.stop.is_some() => self.busy,
            Beginning::Unwritten => true,
            Beginning::HandedOver => false,
            Beginning::OnDisk => {
                self.device.is_open() && (self.busy || self.beat_due || self.saving)
            }
        }
    }

    /// When something that has failed is tried again, where nothing is to be done before that.
    pub fn next_attempt(&self) -> Option<Instant> {
        self.device.next_attempt()
    }

    /// Whether ticks fall on beats: while sessions come back after a start nobody's time passes.
    pub fn has_beats(&self) -> bool {
        self.beginning == Beginning::OnDisk && self.recovered && self.device.is_open()
    }

    /// Whether a beat has been told that is not counted yet: another one would be lost.
    pub fn owes_a_beat(&self) -> bool {
        self.beat_due
    }

    /// Counts a beat. Returns whether publications are due with it.
    fn beat(&mut self) -> bool {
        self.frame += 1;
        self.frames.store(self.frame, Ordering::Relaxed);
        let publications =
            |frame: u64| (frame as f64 * self.config.publish_rate / FRAME_RATE + 1e-9) as u64;
        publications(self.frame) > publications(self.frame - 1)
    }

    /// Keeps a simulation among the active ones where it has more to do. Where not, only time goes
    /// on in it from here.
    pub(crate) fn review(&mut self, key: u64) {
        let Some(simulation) = self.simulations.get(&key) else { return };
        if self.fallen.contains(&key) || self.is_leaving(key) {
            return;
        }
        self.busy |= simulation.has_orders();
        let active = simulation.wants_frames();
        let wakes = simulation.wakes_at();
        self.simulations.set_active(key, active);
        if !active {
            self.wakes.set(key, wakes);
            self.anchor(key);
            self.schedule(key);
        }
    }

    /// Does something with one simulation. A panic has it brought back, and harms no other.
    pub(crate) fn guard<T>(
        &mut self,
        key: u64,
        act: impl FnOnce(&mut Simulation) -> T,
    ) -> Option<T> {
        if self.fallen.contains(&key) {
            return None;
        }
        let simulation = self.simulations.get_mut(&key)?;
        let value = caught(|| act(simulation));
        if value.is_none() {
            self.fell(key);
        }
        value
    }

    /// Sees to it that a session in which something panicked is brought back.
    pub(crate) fn fell(&mut self, key: u64) {
        let Some(simulation) = self.simulations.get(&key) else { return };
        let id = simulation.session.id.clone();
        if self.coming.contains_key(&key) {
            error!(session = id, "bringing this session back panicked; it is set aside");
            let why = SessionError::Internal(format!("session '{id}' failed"));
            self.give_up_coming(key, &why);
            self.remove(key, &why);
        } else {
            error!(session = id, "handling this session panicked; it is brought back");
            self.simulations.set_active(key, false);
            self.fallen.push(key);
        }
    }
}
