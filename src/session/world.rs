//! The thread that owns the device and every snowpack on it.
//!
//! Requests reach it through a bounded channel, each with a channel for its answer. It works in
//! frames: it takes in what has arrived, submits one frame for all sessions that have something to
//! do, waits for its outcome, publishes and answers. Ticks fall on a beat of 60 frames a second;
//! frames between beats carry out requests at once.

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
mod marks;
mod requests;
mod simulations;
mod slots;
mod storage;
mod supervise;
mod upkeep;

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use firn_engine::frame::{Backend, EngineError};
use tokio::sync::mpsc;
use tracing::{info, warn};

use crate::machine;
use crate::store::{Damage, Loaded};

use super::handle::Session;
use super::journal::{self, Assembled, Journal, Record, SEQ_RESERVE, Stored, Workers};
use super::message::Message;
use super::names::Names;
use super::once::{Answered, Done};
use super::pace::Pace;
use super::registry::{DECODED_AT_ONCE, Sessions};
use super::spec::Limits;
use super::vitals::Vitals;
use back::Coming;
use backoff::Backoff;
use begin::Beginning;
use deadlines::Deadlines;
use engine::Engine;
use simulations::Simulations;
use slots::Slots;
use storage::Storage;

pub(super) use back::Read;

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
        let Loaded { rows, next_key, clock: store_clock, damage } = durability.store.load()?;
        let Assembled { sessions: stored, broken, frame } = journal::assemble(rows);
        let lost = tell_of_damage(damage.as_ref(), &broken, &stored, durability.accept_loss)?;
        durability.store.take_over()?;
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
        let sessions = Sessions::new(
            names.clone(),
            send.clone(),
            vitals.clone(),
            frames.clone(),
            answered.clone(),
            config.limits,
            backend.maker(),
        );
        sessions.keys.store(next_key, Ordering::Relaxed);
        let mut jump = [0; 8];
        machine::fill(&mut jump).map_err(std::io::Error::other)?;
        let jump = u64::from_le_bytes(jump) % SEQ_RESERVE;
        let (records, coming) = come_back(&sessions, stored, frame, jump);
        // The runtime waits for a request or for the next beat, whatever comes first, and decodes what is
        // stored of sessions that are woken.
        let clock = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .max_blocking_threads(DECODED_AT_ONCE)
            .build()?;
        let (nudge, ages) = (send.downgrade(), ages(&records));
        let (journal, workers) =
            Journal::new(durability.store, answered.clone(), vitals.store.clone(), nudge, ages);
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

/// Sessions that outlived the last stop, as they were in the last `frame`, with mirrors that go on
/// where they were, but for their seqs: `jump` keeps those apart from the seqs of another server
/// that began with the same file.
fn come_back(
    sessions: &Sessions,
    stored: BTreeMap<u64, Stored>,
    frame: u64,
    jump: u64,
) -> (BTreeMap<u64, Record>, BTreeMap<u64, Coming>) {
    if !stored.is_empty() {
        info!("bringing back {} sessions", stored.len());
    }
    let mut coming = BTreeMap::new();
    let mut records = BTreeMap::new();
    for (key, mut stored) in stored {
        let checkpoint = stored.checkpoint.clone();
        let published = stored.mark.seq.max(checkpoint.as_ref().map_or(1, |saved| saved.seq));
        let seq = published + SEQ_RESERVE + jump;
        stored.mark.lose(published + 1, seq);
        stored.mark.seq = seq;
        stored.mark.stop_at(frame);
        let identity = (*stored.identity).clone();
        let origin = stored.origin.clone();
        let session = match Session::identified(sessions, key, identity, origin) {
            Ok(session) => session,
            Err(why) => {
                warn!(
                    "session '{}' stays stored and is not brought back: {why}",
                    stored.identity.id
                );
                sessions.vitals().store.lost(1);
                continue;
            }
        };
        let first = stored.pause();
        if stored.lock.is_some() {
            session.set_locked(true);
            warn!(
                "session '{}' may have been deleted, as the store was damaged or a deletion was cut off: \
                 it is paused and locked until an administrator unlocks or deletes it",
                session.id
            );
            sessions.vitals().store.note_revived();
        }
        session.go_on_from(seq, checkpoint.as_ref().map(|saved| &saved.versions[..]));
        session.set_lost_seqs(&stored.mark.lost);
        stored.weigh();
        records.insert(key, Record::of(stored.clone(), session.receipts.clone()));
        coming.insert(key, Coming::at_start(Arc::new(session), stored, first));
    }
    (records, coming)
}

/// Requests that carried a key, of all sessions, the oldest first.
fn ages(records: &BTreeMap<u64, Record>) -> Vec<(u64, Arc<Done>)> {
    let done = |(&key, record): (&u64, &Record)| {
        record.stored.done.iter().map(|done| (key, done.clone())).collect::<Vec<_>>()
    };
    let mut ages: Vec<(u64, Arc<Done>)> = records.iter().flat_map(done).collect();
    ages.sort_by_key(|(_, done)| (done.at_ms, done.key));
    ages
}
