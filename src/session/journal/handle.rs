//! The world's end of the journal, and who works behind it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc;
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

use super::keeper::{Errand, StoreKeeper};
use super::record::{Append, Part};
use super::writer::{Teller, Writer};
use super::{Checkpoint, Heartbeat, StoreVitals, Taken};

/// What the world is told.
pub(crate) enum Verdict {
    /// These appends, each a session and a position, are durable.
    Durable(Vec<(u64, u64)>),
    /// None of these is, nor anything that follows, until sessions are written anew.
    Failed(Vec<(u64, u64)>, StoreError),
    /// What came of writing sessions anew.
    Rewritten(Result<(), StoreError>),
    /// A checkpoint of a session in one of its lives, where it could be made.
    Packed { key: u64, life: u64, checkpoint: Option<Arc<Checkpoint>> },
}

pub(super) enum Task {
    /// With how far the world has come after all of it.
    Append(Vec<Append>, Option<Heartbeat>),
    /// Sessions that the store may hold wrongly, as they should be.
    Rewrite {
        sessions: Vec<(u64, Vec<Part>)>,
        heartbeat: Heartbeat,
        /// Rejections that the world has heard of.
        heard: u64,
    },
    /// Of an administrator, for the store as a whole.
    Errand(Errand),
}

struct Job {
    key: u64,
    life: u64,
    base: u64,
    taken: Box<Taken>,
}

/// The world's end of the journal.
pub(crate) struct Journal {
    tasks: Option<Arc<mpsc::Sender<Task>>>,
    jobs: Option<mpsc::Sender<Job>>,
    verdicts: mpsc::Receiver<Verdict>,
    /// Empty where somebody else has the workers: then nothing tells whether they live.
    threads: Vec<JoinHandle<()>>,
    /// What this frame has left.
    frame: Vec<Append>,
    /// Snapshots that it has left.
    snapshots: Vec<Job>,
    heartbeat: Option<Heartbeat>,
    /// Whether what is committed outlives the process.
    pub durable: bool,
}

impl Journal {
    /// A journal, and the workers behind it. `nudge` is woken when there is something to be told; `ages` are
    /// the requests with a key that are stored, the oldest first.
    pub fn new(
        store: Box<dyn Store>,
        answered: Arc<Answered>,
        vitals: Arc<StoreVitals>,
        nudge: WeakSender<Message>,
        ages: Vec<(u64, Arc<Done>)>,
    ) -> (Journal, Workers) {
        if let Some((_, newest)) = ages.last() {
            answered.go_on_from(newest);
        }
        ages.iter().for_each(|(_, done)| answered.note(done.clone()));
        let durable = store.is_durable();
        let (tasks, incoming) = mpsc::channel();
        let (tell, verdicts) = mpsc::channel();
        let (jobs, to_encode) = mpsc::channel();
        let teller = || Teller { tell: tell.clone(), nudge: nudge.clone() };
        let writer = Writer::new(store, incoming, teller(), answered, vitals, ages);
        let packer = Packer { jobs: to_encode, teller: teller() };
        let journal = Journal {
            tasks: Some(Arc::new(tasks)),
            jobs: Some(jobs),
            verdicts,
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

    /// What asks the store for what concerns all of it, until the journal stops.
    pub fn keeper(&self) -> StoreKeeper {
        StoreKeeper::of(self.tasks.as_ref().filter(|_| self.durable))
    }

    /// Adds to what this frame has left.
    pub fn add(&mut self, append: Append) {
        self.frame.push(append);
    }

    /// Adds how far the world has come after all that was added before, and with it every session whose ticks
    /// follow the beat.
    pub fn beat(&mut self, heartbeat: Heartbeat) {
        self.heartbeat = Some(heartbeat);
    }

    /// Hands over what this frame has left, to be committed together. Snapshots follow the entries
    /// that they hold.
    pub fn send(&mut self) {
        if !self.frame.is_empty() || self.heartbeat.is_some() {
            let frame = std::mem::take(&mut self.frame);
            let heartbeat = self.heartbeat.take();
            self.hand_over(Task::Append(frame, heartbeat));
        }
        for job in self.snapshots.drain(..) {
            if let Some(jobs) = &self.jobs {
                // The thread ends after this.
                let _ = jobs.send(job);
            }
        }
    }

    /// Has sessions written anew, with how far the world has come.
    pub fn rewrite(&mut self, sessions: Vec<(u64, Vec<Part>)>, heartbeat: Heartbeat, heard: u64) {
        self.send();
        self.hand_over(Task::Rewrite { sessions, heartbeat, heard });
    }

    fn hand_over(&self, task: Task) {
        if let Some(tasks) = &self.tasks {
            // Whether the thread is still there is asked elsewhere.
            let _ = tasks.send(task);
        }
    }

    /// Adds a snapshot, to be made a checkpoint that holds all entries below `base`.
    pub fn checkpoint(&mut self, key: u64, life: u64, base: u64, taken: Box<Taken>) {
        self.snapshots.push(Job { key, life, base, taken });
    }

    /// What the world is to be told, if anything.
    pub fn told(&self) -> Option<Verdict> {
        self.verdicts.try_recv().ok()
    }

    /// Waits for what the world is to be told.
    pub fn wait(&self, patience: Duration) -> Option<Verdict> {
        machine::receive(&self.verdicts, patience).ok()
    }

    /// Whether nobody is left who would commit anything.
    pub fn is_dead(&self) -> bool {
        self.threads.iter().any(JoinHandle::is_finished)
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
        while let Ok(task) = self.writer.next() {
            self.writer.turn(Some(task), false);
        }
        self.writer.turn(None, true);
    }
}

/// Makes checkpoints of snapshots.
struct Packer {
    jobs: mpsc::Receiver<Job>,
    teller: Teller,
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
        let Job { key, life, base, taken } = job;
        // The entries that it replaces are worth more than one that can't be read.
        let made = || taken.snapshot.check_mass().and_then(|()| taken.snapshot.encode());
        let encoded = catch_unwind(AssertUnwindSafe(made));
        let panicked = || Err(SessionError::Internal("making it panicked".to_owned()));
        let checkpoint = match encoded.unwrap_or_else(|_| panicked()) {
            Ok(snapshot) => {
                let Taken { seq, versions, .. } = *taken;
                Some(Arc::new(Checkpoint { base, seq, versions, snapshot }))
            }
            Err(failure) => {
                warn!("a checkpoint could not be made: {failure}");
                None
            }
        };
        self.teller.tell(Verdict::Packed { key, life, checkpoint }, true);
    }
}

/// What is told of a change that can't be stored.
pub(in crate::session) fn unstorable(failure: &StoreError) -> SessionError {
    match failure {
        StoreError::Failed(why) | StoreError::InUse(why) => SessionError::StorageFailed(format!(
            "the change was not made: it can't be stored ({why}); it can be tried again once the \
             data directory can be written to and has room"
        )),
        StoreError::Gone(why) => SessionError::StorageGone(format!(
            "the change was not made, because the next start would not find it: {why}"
        )),
    }
}
