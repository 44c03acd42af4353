//! The world's end of the journal, and what it shares with the threads behind it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use tokio::sync::mpsc::WeakSender;
use tracing::{error, warn};

use crate::machine;
use crate::session::error::SessionError;
use crate::session::message::Message;
use crate::session::once::{Answered, Done};
use crate::store::{Store, StoreError};
use crate::threads::{self, Priority};

use super::image::{Image, Stored, Submission};
use super::writer::Writer;
use super::{Ack, Checkpoint, Heartbeat, Record, StoreVitals, Taken};

/// Longer than anybody waits.
const FOREVER: Duration = Duration::from_secs(1 << 30);

/// Submissions that may wait; beyond them changes are refused.
const LONGEST_BACKLOG: usize = 65_536;

/// What the world is told.
pub(crate) enum Feedback {
    /// Something of these sessions was not made durable: they have to go back to what is. Then
    /// whoever waits is refused.
    Undo { keys: Vec<u64>, refused: Vec<Ack>, why: SessionError },
    /// What came of a checkpoint.
    Checkpoint { key: u64, generation: u64, stored: bool },
    /// Whether a session is no longer stored.
    Deleted { key: u64, result: Result<(), SessionError> },
}

pub(super) enum Task {
    /// With how far the world has come after all of it.
    Commit(Vec<Submission>, Option<Heartbeat>),
    Flush(mpsc::Sender<()>),
}

struct Job {
    key: u64,
    generation: u64,
    base: u64,
    taken: Box<Taken>,
}

/// What the threads and the world share.
pub(super) struct Shared {
    pub image: Mutex<Image>,
    /// Why the store can't be written to.
    pub failure: Mutex<Option<StoreError>>,
    pub backlog: AtomicUsize,
    pub answered: Arc<Answered>,
    pub vitals: Arc<StoreVitals>,
}

/// The world's end of the journal.
pub(crate) struct Journal {
    tasks: Option<mpsc::Sender<Task>>,
    jobs: Option<mpsc::Sender<Job>>,
    feedback: mpsc::Receiver<Feedback>,
    shared: Arc<Shared>,
    /// Empty where somebody else has the workers: then nothing tells whether they live.
    threads: Vec<JoinHandle<()>>,
    /// What this frame has left.
    frame: Vec<Submission>,
    /// Snapshots that it has left.
    snapshots: Vec<Job>,
    heartbeat: Option<Heartbeat>,
    /// Whether what is committed outlives the process.
    pub durable: bool,
}

impl Journal {
    /// A journal, and the workers behind it. `nudge` is woken when there is something to be told.
    pub fn new(
        store: Box<dyn Store>,
        image: Image,
        answered: Arc<Answered>,
        vitals: Arc<StoreVitals>,
        nudge: WeakSender<Message>,
    ) -> (Journal, Workers) {
        let durable = store.is_durable();
        let mut ages: Vec<(u64, Arc<Done>)> = Vec::new();
        for (&key, stored) in &image {
            ages.extend(stored.done.iter().map(|done| (key, done.clone())));
        }
        ages.sort_by_key(|(_, done)| (done.at_ms, done.key));
        if let Some((_, newest)) = ages.last() {
            answered.go_on_from(newest);
        }
        ages.iter().for_each(|(_, done)| answered.note(done.clone()));
        let shared = Arc::new(Shared {
            answered,
            vitals,
            image: Mutex::new(image),
            failure: Mutex::new(None),
            backlog: AtomicUsize::new(0),
        });
        let (tasks, incoming) = mpsc::channel();
        let (tell, feedback) = mpsc::channel();
        let (jobs, to_encode) = mpsc::channel();
        let writer = Writer::new(store, shared.clone(), ages, incoming, tell, nudge);
        let packer = Packer { jobs: to_encode, tasks: tasks.clone(), shared: shared.clone() };
        let journal = Journal {
            tasks: Some(tasks),
            jobs: Some(jobs),
            feedback,
            shared,
            threads: Vec::new(),
            frame: Vec::new(),
            snapshots: Vec::new(),
            heartbeat: None,
            durable,
        };
        (journal, Workers { writer, packer })
    }

