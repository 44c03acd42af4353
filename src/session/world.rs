//! The thread that owns the device and every snowpack on it.
//!
//! Requests reach it through a bounded channel, each with a channel for its answer. It works in
//! frames: it takes in what has arrived, submits one frame for all sessions that have something to
//! do, waits for its outcome, publishes and answers. Ticks fall on a beat of 60 frames a second;
//! frames between beats carry out requests at once.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::sync::mpsc;
use tracing::{error, warn};

use crate::engine::frame::{Backend, EngineError, Frame, Outcome, SampleBox, Slot};

use super::clock::FRAME_RATE;
use super::error::SessionError;
use super::handle::Session;
use super::message::Message;
use super::orders::{Answer, Reply};
use super::registry::{Names, Sessions};
use super::simulation::Simulation;
use super::snapshot::Snapshot;
use super::spec::Limits;
use super::vitals::Vitals;

/// Requests that may wait for the next frame before senders have to.
const INBOX: usize = 4096;

/// Longest wait for the device at a time.
const PATIENCE: Duration = Duration::from_millis(100);

/// How the world works.
#[derive(Clone, Copy, Debug)]
pub struct WorldConfig {
    /// Limits of what the server holds.
    pub limits: Limits,
    /// Publications per second \[Hz\], beside those that requests ask for; at most 60.
    pub publish_rate: f64,
    /// Whether snow at rest is left alone. It makes no difference to any result.
    pub sleep: bool,
}

/// The running world. Dropping it leaves the thread running; [`World::stop`] ends it.
#[derive(Debug)]
pub struct World {
    inbox: mpsc::Sender<Message>,
    thread: JoinHandle<()>,
}

impl World {
    /// Starts the world's thread on a backend.
    ///
    /// # Errors
    /// Where the operating system refuses a thread.
    pub fn start(
        backend: Box<dyn Backend + Send>,
        config: WorldConfig,
    ) -> std::io::Result<(Sessions, World)> {
        let (send, inbox) = mpsc::channel(INBOX);
        let names = Arc::new(Names::default());
        let frames = Arc::new(AtomicU64::new(0));
        let vitals = Arc::new(Vitals {
            device: backend.device().clone(),
            healthy: AtomicBool::new(true),
            memory: AtomicU64::new(backend.memory()),
            slipped_us: AtomicU64::new(0),
        });
        let sessions = Sessions::new(
            names.clone(),
            send.clone(),
            vitals.clone(),
            frames.clone(),
            config.limits,
        );
        // The runtime only waits: for a request or for the next beat, whatever comes first.
        let clock = tokio::runtime::Builder::new_current_thread().enable_time().build()?;
        let mut engine = Engine {
            backend,
            config,
            inbox,
            clock,
            names,
            vitals: vitals.clone(),
            frames,
            frame: 0,
            next_beat: Instant::now(),
            simulations: HashMap::new(),
            active: HashSet::new(),
            slots: Slots::default(),
        };
        let thread = std::thread::Builder::new().name("world".to_owned()).spawn(move || {
            let end = catch_unwind(AssertUnwindSafe(|| engine.run()));
            vitals.healthy.store(false, Ordering::Relaxed);
            match end {
                Ok(Ok(())) => {}
                Ok(Err(failure)) => error!("{failure}; all sessions are lost"),
                Err(_) => error!("the engine panicked; all sessions are lost"),
            }
        })?;
        Ok((sessions, World { inbox: send, thread }))
    }

    /// Ends the thread after the frame under way.
    pub fn stop(self) {
        // It may have ended by itself.
        let _ = self.inbox.blocking_send(Message::Stop);
        let _ = self.thread.join();
    }
}

/// Rows of the backend's tables, lowest free one first.
#[derive(Debug, Default)]
struct Slots {
    free: BTreeSet<Slot>,
    next: Slot,
}

impl Slots {
    fn take(&mut self) -> Slot {
        self.free.pop_first().unwrap_or_else(|| {
            self.next += 1;
            self.next - 1
        })
    }

    fn give_back(&mut self, slot: Slot) {
        self.free.insert(slot);
    }
}

/// What lives on the world's thread.
struct Engine {
    backend: Box<dyn Backend + Send>,
    config: WorldConfig,
    inbox: mpsc::Receiver<Message>,
    clock: tokio::runtime::Runtime,
    names: Arc<Names>,
    vitals: Arc<Vitals>,
    frames: Arc<AtomicU64>,
    frame: u64,
    next_beat: Instant,
    simulations: HashMap<u64, Simulation>,
    /// Keys of the simulations that want to be in the coming frames.
    active: HashSet<u64>,
    slots: Slots,
}

