//! The thread that owns the device and every snowpack on it.
//!
//! Requests reach it through a bounded channel, each with a channel for its answer. It works in
//! frames: it takes in what has arrived, submits one frame for all sessions that have something to
//! do, waits for its outcome, publishes and answers. Ticks fall on a beat of 60 frames a second;
//! frames between beats carry out requests at once.

mod deadlines;
mod durability;
mod engine;
mod finish;
mod frame;
mod marks;
mod requests;
mod revive;
mod simulations;
mod slots;
mod supervise;
mod upkeep;

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::sync::mpsc;
use tracing::{info, warn};

use crate::engine::frame::{Backend, EngineError};

use super::handle::Session;
use super::journal::{self, Assembled, Journal, SEQ_RESERVE, Stored};
use super::message::Message;
use super::names::Names;
use super::once::Answered;
use super::pace::Pace;
use super::registry::Sessions;
use super::spec::Limits;
use super::vitals::Vitals;
use deadlines::Deadlines;
use engine::Engine;
use revive::Revival;
use simulations::Simulations;
use slots::Slots;

pub use durability::{Durability, Fault, OpenBackend, StartError};

/// Requests that may wait for the next frame before senders have to.
const INBOX: usize = 4096;

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
        mut open: OpenBackend,
        config: WorldConfig,
        mut durability: Durability,
    ) -> Result<(Sessions, World), StartError> {
        let backend = open()?;
        let loaded = durability.store.load()?;
        if let Some(damage) = &loaded.damage {
            warn!("the store was damaged: {damage}; its newest changes may be missing");
        }
        let Assembled { sessions: stored, broken, frame, next_key } =
            journal::assemble(loaded.rows);
        for what in &broken {
            warn!("can't be brought back: {what}");
        }
        let (send, inbox) = mpsc::channel(INBOX);
        let names = Arc::new(Names::default());
        let frames = Arc::new(AtomicU64::new(frame));
        let vitals = Arc::new(Vitals::new(backend.device().clone(), backend.memory()));
        vitals.recovered.store(stored.is_empty(), Ordering::Relaxed);
        vitals.store.lost(broken.len());
        let answered = Arc::<Answered>::default();
        let sessions = Sessions::new(
            names.clone(),
            send.clone(),
            vitals.clone(),
            frames.clone(),
            answered.clone(),
            config.limits,
        );
        sessions.keys.store(next_key, Ordering::Relaxed);
        let jump = u64::from(getrandom::u32().map_err(std::io::Error::other)?) % SEQ_RESERVE;
        let (image, comebacks) = come_back(&sessions, stored, frame, jump);
        // The runtime only waits: for a request or for the next beat, whatever comes first.
        let clock = tokio::runtime::Builder::new_current_thread().enable_time().build()?;
        let journal = Journal::start(
            durability.store,
            image,
            answered,
            vitals.store.clone(),
            send.downgrade(),
        )?;
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
            full: false,
            looked_after: frame,
            next_beat: Instant::now(),
            pace: Pace::default(),
            simulations: Simulations::default(),
            busy: false,
            ends: Deadlines::default(),
            saves: Deadlines::default(),
            hibernating: HashMap::new(),
            leaving: HashMap::new(),
            slots: Slots::default(),
            object_rows: Arc::default(),
            journal,
            comebacks,
            reviving: false,
            fallen: Vec::new(),
            checkpointing: None,
            stop: None,
        };
        let thread = std::thread::Builder::new()
            .name("world".to_owned())
            .spawn(move || engine.supervise())?;
        Ok((sessions, World { inbox: send, thread }))
    }

    /// Ends the thread after the frame under way, and writes what is left to be written.
    pub fn stop(self) {
        self.stop_by(Instant::now() + STOP_TIME);
    }

    /// As [`World::stop`], beginning no checkpoint after a deadline: what they would hold is in
    /// the journal too, and the next start takes longer.
    pub fn stop_by(self, deadline: Instant) {
        // It may have ended by itself.
        let _ = self.inbox.blocking_send(Message::Stop(deadline));
        let _ = self.thread.join();
    }
}

/// Sessions that outlived the last stop, as they were in the last `frame`, with mirrors that go on
/// where they were, but for their seqs: `jump` keeps those apart from the seqs of another server
/// that began with the same file.
fn come_back(
    sessions: &Sessions,
    stored: BTreeMap<u64, Stored>,
    frame: u64,
    jump: u64,
) -> (HashMap<u64, Stored>, BTreeMap<u64, Revival>) {
    if !stored.is_empty() {
        info!("bringing back {} sessions", stored.len());
    }
    let mut comebacks = BTreeMap::new();
    let mut image = HashMap::new();
    for (key, mut stored) in stored {
        let checkpoint = stored.checkpoint.clone();
        let published = stored.mark.seq.max(checkpoint.as_ref().map_or(1, |saved| saved.seq));
        let seq = published + SEQ_RESERVE + jump;
        stored.mark.lose(published + 1, seq);
        stored.mark.seq = seq;
        stored.mark.stop_at(frame);
        let identity = (*stored.identity).clone();
        let session = Session::identified(sessions, key, identity, stored.origin.clone());
        session.go_on_from(seq, checkpoint.as_ref().map(|saved| &saved.versions[..]));
        session.set_lost_seqs(&stored.mark.lost);
        image.insert(key, stored.clone());
        comebacks.insert(key, Revival::at_start(Arc::new(session), stored));
    }
    (image, comebacks)
}
