//! The thread that owns the device and every snowpack on it.
//!
//! Requests reach it through a bounded channel, each with a channel for its answer. It works in
//! frames: it takes in what has arrived, submits one frame for all sessions that have something to
//! do, waits for its outcome, publishes and answers. Ticks fall on a beat of 60 frames a second;
//! frames between beats carry out requests at once.

mod anchors;
mod back;
mod backoff;
mod begin;
mod deadlines;
mod durability;
mod engine;
mod finish;
mod frame;
mod mail;
mod manual;
mod reading;
mod requests;
mod simulations;
mod slots;
mod storage;
mod supervise;
mod upkeep;

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use firn_engine::frame::{Backend, EngineError};
use tokio::sync::mpsc;
use tracing::warn;

use crate::machine;
use crate::store::{Damage, Format, Loaded};

use super::journal::{self, Assembled, Journal, Stored, Workers};
use super::message::Message;
use super::names::Names;
use super::once::Answered;
use super::pace::Pace;
use super::registry::{DECODED_AT_ONCE, Sessions};
use super::spec::Limits;
use super::vitals::Vitals;
use backoff::Backoff;
use begin::{Beginning, ages, bring_back, fingerprint};
use deadlines::Deadlines;
use engine::Engine;
use simulations::Simulations;
use slots::Slots;
use storage::Storage;

pub(super) use reading::Read;

pub use manual::{ManualJournal, ManualWorld};

pub use durability::{Durability, Fault, OpenBackend, StartError};

/// Requests that may wait for the next frame before senders have to: no session has so many.
const INBOX: usize = 1 << 16;

/// Requests that are taken in before a frame, so that beats are not missed.
const TAKEN_AT_ONCE: usize = 4096;

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

/// Time in which a world that is stopped without further notice writes its checkpoints.
const STOP_TIME: Duration = Duration::from_secs(10);

impl World {
    /// Starts the world's thread on a backend. Nothing outlives it, nor the backend.
    ///
    /// # Errors
    /// Where the operating system refuses a thread.
    pub fn start(
        backend: Box<dyn Backend + Send>,
        config: WorldConfig,
    ) -> std::io::Result<(Sessions, World)> {
        let gone = || EngineError::DeviceFailed("there is no other device".to_owned());
        let mut only = Some(backend);
        let open: OpenBackend = Box::new(move || only.take().ok_or_else(gone));
        World::open(open, config, Durability::ephemeral()).map_err(|error| match error {
            StartError::Thread(error) => error,
            other => std::io::Error::other(other),
        })
    }

    /// Starts the world's thread on the backend that `open` opens, which it is called for again
    /// where the device is lost. Sessions that are stored come back in the background:
    /// [`Vitals::is_recovered`] says when.
    ///
    /// # Errors
    /// Where the device can't be opened, or what is stored can't be read.
    pub fn open(
        open: OpenBackend,
        config: WorldConfig,
        durability: Durability,
    ) -> Result<(Sessions, World), StartError> {
        let (sessions, mut engine, workers) = World::prepare(open, config, durability)?;
        engine.journal.start(workers)?;
        let inbox = sessions.world.clone();
        let thread = std::thread::Builder::new()
            .name("world".to_owned())
            .spawn(move || engine.supervise())?;
        Ok((sessions, World { inbox, thread }))
    }

