//! The thread that commits: everything that has been handed over while one batch was written goes
//! into the next, and whoever waits for it is answered when it is durable.
//!
//! Where a commit fails, everybody in it is refused and the world is told to undo it: sessions go
//! back to what the image holds, which is what is durable. Until the store has been written to
//! again, changes are refused and everything else goes on.

mod failure;

use std::collections::{BTreeSet, HashMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{self, RecvTimeoutError, TryRecvError};
use std::time::{Duration, Instant};

use tokio::sync::mpsc::WeakSender;

use crate::machine;
use crate::session::error::SessionError;
use crate::session::message::Message;
use crate::session::once::Done;
use crate::store::{Kind, Row, Store, StoreError, Write};

use super::handle::{Feedback, Shared, Task, lock, refuse};
use super::image::{Life, Submission, beat};
use super::{Heartbeat, Mark, Record};

/// Time between two attempts to write to a store that failed.
const RETRY: Duration = Duration::from_millis(250);

/// Time between two looks at whether the store is where it was.
const LOOK: Duration = Duration::from_millis(250);

/// Longest time that marks wait for changes to be committed with.
const MARKS_WAIT: Duration = Duration::from_millis(250);

/// Submissions in one commit, about.
const LARGEST_BATCH: usize = 16_384;

pub(super) struct Writer {
    store: Box<dyn Store>,
    durable: bool,
    incoming: mpsc::Receiver<Task>,
    tell: mpsc::Sender<Feedback>,
    nudge: WeakSender<Message>,
    shared: Arc<Shared>,
    /// Marks that wait for company.
    waiting: Vec<Submission>,
    /// As they do.
    heartbeat: Option<Heartbeat>,
    last_commit: Instant,
    last_look: Instant,
    /// Sessions of which the store may hold what was refused.
    spoiled: BTreeSet<u64>,
    /// Marks that could not be written.
    late: HashMap<u64, (u64, Mark)>,
    /// Sessions and requests that carried a key, by age, the oldest first.
    ages: VecDeque<(u64, Arc<Done>)>,
    next_attempt: Instant,
}

impl Writer {
    /// A writer that notes what it does in `shared`; `ages` are the requests with a key that are
    /// stored, the oldest first.
    pub fn new(
        store: Box<dyn Store>,
        shared: Arc<Shared>,
        ages: Vec<(u64, Arc<Done>)>,
        incoming: mpsc::Receiver<Task>,
        tell: mpsc::Sender<Feedback>,
        nudge: WeakSender<Message>,
    ) -> Writer {
        Writer {
            durable: store.is_durable(),
            store,
            incoming,
            tell,
            nudge,
            shared,
            waiting: Vec::new(),
            heartbeat: None,
            last_commit: machine::now(),
            last_look: machine::now(),
            spoiled: BTreeSet::new(),
            late: HashMap::new(),
            ages: ages.into(),
            next_attempt: machine::now(),
        }
    }

    /// Commits what it is handed until there will be no more.
    pub fn run(mut self) {
        loop {
            let (first, ended) = self.wait();
            self.turn(first, ended);
            if ended {
                break;
            }
        }
    }

    /// Commits what it has been handed, one task first, where it does not wait for more; `ended` says that
    /// there will be no more.
    pub fn turn(&mut self, first: Option<Task>, ended: bool) {
        let mut batch = std::mem::take(&mut self.waiting);
        let mut flushes = Vec::new();
        let others = std::iter::from_fn(|| self.incoming.try_recv().ok());
        for task in first.into_iter().chain(others).take(LARGEST_BATCH) {
            match task {
                Task::Commit(submissions, heartbeat) => {
                    batch.extend(submissions);
                    self.heartbeat = heartbeat.or(self.heartbeat);
                }
                Task::Flush(done) => flushes.push(done),
            }
        }
        self.look();
        let urgent = ended
            || !flushes.is_empty()
            || machine::since(self.last_commit) >= MARKS_WAIT
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

    /// A task that is there.
    ///
    /// # Errors
    /// Where there is none.
    pub fn next(&self) -> Result<Task, TryRecvError> {
        self.incoming.try_recv()
    }

    /// Waits for a task, up to the time at which there may be something else to do. Returns it, and whether
    /// there will be no more.
    fn wait(&self) -> (Option<Task>, bool) {
        let idle = self.waiting.is_empty() && self.heartbeat.is_none();
        let failed = self.is_failed();
        if idle && !failed && !self.durable {
            let first = self.incoming.recv().ok();
            let ended = first.is_none();
            return (first, ended);
        }
        let patience = if failed {
            RETRY
        } else if idle {
            LOOK
        } else {
            MARKS_WAIT
        };
        match self.incoming.recv_timeout(patience) {
            Ok(task) => (Some(task), false),
            Err(RecvTimeoutError::Timeout) => (None, false),
            Err(RecvTimeoutError::Disconnected) => (None, true),
        }
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
            if submission.deletes() {
                self.tell(Feedback::Deleted { key: submission.key, result: Err(why.clone()) });
            }
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

    /// Sorts out what belongs to an earlier life of its session or to one that is deleted, and
    /// checkpoints of what is not durable.
    fn sort(&self, batch: Vec<Submission>) -> (Vec<Submission>, Vec<Submission>) {
        let image = lock(&self.shared.image);
        let mut lives: HashMap<u64, Option<Life>> = HashMap::new();
        batch.into_iter().partition(|submission| {
            let key = submission.key;
            let stored = || image.get(&key).map(Life::from);
            submission.fits(lives.entry(key).or_insert_with(stored))
        })
    }

    fn write(&mut self, batch: &[Submission]) -> Result<(), StoreError> {
        self.last_commit = machine::now();
        let mut writes = self.forget();
        if !self.durable {
            return Ok(());
        }
        batch.iter().for_each(|submission| submission.writes(&mut writes));
        writes.extend(self.heartbeat.map(beat));
        if writes.is_empty() {
            return Ok(());
        }
        let began = machine::now();
        self.store.commit(&writes)?;
        self.heartbeat = None;
        self.shared.vitals.committed(machine::since(began));
        Ok(())
    }

    /// Forgets requests that are too old to be sent again.
    fn forget(&mut self) -> Vec<Write> {
        let mut writes = Vec::new();
        let answered = &self.shared.answered;
        let mut image = lock(&self.shared.image);
        while let Some((session, done)) = self.ages.pop_front_if(|(_, done)| answered.is_over(done))
        {
            answered.forget(&done.key);
            if let Some(stored) = image.get_mut(&session) {
                stored.done.pop_front_if(|kept| kept.key == done.key);
                stored.weigh();
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

    fn tell(&self, feedback: Feedback) {
        // Neither is heard where the world has ended.
        let _ = self.tell.send(feedback);
        if let Some(world) = self.nudge.upgrade() {
            let _ = world.try_send(Message::Nudge);
        }
    }
}