    /// Gives the workers threads of their own.
    ///
    /// # Errors
    /// Where the operating system refuses one.
    pub fn start(&mut self, workers: Workers) -> std::io::Result<()> {
        let Workers { writer, packer } = workers;
        self.threads.push(spawn("store", move || writer.run())?);
        self.threads.push(spawn("checkpoints", move || packer.run())?);
        Ok(())
    }

    /// Adds to what this frame has left.
    pub fn add(&mut self, submission: Submission) {
        self.frame.push(submission);
    }

    /// Adds that the world has come to a frame, and with it every session at rest.
    pub fn beat(&mut self, frame: u64) {
        self.heartbeat = Some(Heartbeat { frame });
    }

    /// Hands over what this frame has left, to be committed together. Snapshots follow the entries
    /// that they hold.
    pub fn send(&mut self) {
        if !self.frame.is_empty() || self.heartbeat.is_some() {
            let frame = std::mem::take(&mut self.frame);
            self.shared.backlog.fetch_add(frame.len(), Ordering::Relaxed);
            let task = Task::Commit(frame, self.heartbeat.take());
            if let Some(tasks) = &self.tasks
                && let Err(mpsc::SendError(Task::Commit(frame, _))) = tasks.send(task)
            {
                refuse_all(frame, &stopped());
            }
        }
        for job in self.snapshots.drain(..) {
            if let Some(jobs) = &self.jobs {
                // The thread ends after this.
                let _ = jobs.send(job);
            }
        }
    }

    /// Gives up what this frame has left.
    pub fn abandon(&mut self, why: &SessionError) {
        refuse_all(std::mem::take(&mut self.frame), why);
        self.snapshots.clear();
        self.heartbeat = None;
    }

    /// Adds a snapshot, to be made a checkpoint that holds all entries below `base`.
    pub fn checkpoint(&mut self, key: u64, generation: u64, base: u64, taken: Box<Taken>) {
        self.snapshots.push(Job { key, generation, base, taken });
    }

    /// Waits until everything handed over so far is durable or refused.
    pub fn flush(&mut self) {
        self.send();
        let (done, wait) = mpsc::channel();
        if let Some(tasks) = &self.tasks
            && tasks.send(Task::Flush(done)).is_ok()
        {
            // An error means that the thread has ended.
            let _ = machine::receive(&wait, FOREVER);
        }
    }

    /// What the world is to be told, if anything.
    pub fn told(&self) -> Option<Feedback> {
        self.feedback.try_recv().ok()
    }

    /// Waits for what the world is to be told.
    pub fn wait(&self, patience: Duration) -> Option<Feedback> {
        machine::receive(&self.feedback, patience).ok()
    }

    /// What is durable of a session, for a new life of it: what the old one submitted is void. It
    /// begins at a tick, or later where that is durable, and its time stands still until then.
    pub fn new_life(&self, key: u64, tick: u64) -> Option<Stored> {
        let mut image = lock(&self.shared.image);
        let stored = image.get_mut(&key)?;
        stored.generation += 1;
        stored.mark.tick = stored.mark.tick.max(tick);
        stored.mark.rest = None;
        Some(stored.clone())
    }

    /// The life that a session is in.
    pub fn generation(&self, key: u64) -> u64 {
        lock(&self.shared.image).get(&key).map_or(0, |stored| stored.generation)
    }

    /// Number of the first entry of a session that no checkpoint holds.
    pub fn base(&self, key: u64) -> u64 {
        lock(&self.shared.image).get(&key).map_or(0, Stored::base)
    }