impl Engine {
    fn run(&mut self) -> Result<(), EngineError> {
        loop {
            if !self.take_messages() {
                return Ok(());
            }
            let publish = self.beat();
            self.carry_out_frame(publish)?;
        }
    }

    /// Waits for a request or the next beat, and takes in what has arrived. False means stop.
    fn take_messages(&mut self) -> bool {
        let busy = self.active.iter().any(|key| self.simulations[key].has_orders());
        if !busy {
            let deadline = tokio::time::Instant::from_std(self.next_beat);
            let inbox = &mut self.inbox;
            let wait = async { tokio::time::timeout_at(deadline, inbox.recv()).await };
            match self.clock.block_on(wait) {
                Ok(Some(message)) => {
                    if !self.take_message(message) {
                        return false;
                    }
                }
                Ok(None) => return false,
                Err(_) => {}
            }
        }
        // No more than one inbox full at a time, so that beats are not missed.
        for _ in 0..INBOX {
            match self.inbox.try_recv() {
                Ok(message) => {
                    if !self.take_message(message) {
                        return false;
                    }
                }
                Err(mpsc::error::TryRecvError::Empty) => break,
                Err(mpsc::error::TryRecvError::Disconnected) => return false,
            }
        }
        true
    }

    /// Counts the frame where one is due. Returns whether publications are due with it.
    fn beat(&mut self) -> bool {
        let now = Instant::now();
        if now < self.next_beat {
            return false;
        }
        self.frame += 1;
        self.frames.store(self.frame, Ordering::Relaxed);
        self.next_beat += Duration::from_secs_f64(1.0 / FRAME_RATE);
        if self.next_beat < now {
            // The machine can't keep up, or has just begun: time slips, ticks don't pile up.
            let slipped = (now - self.next_beat).as_micros() as u64;
            self.vitals.slipped_us.fetch_add(slipped, Ordering::Relaxed);
            self.next_beat = now;
        }
        let publications =
            |frame: u64| (frame as f64 * self.config.publish_rate / FRAME_RATE + 1e-9) as u64;
        publications(self.frame) > publications(self.frame - 1)
    }

    /// Submits one frame for everybody who has something to do, and concludes it.
    fn carry_out_frame(&mut self, publish: bool) -> Result<(), EngineError> {
        let (number, sleep) = (self.frame, self.config.sleep);
        let mut frame = Frame::default();
        let mut keys = Vec::new();
        let active: Vec<u64> = self.active.iter().copied().collect();
        for key in active {
            let plan = self.guard(key, |simulation| simulation.plan(number, publish, sleep));
            if let Some(work) = plan.flatten() {
                frame.work.push(work);
                keys.push(key);
            } else {
                self.review(key);
            }
        }
        if keys.is_empty() {
            return Ok(());
        }
        let begun = Instant::now();
        self.backend.submit(frame)?;
        let outcome = loop {
            if let Some(outcome) = self.backend.poll(PATIENCE)? {
                break outcome;
            }
        };
        let took = begun.elapsed();
        self.conclude(&keys, outcome, took);
        Ok(())
    }

    fn conclude(&mut self, keys: &[u64], mut outcome: Outcome, took: Duration) {
        outcome.tiles.sort_unstable_by_key(|tile| (tile.slot, tile.tile));
        for (&key, work) in keys.iter().zip(outcome.work) {
            let first = outcome.tiles.partition_point(|tile| tile.slot < work.slot);
            let end = outcome.tiles.partition_point(|tile| tile.slot <= work.slot);
            let tiles = &outcome.tiles[first..end];
            self.guard(key, |simulation| {
                if let Some(job) = &mut simulation.step {
                    job.fit(took);
                }
                simulation.conclude(work, tiles);
            });
            self.review(key);
        }
        self.vitals.memory.store(self.backend.memory(), Ordering::Relaxed);
    }

    /// Keeps a simulation among the active ones where it has more to do.
    fn review(&mut self, key: u64) {
        match self.simulations.get(&key) {
            Some(simulation) if simulation.wants_frames() => self.active.insert(key),
            _ => self.active.remove(&key),
        };
    }

    /// Does something with one simulation. A panic ends that session and no other.
    fn guard<T>(&mut self, key: u64, act: impl FnOnce(&mut Simulation) -> T) -> Option<T> {
        let simulation = self.simulations.get_mut(&key)?;
        match catch_unwind(AssertUnwindSafe(|| act(simulation))) {
            Ok(value) => Some(value),
            Err(_) => {
                let id = simulation.session.id.clone();
                error!(session = id, "handling this session panicked; it is ended");
                self.remove(key, &SessionError::Internal(format!("session '{id}' failed")));
                None
            }
        }
    }

