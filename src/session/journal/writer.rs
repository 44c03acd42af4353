//! The thread that commits: everything that has been handed over while one batch was written goes
//! into the next, and whoever waits for it is answered when it is durable.
//!
//! Where a commit fails, everybody in it is refused and the world is told to undo it: sessions go
//! back to what the image holds, which is what is durable. Until the store has been written to
//! again, changes are refused and everything else goes on.

use std::collections::{BTreeSet, HashMap, VecDeque};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::sync::mpsc::WeakSender;
use tracing::{error, info, warn};

use crate::session::error::SessionError;
use crate::session::message::Message;
use crate::session::once::{Answered, Done};
use crate::store::{Kind, Row, Store, StoreError, Write};

use super::image::{Image, Stored, Submission};
use super::{Ack, Checkpoint, Mark, Record, StoreVitals, Taken};

/// Time between two attempts to write to a store that failed.
const RETRY: Duration = Duration::from_millis(250);

/// Longest time that marks wait for changes to be committed with.
const MARKS_WAIT: Duration = Duration::from_millis(250);

/// Submissions in one commit, about.
const LARGEST_BATCH: usize = 16_384;

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

enum Task {
    Commit(Vec<Submission>),
    Flush(mpsc::Sender<()>),
}

struct Job {
    key: u64,
    generation: u64,
    base: u64,
    taken: Box<Taken>,
}

/// What the threads and the world share.
struct Shared {
    image: Mutex<Image>,
    /// Why the store can't be written to.
    failure: Mutex<Option<StoreError>>,
    backlog: AtomicUsize,
    answered: Arc<Answered>,
    vitals: Arc<StoreVitals>,
}

/// The world's end of the journal.
pub(crate) struct Journal {
    tasks: Option<mpsc::Sender<Task>>,
    jobs: Option<mpsc::Sender<Job>>,
    feedback: mpsc::Receiver<Feedback>,
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    /// What this frame has left.
    frame: Vec<Submission>,
    /// Whether what is committed outlives the process.
    pub durable: bool,
}

impl Journal {
    /// Starts the threads. `nudge` is woken when there is something to be told.
    ///
    /// # Errors
    /// Where the operating system refuses a thread.
    pub fn start(
        store: Box<dyn Store>,
        image: Image,
        answered: Arc<Answered>,
        vitals: Arc<StoreVitals>,
        nudge: WeakSender<Message>,
    ) -> std::io::Result<Journal> {
        let durable = store.is_durable();
        let mut ages: Vec<(u64, Arc<Done>)> = Vec::new();
        for (&key, stored) in &image {
            ages.extend(stored.done.iter().map(|done| (key, done.clone())));
        }
        ages.sort_by_key(|(_, done)| done.at);
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
        let writer = Writer {
            store,
            durable,
            incoming,
            tell,
            nudge,
            shared: shared.clone(),
            waiting: Vec::new(),
            last_commit: Instant::now(),
            spoiled: BTreeSet::new(),
            late: HashMap::new(),
            ages: ages.into(),
            next_attempt: Instant::now(),
        };
        let encoded = tasks.clone();
        let counted = shared.clone();
        let threads = vec![
            spawn("store", move || writer.run())?,
            spawn("checkpoints", move || encode(&to_encode, &encoded, &counted))?,
        ];
        Ok(Journal {
            tasks: Some(tasks),
            jobs: Some(jobs),
            feedback,
            shared,
            threads,
            frame: Vec::new(),
            durable,
        })
    }

    /// Adds to what this frame has left.
    pub fn add(&mut self, submission: Submission) {
        self.frame.push(submission);
    }

    /// Hands over what this frame has left, to be committed together.
    pub fn send(&mut self) {
        if self.frame.is_empty() {
            return;
        }
        let frame = std::mem::take(&mut self.frame);
        self.shared.backlog.fetch_add(frame.len(), Ordering::Relaxed);
        if let Some(tasks) = &self.tasks
            && let Err(mpsc::SendError(Task::Commit(frame))) = tasks.send(Task::Commit(frame))
        {
            refuse_all(frame, &stopped());
        }
    }