    /// Why changes can't be taken now, if they can't.
    pub fn refusal(&self) -> Option<SessionError> {
        if self.threads.iter().any(JoinHandle::is_finished) {
            self.shared.vitals.set_healthy(false);
            return Some(stopped());
        }
        if let Some(failure) = &*lock(&self.shared.failure) {
            return Some(unstorable(failure));
        }
        let backlog = self.shared.backlog.load(Ordering::Relaxed);
        (backlog > LONGEST_BACKLOG).then(|| {
            SessionError::Unavailable(format!("{backlog} changes wait for the disk already"))
        })
    }

    /// Commits what has been handed over, and ends the threads.
    pub fn stop(&mut self) {
        self.send();
        self.jobs = None;
        self.tasks = None;
        for thread in self.threads.drain(..) {
            if thread.join().is_err() {
                error!("a thread of the store panicked");
            }
        }
    }
}

fn spawn(name: &str, run: impl FnOnce() + Send + 'static) -> std::io::Result<JoinHandle<()>> {
    std::thread::Builder::new().name(name.to_owned()).spawn(run)
}

/// Who works behind a journal.
pub(in crate::session) struct Workers {
    writer: Writer,
    packer: Packer,
}

impl Workers {
    /// Commits what waits for that.
    pub fn commit(&mut self) {
        self.writer.turn(None, false);
    }

    /// Makes a checkpoint, where a snapshot waits for that.
    pub fn pack(&mut self) {
        if let Ok(job) = self.packer.jobs.try_recv() {
            self.packer.pack(job);
        }
    }

    /// Does the last of it, once there will be no more.
    pub fn end(mut self) {
        while let Ok(job) = self.packer.jobs.try_recv() {
            self.packer.pack(job);
        }
        while let Ok(task) = self.writer.next() {
            self.writer.turn(Some(task), false);
        }
        self.writer.turn(None, true);
    }
}

/// Makes checkpoints of snapshots.
struct Packer {
    jobs: mpsc::Receiver<Job>,
    tasks: mpsc::Sender<Task>,
    shared: Arc<Shared>,
}

impl Packer {
    /// Makes them until there will be no more.
    fn run(&self) {
        threads::give_way(Priority::Lowest);
        while let Ok(job) = self.jobs.recv() {
            self.pack(job);
        }
    }

    fn pack(&self, job: Job) {
        let Job { key, generation, base, taken } = job;
        // The entries that it replaces are worth more than one that can't be read.
        let made = || taken.snapshot.check_mass().and_then(|()| taken.snapshot.encode());
        let encoded = catch_unwind(AssertUnwindSafe(made));
        let panicked = || Err(SessionError::Internal("making it panicked".to_owned()));
        let records = match encoded.unwrap_or_else(|_| panicked()) {
            Ok(snapshot) => {
                let Taken { seq, versions, .. } = *taken;
                vec![Record::Checkpoint(Arc::new(Checkpoint { base, seq, versions, snapshot }))]
            }
            Err(failure) => {
                warn!("a checkpoint could not be made: {failure}");
                Vec::new()
            }
        };
        let submission = Submission { key, generation, records, acks: Vec::new() };
        self.shared.backlog.fetch_add(1, Ordering::Relaxed);
        // Nobody is left to take it where this fails.
        let _ = self.tasks.send(Task::Commit(vec![submission], None));
    }
}

pub(super) fn refuse(acks: Vec<Ack>, why: &SessionError) {
    acks.into_iter().for_each(|ack| ack(Err(why.clone())));
}

fn refuse_all(batch: Vec<Submission>, why: &SessionError) {
    batch.into_iter().for_each(|submission| refuse(submission.acks, why));
}

pub(super) fn unstorable(failure: &StoreError) -> SessionError {
    match failure {
        StoreError::Failed(why) => SessionError::StorageFailed(format!(
            "the change was not made: it can't be stored ({why}); it can be tried again once the \
             data directory can be written to and has room"
        )),
        StoreError::Gone(why) => SessionError::StorageGone(format!(
            "the change was not made, because the next start would not find it: {why}"
        )),
    }
}

fn stopped() -> SessionError {
    SessionError::Unavailable("changes can't be stored any more: only a restart helps".to_owned())
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Only whole submissions are entered: one left by a panic is still sound.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