    fn take_message(&mut self, message: Message) -> bool {
        match message {
            Message::Create { session, saved, reply } => self.create(session, saved, reply),
            Message::Delete { key, reply } => {
                let result = self.with(key, |_| ()).map(|()| {
                    let deleted = SessionError::NotFound {
                        kind: "session",
                        id: self.simulations[&key].session.id.clone(),
                    };
                    self.remove(key, &deleted);
                });
                // Here and below: whoever has gone away needs no answer.
                drop(reply.send(result));
            }
            Message::Change { key, change, reply } => {
                let most = self.config.limits.colliders_per_session;
                self.order(key, reply, |sim, reply| sim.change(change, most, reply));
            }
            Message::Step { key, step, reply } => {
                self.order(key, reply, |sim, reply| sim.begin_step(&step, reply));
            }
            Message::Reset { key, saved, reply } => {
                self.order(key, reply, |sim, reply| sim.begin_reset(saved.as_deref(), reply));
            }
            Message::Snapshot { key, reply } => {
                self.order(key, reply, |sim, reply| sim.next.snapshots.push(reply));
            }
            Message::Gather { key, tiles, reply } => {
                self.order(key, reply, |sim, reply| sim.next.gathers.push((tiles, reply)));
            }
            Message::Sample { key, columns, y0, height, reply } => {
                self.order(key, reply, |sim, reply| {
                    let dt = sim.cycle_length();
                    sim.next.samples.push((SampleBox { columns, y0, height, dt }, reply));
                });
            }
            Message::Mass { key, reply } => {
                self.order(key, reply, |sim, reply| sim.next.tallies.push(reply));
            }
            Message::Inspect { key, look, reply } => {
                let result = self.with(key, |simulation| look(simulation));
                drop(reply.send(result));
            }
            Message::Stop => return false,
        }
        true
    }

    fn create(&mut self, session: Arc<Session>, saved: Option<Box<Snapshot>>, reply: Answer<()>) {
        let slot = self.slots.take();
        let layout = Simulation::layout(&session.spec);
        if let Err(failure) = self.backend.create(slot, &layout) {
            self.slots.give_back(slot);
            let refused = match failure {
                EngineError::OutOfMemory(_) => SessionError::OutOfMemory(failure.to_string()),
                _ => SessionError::Unavailable(failure.to_string()),
            };
            warn!(session = session.id, "not created: {failure}");
            drop(reply.send(Err(refused)));
            return;
        }
        let key = session.key;
        let mut simulation = Simulation::new(session, slot, self.frame);
        simulation.begin(saved.as_deref());
        simulation.next.replies.push(Reply::Created(reply));
        self.simulations.insert(key, simulation);
        self.active.insert(key);
    }

    /// Hands a request with its answer to a simulation, and sees to it that it gets a frame.
    fn order<T>(
        &mut self,
        key: u64,
        reply: Answer<T>,
        act: impl FnOnce(&mut Simulation, Answer<T>),
    ) {
        if !self.simulations.contains_key(&key) {
            drop(reply.send(Err(gone())));
            return;
        }
        let frame = self.frame;
        self.guard(key, |simulation| {
            simulation.catch_up(frame);
            act(simulation, reply);
        });
        self.review(key);
    }

    fn with<T>(
        &mut self,
        key: u64,
        act: impl FnOnce(&mut Simulation) -> T,
    ) -> Result<T, SessionError> {
        if !self.simulations.contains_key(&key) {
            return Err(gone());
        }
        self.guard(key, act)
            .ok_or_else(|| SessionError::Internal("the session failed and is ended".to_owned()))
    }

    /// Takes a session out of the world. Whoever waits for it gets `why`.
    fn remove(&mut self, key: u64, why: &SessionError) {
        self.active.remove(&key);
        let Some(simulation) = self.simulations.remove(&key) else { return };
        self.backend.release(simulation.slot);
        self.slots.give_back(simulation.slot);
        self.names.remove(&simulation.session.id);
        simulation.session.gone.cancel();
        self.vitals.memory.store(self.backend.memory(), Ordering::Relaxed);
        simulation.refuse_all(why);
    }
}

fn gone() -> SessionError {
    SessionError::NotFound { kind: "session", id: "deleted meanwhile".to_owned() }
}