    /// Gives up what this frame has left.
    pub fn abandon(&mut self, why: &SessionError) {
        refuse_all(std::mem::take(&mut self.frame), why);
    }

    /// Hands over a snapshot, to be made a checkpoint that holds all entries below `base`.
    pub fn checkpoint(&self, key: u64, generation: u64, base: u64, taken: Box<Taken>) {
        if let Some(jobs) = &self.jobs {
            // The thread ends after this.
            let _ = jobs.send(Job { key, generation, base, taken });
        }
    }

    /// Waits until everything handed over so far is durable or refused.
    pub fn flush(&mut self) {
        self.send();
        let (done, wait) = mpsc::channel();
        if let Some(tasks) = &self.tasks
            && tasks.send(Task::Flush(done)).is_ok()
        {
            // An error means that the thread has ended.
            let _ = wait.recv();
        }
    }

    /// What the world is to be told, if anything.
    pub fn told(&self) -> Option<Feedback> {
        self.feedback.try_recv().ok()
    }

    /// Waits for what the world is to be told.
    pub fn wait(&self, patience: Duration) -> Option<Feedback> {
        self.feedback.recv_timeout(patience).ok()
    }

    /// What is durable of a session, for a new life of it: what the old one submitted is void.
    pub fn new_life(&self, key: u64) -> Option<Stored> {
        let mut image = lock(&self.shared.image);
        let stored = image.get_mut(&key)?;
        stored.generation += 1;
        Some(stored.clone())
    }

    /// The life that a session is in.
    pub fn generation(&self, key: u64) -> u64 {
        lock(&self.shared.image).get(&key).map_or(0, |stored| stored.generation)
    }