    /// Everything but the threads.
    ///
    /// # Errors
    /// As [`World::open`].
    fn prepare(
        mut open: OpenBackend,
        config: WorldConfig,
        mut durability: Durability,
    ) -> Result<(Sessions, Engine, Workers), StartError> {
        let backend = open()?;
        let loaded = durability.store.load()?;
        let Loaded { rows, next_key, clock: store_clock, format, damage } = loaded;
        let (rows, mut broken) = match format {
            Format::First => journal::migrate(rows),
            Format::Present => (rows, Vec::new()),
        };
        // Whatever is in the file is not to be written into.
        let replacement = (format == Format::First || damage.is_some()).then(|| rows.clone());
        let Assembled { sessions: stored, broken: parted, heartbeat } = journal::assemble(rows);
        broken.extend(parted);
        let frame = heartbeat.frame;
        let lost = tell_of_damage(damage.as_ref(), &broken, &stored, durability.accept_loss)?;
        if let Some(rows) = replacement {
            durability.store.take_over(&rows)?;
        }
        let (send, inbox) = mpsc::channel(INBOX);
        let names = Arc::new(Names::default());
        let frames = Arc::new(AtomicU64::new(frame));
        let vitals = Arc::new(Vitals::new(backend.device().clone(), backend.memory()));
        vitals.recovered.store(stored.is_empty(), Ordering::Relaxed);
        vitals.store.lost(lost);
        if damage.is_some() {
            vitals.store.damaged();
        }
        let answered = Arc::new(Answered::by(store_clock));
        let mut sessions = Sessions::new(
            names.clone(),
            send.clone(),
            vitals.clone(),
            frames.clone(),
            answered.clone(),
            config.limits,
            backend.maker(),
        );
        sessions.keys.store(next_key, Ordering::Relaxed);
        let adapter = fingerprint(backend.device());
        let (records, coming) = bring_back(&sessions, stored, heartbeat, adapter);
        // The runtime waits for a request or for the next beat, whatever comes first, and decodes what is
        // stored of sessions that come back.
        let clock = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .max_blocking_threads(DECODED_AT_ONCE)
            .build()?;
        let (nudge, ages) = (send.downgrade(), ages(&records));
        let (journal, workers) =
            Journal::new(durability.store, answered.clone(), vitals.store.clone(), nudge, ages);
        sessions.store = journal.keeper();
        // Where nothing was stored nobody was ever told anything.
        let new = coming.is_empty();
        let beginning = if new { Beginning::OnDisk } else { Beginning::Unwritten };
        let engine = Engine {
            backend,
            open,
            config,
            checkpoint_interval: durability.checkpoint_interval,
            inbox,
            clock,
            names,
            vitals,
            frames,
            frame,
            round: heartbeat.round,
            adapter,
            looked_after: frame,
            next_beat: machine::now(),
            pace: Pace::default(),
            simulations: Simulations::default(),
            busy: false,
            ends: Deadlines::default(),
            saves: Deadlines::default(),
            hibernating: HashMap::new(),
            mail: BTreeMap::new(),
            queue: coming.keys().copied().collect(),
            asked: VecDeque::new(),
            coming,
            began: machine::now(),
            records,
            storage: Storage::default(),
            answered,
            slots: Slots::default(),
            object_rows: Arc::default(),
            journal,
            fallen: Vec::new(),
            checkpointing: None,
            stop: None,
            saving: false,
            backoff: Backoff::default(),
            beginning,
        };
        Ok((sessions, engine, workers))
    }

    /// Ends the thread after the frame under way, and writes what is left to be written.
    pub fn stop(self) {
        self.stop_by(machine::now() + STOP_TIME);
    }

    /// As [`World::stop`], beginning no checkpoint after a deadline: what they would hold is in
    /// the journal too, and the next start takes longer.
    pub fn stop_by(self, deadline: Instant) {
        // It may have ended by itself.
        let _ = self.inbox.blocking_send(Message::Stop(deadline));
        let _ = self.thread.join();
    }
}

/// Tells of what is lost. Returns how many sessions are.
///
/// # Errors
/// [`StartError::Lost`] where that is everything, and is not accepted.
fn tell_of_damage(
    damage: Option<&Damage>,
    broken: &[String],
    stored: &BTreeMap<u64, Stored>,
    accepted: bool,
) -> Result<usize, StartError> {
    for what in broken {
        warn!("can't be brought back: {what}");
    }
    let Some(Damage { what, missing }) = damage else { return Ok(broken.len()) };
    for key in missing {
        warn!("can't be brought back: a session of which nothing was found (key {key})");
    }
    if stored.is_empty() && !accepted {
        return Err(StartError::Lost(what.clone()));
    }
    warn!("the store: {what}; its newest changes may be missing");
    Ok(broken.len() + missing.len())
}
