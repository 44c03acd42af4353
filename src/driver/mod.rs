//! What drives the [core](crate::core): a thread with the clock, the channel, the device and the journal. It
//! tells the core what has happened, and carries out what it wants done.
//!
//! Requests reach it through a bounded channel, each with a channel for its answer. It works in
//! frames: it takes in what has arrived, submits one frame for all sessions that have something to
//! do, waits for its outcome, publishes and answers. Ticks fall on a beat of 60 frames a second;
//! frames between beats carry out requests at once.

mod begin;
mod durability;
mod effects;
mod manual;
mod pace;
mod thread;

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use firn_engine::frame::{Backend, EngineError};
use firn_engine::parallel::Executor;
use firn_engine::reserve::ask_for;
use tokio::sync::mpsc;

use crate::core::vitals::Vitals;
use crate::core::world::Setup;
use crate::core::{Input, Now, World};
use crate::journal::keyed::KeyedRequests;
use crate::journal::{Journal, Workers};
use crate::machine;
use crate::session::Names;
use crate::session::registry::{DECODED_AT_ONCE, Sessions};

use begin::{Outlived, bring_back, fingerprint, read_store};
use pace::Pace;
use thread::Thread;

pub use crate::core::{Fault, WorldConfig};
pub use durability::{Durability, OpenBackend, StartError};
pub use manual::{ManualJournal, ManualWorld};

/// Requests that may wait for the next frame before senders have to: no session has so many.
const INBOX: usize = 1 << 16;

/// The running world. Dropping it leaves the thread running; [`Driver::stop`] ends it.
#[derive(Debug)]
pub struct Driver {
    inbox: mpsc::Sender<Input>,
    thread: JoinHandle<()>,
}

/// Time in which a world that is stopped without further notice writes its checkpoints.
const STOP_TIME: Duration = Duration::from_secs(10);

impl Driver {
    /// Starts the world's thread on a backend. Nothing outlives it, nor the backend.
    ///
    /// # Errors
    /// Where the operating system refuses a thread.
    pub fn start(
        backend: Box<dyn Backend + Send>,
        config: WorldConfig,
    ) -> std::io::Result<(Sessions, Driver)> {
        let gone = || EngineError::DeviceFailed("there is no other device".to_owned());
        let mut only = Some(backend);
        let open: OpenBackend = Box::new(move || only.take().ok_or_else(gone));
        Driver::open(open, config, Durability::ephemeral()).map_err(|error| match error {
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
    ) -> Result<(Sessions, Driver), StartError> {
        let (sessions, mut world, workers) =
            Driver::prepare(open, config, durability, Executor::Threads)?;
        world.journal.start(workers)?;
        let inbox = sessions.world.clone();
        let thread =
            std::thread::Builder::new().name("world".to_owned()).spawn(move || world.run())?;
        Ok((sessions, Driver { inbox, thread }))
    }

    /// Everything but the threads.
    ///
    /// # Errors
    /// As [`Driver::open`].
    fn prepare(
        mut open: OpenBackend,
        config: WorldConfig,
        mut durability: Durability,
        executor: Executor,
    ) -> Result<(Sessions, Thread, Workers), StartError> {
        let backend = open()?;
        let Outlived { sessions: stored, heartbeat, next_key, clock, lost, damaged } =
            read_store(&mut durability)?;
        let (send, inbox) = mpsc::channel(INBOX);
        let names = Arc::new(Names::default());
        let frames = Arc::new(AtomicU64::new(heartbeat.frame));
        let vitals = Arc::new(Vitals::new(backend.device().clone(), backend.memory()));
        vitals.recovered.store(stored.is_empty(), Ordering::Relaxed);
        vitals.store.lost(lost);
        if damaged {
            vitals.store.damaged();
        }
        let keyed = Arc::new(KeyedRequests::by(clock.clone()));
        let mut sessions = Sessions::new(
            names.clone(),
            send.clone(),
            vitals.clone(),
            frames.clone(),
            keyed.clone(),
            config.limits,
            backend.maker(),
        );
        sessions.keys.store(next_key, Ordering::Relaxed);
        let mailbox = send.downgrade();
        let (journal, workers) =
            Journal::new(durability.store, keyed.clone(), vitals.store.clone(), mailbox.clone());
        sessions.store = journal.keeper();
        let adapter = fingerprint(backend.device());
        let (records, coming) = bring_back(&sessions, stored, heartbeat, adapter);
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .max_blocking_threads(DECODED_AT_ONCE)
            .build()?;
        let world = World::new(Setup {
            now: Now { instant: machine::now(), stored: clock.now() },
            executor,
            has_memory: |bytes| ask_for(bytes).is_ok(),
            config,
            checkpoint_interval: durability.checkpoint_interval,
            durable: journal.durable,
            names,
            vitals: vitals.clone(),
            frames,
            adapter,
            heartbeat,
            coming,
            records,
        });
        let thread = Thread {
            world,
            backend,
            open,
            inbox,
            mailbox,
            runtime,
            journal,
            journal_died: false,
            keyed,
            clock,
            vitals,
            pace: Pace::default(),
            next_beat: machine::now(),
            inputs: VecDeque::new(),
            effects: VecDeque::new(),
            outcome: None,
            end: None,
        };
        Ok((sessions, thread, workers))
    }

    /// Ends the thread after the frame under way, and writes what is left to be written.
    pub fn stop(self) {
        self.stop_by(machine::now() + STOP_TIME);
    }

    /// As [`Driver::stop`], beginning no checkpoint after a deadline: what they would hold is in
    /// the journal too, and the next start takes longer.
    pub fn stop_by(self, deadline: Instant) {
        // It may have ended by itself.
        let _ = self.inbox.blocking_send(Input::Stop(deadline));
        let _ = self.thread.join();
    }
}
