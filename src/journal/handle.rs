//! The world's end of the journal, and who works behind it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;

use tokio::sync::mpsc::WeakSender;
use tracing::{error, warn};

use crate::core::record::{Append, Checkpoint, Heartbeat, Part, Taken};
use crate::core::session::SessionError;
use crate::core::vitals::StoreVitals;
use crate::core::{Input, Job, Verdict};
use crate::journal::keeper::{Errand, StoreKeeper};
use crate::journal::keyed::KeyedRequests;
use crate::journal::writer::{Teller, Writer};
use crate::machine;
use crate::store::Store;
use crate::threads::{self, Priority};

pub(crate) enum Task {
    /// With how far the world has come after all of it.
    Append(Vec<Append>, Option<Heartbeat>),
    /// Sessions that the store may hold wrongly, as they should be.
    Rewrite {
        sessions: Vec<(u64, Vec<Part>)>,
        heartbeat: Heartbeat,
        /// Rejections that the world has heard of.
        heard: u64,
    },
    /// Something else that is wanted of the store.
    Errand(Errand),
}

/// The world's end of the journal.
pub(crate) struct Journal {
    tasks: Option<mpsc::Sender<Task>>,
    /// The way to it for what concerns all of the store, as long as that is taken.
    errands: Option<Arc<mpsc::Sender<Task>>>,
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
    /// A journal, and the workers behind it. `nudge` is woken when there is something to be told.
    pub fn new(
        store: Box<dyn Store>,
        keyed: Arc<KeyedRequests>,
        vitals: Arc<StoreVitals>,
        nudge: WeakSender<Input>,
    ) -> (Journal, Workers) {
        let durable = store.is_durable();
        let (tasks, incoming) = mpsc::channel();
        let (tell, verdicts) = mpsc::channel();
        let (jobs, to_encode) = mpsc::channel();
        let teller = || Teller { tell: tell.clone(), nudge: nudge.clone() };
        let writer = Writer::new(store, incoming, teller(), keyed, vitals);
        let packer = Packer { jobs: to_encode, teller: teller() };
        let journal = Journal {
            errands: durable.then(|| Arc::new(tasks.clone())),
            tasks: Some(tasks),
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

    /// What asks the store for what concerns all of it, until that is refused.
    pub fn keeper(&self) -> StoreKeeper {
        StoreKeeper::of(self.errands.as_ref())
    }

    /// Takes nothing more that concerns all of the store: a stop would have to wait for it.
    pub fn refuse_errands(&mut self) {
        self.errands = None;
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

    /// Adds a snapshot, to be made a checkpoint.
    pub fn checkpoint(&mut self, job: Job) {
        self.snapshots.push(job);
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
        self.errands = None;
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
pub(crate) struct Workers {
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