    /// Why changes can't be taken now, if they can't.
    pub fn refusal(&self) -> Option<SessionError> {
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

/// Makes checkpoints of snapshots until there will be no more.
fn encode(jobs: &mpsc::Receiver<Job>, tasks: &mpsc::Sender<Task>, shared: &Shared) {
    while let Ok(Job { key, generation, base, taken }) = jobs.recv() {
        let records = match taken.snapshot.encode() {
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
        shared.backlog.fetch_add(1, Ordering::Relaxed);
        // Nobody is left to take it where this fails.
        let _ = tasks.send(Task::Commit(vec![submission]));
    }
}

struct Writer {
    store: Box<dyn Store>,
    durable: bool,
    incoming: mpsc::Receiver<Task>,
    tell: mpsc::Sender<Feedback>,
    nudge: WeakSender<Message>,
    shared: Arc<Shared>,
    /// Marks that wait for company.
    waiting: Vec<Submission>,
    last_commit: Instant,
    /// Sessions of which the store may hold what was refused.
    spoiled: BTreeSet<u64>,
    /// Marks that could not be written.
    late: HashMap<u64, (u64, Mark)>,
    /// Sessions and requests that carried a key, by age, the oldest first.
    ages: VecDeque<(u64, Arc<Done>)>,
    next_attempt: Instant,
}

impl Writer {
    fn run(mut self) {
        let mut ended = false;
        while !ended {
            let mut batch = std::mem::take(&mut self.waiting);
            let mut flushes = Vec::new();
            ended = !self.collect(&mut batch, &mut flushes);
            let urgent = ended
                || !flushes.is_empty()
                || self.last_commit.elapsed() >= MARKS_WAIT
                || batch.iter().any(|submission| !submission.can_wait());
            if urgent {
                self.commit(batch);
            } else {
                self.waiting = batch;
            }
            self.heal(ended);
            for flushed in flushes {
                // Whoever has gone away needs no answer.
                let _ = flushed.send(());
            }
        }
    }

    /// Waits for work and takes what there is. False means that there will be no more.
    fn collect(&self, batch: &mut Vec<Submission>, flushes: &mut Vec<mpsc::Sender<()>>) -> bool {
        let (idle, failed) = (batch.is_empty(), self.is_failed());
        let mut take = |task| match task {
            Task::Commit(submissions) => batch.extend(submissions),
            Task::Flush(done) => flushes.push(done),
        };
        if idle && !failed {
            match self.incoming.recv() {
                Ok(task) => take(task),
                Err(_) => return false,
            }
        } else {
            let patience = if failed { RETRY } else { MARKS_WAIT };
            match self.incoming.recv_timeout(patience) {
                Ok(task) => take(task),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return false,
            }
        }
        let mut taken = 1;
        while taken < LARGEST_BATCH
            && let Ok(task) = self.incoming.try_recv()
        {
            take(task);
            taken += 1;
        }
        true
    }

    fn is_failed(&self) -> bool {
        lock(&self.shared.failure).is_some()
    }

    fn commit(&mut self, batch: Vec<Submission>) {
        let count = batch.len();
        let (fitting, void) = self.sort(batch);
        for submission in void {
            let why = SessionError::Unavailable(
                "the session went back to what is stored; nothing was changed, try again".into(),
            );
            self.drop_checkpoint(&submission);
            refuse(submission.acks, &why);
        }
        let failure = lock(&self.shared.failure).clone();
        let written = match failure {
            Some(failure) => Err(failure),
            None => self.write(&fitting),
        };
        match written {
            Ok(()) => self.conclude(fitting),
            Err(failure) => self.reject(fitting, &failure),
        }
        self.shared.backlog.fetch_sub(count, Ordering::Relaxed);
    }

    /// Sorts out what belongs to an earlier life of its session, and checkpoints of what is not
    /// durable.
    fn sort(&self, batch: Vec<Submission>) -> (Vec<Submission>, Vec<Submission>) {
        let image = lock(&self.shared.image);
        let mut created = BTreeSet::new();
        batch.into_iter().partition(|submission| {
            let fits = submission.fits(&image);
            if fits && !image.contains_key(&submission.key) {
                created.insert(submission.key);
            }
            fits || (submission.generation == 0 && created.contains(&submission.key))
        })
    }

    fn write(&mut self, batch: &[Submission]) -> Result<(), StoreError> {
        self.last_commit = Instant::now();
        let mut writes = self.forget();
        if !self.durable {
            return Ok(());
        }
        batch.iter().for_each(|submission| submission.writes(&mut writes));
        if writes.is_empty() {
            return Ok(());
        }
        let began = Instant::now();
        self.store.commit(&writes)?;
        self.shared.vitals.committed(began.elapsed());
        Ok(())
    }

    /// Forgets requests that are too old to be sent again.
    fn forget(&mut self) -> Vec<Write> {
        let mut writes = Vec::new();
        let mut image = lock(&self.shared.image);
        while let Some((session, done)) = self.ages.pop_front_if(|(_, done)| done.is_old()) {
            self.shared.answered.forget(&done.key);
            if let Some(stored) = image.get_mut(&session) {
                stored.done.pop_front_if(|kept| kept.key == done.key);
            }
            let row = Row { session, kind: Kind::Answer, number: done.number() };
            writes.push(Write::Remove(row));
        }
        writes
    }

    /// Enters what is durable into the image, and answers whoever waited.
    fn conclude(&mut self, batch: Vec<Submission>) {
        {
            let mut image = lock(&self.shared.image);
            for submission in &batch {
                if submission.deletes() {
                    let deleted = image.get(&submission.key).map(|stored| &stored.done);
                    let done = deleted.into_iter().flatten();
                    done.for_each(|done| self.shared.answered.forget(&done.key));
                }
                submission.apply(&mut image);
            }
        }
        for submission in &batch {
            for record in &submission.records {
                if let Record::Done(done) = record {
                    self.shared.answered.note(done.clone());
                    self.ages.push_back((submission.key, done.clone()));
                }
            }
        }
        for submission in batch {
            if submission.deletes() {
                self.tell(Feedback::Deleted { key: submission.key, result: Ok(()) });
            }
            for record in &submission.records {
                if let Record::Checkpoint(checkpoint) = record {
                    self.shared.vitals.checkpointed(checkpoint.snapshot.len());
                    let (key, generation) = (submission.key, submission.generation);
                    self.tell(Feedback::Checkpoint { key, generation, stored: true });
                }
            }
            if submission.records.is_empty() {
                self.drop_checkpoint(&submission);
            }
            submission.acks.into_iter().for_each(|ack| ack(Ok(())));
        }
    }

    /// Refuses everything, and has it undone.
    fn reject(&mut self, batch: Vec<Submission>, failure: &StoreError) {
        let newly = lock(&self.shared.failure).replace(failure.clone()).is_none();
        if newly {
            self.shared.vitals.set_healthy(false);
            error!("the store can't be written to: {failure}; changes are refused until it can");
            self.next_attempt = Instant::now() + RETRY;
        }
        let (mut undo, mut refused) = (Vec::new(), Vec::new());
        let why = unstorable(failure);
        for submission in batch {
            self.spoiled.insert(submission.key);
            self.drop_checkpoint(&submission);
            let replaced = matches!(submission.records[..], [Record::Checkpoint(_)] | []);
            if submission.can_wait() {
                if let Some(Record::Mark(mark)) = submission.records.last() {
                    self.late.insert(submission.key, (submission.generation, mark.clone()));
                }
            } else if submission.deletes() {
                let result = Err(why.clone());
                self.tell(Feedback::Deleted { key: submission.key, result });
            } else if !replaced && !undo.contains(&submission.key) {
                undo.push(submission.key);
            }
            refused.extend(submission.acks);
        }
        {
            let mut image = lock(&self.shared.image);
            for key in &undo {
                if let Some(stored) = image.get_mut(key) {
                    stored.generation += 1;
                }
            }
        }
        if !undo.is_empty() {
            self.tell(Feedback::Undo { keys: undo, refused, why });
        }
    }

    /// Writes anew what the store may hold wrongly, once it can be written to again.
    fn heal(&mut self, at_once: bool) {
        if !self.is_failed() || (Instant::now() < self.next_attempt && !at_once) {
            return;
        }
        self.next_attempt = Instant::now() + RETRY;
        let mut writes = Vec::new();
        {
            let mut image = lock(&self.shared.image);
            for key in &self.spoiled {
                let Some(stored) = image.get_mut(key) else {
                    writes.push(Write::RemoveSession(*key));
                    continue;
                };
                if let Some((generation, mark)) = self.late.get(key)
                    && *generation == stored.generation
                {
                    stored.mark = mark.clone();
                }
                stored.submission(*key).writes(&mut writes);
            }
        }
        if self.store.commit(&writes).is_ok() {
            info!("the store can be written to again; changes are taken");
            self.spoiled.clear();
            self.late.clear();
            *lock(&self.shared.failure) = None;
            self.shared.vitals.set_healthy(true);
        }
    }

    /// Tells the world that a checkpoint did not come to be.
    fn drop_checkpoint(&self, submission: &Submission) {
        if submission.acks.is_empty()
            && matches!(submission.records[..], [Record::Checkpoint(_)] | [])
        {
            let (key, generation) = (submission.key, submission.generation);
            self.tell(Feedback::Checkpoint { key, generation, stored: false });
        }
    }

    fn tell(&self, feedback: Feedback) {
        // Neither is heard where the world has ended.
        let _ = self.tell.send(feedback);
        if let Some(world) = self.nudge.upgrade() {
            let _ = world.try_send(Message::Nudge);
        }
    }
}

fn refuse(acks: Vec<Ack>, why: &SessionError) {
    acks.into_iter().for_each(|ack| ack(Err(why.clone())));
}

fn refuse_all(batch: Vec<Submission>, why: &SessionError) {
    batch.into_iter().for_each(|submission| refuse(submission.acks, why));
}

fn unstorable(failure: &StoreError) -> SessionError {
    SessionError::StorageFailed(format!(
        "the change was not made: it can't be stored ({failure}); it can be tried again once the \
         data directory can be written to and has room"
    ))
}

fn stopped() -> SessionError {
    SessionError::Unavailable("the engine has stopped".to_owned())
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Only whole submissions are entered: one left by a panic is still sound.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
