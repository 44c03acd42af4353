//! The thread that commits: everything that has been handed over while one batch was written goes into the
//! next, and waiting requests are told when it is durable.
//!
//! Where a commit fails, all of it and all that follows is refused, until the world has written anew what the
//! store may hold wrongly.

use std::sync::Arc;
use std::sync::mpsc::{self, RecvTimeoutError, TryRecvError};
use std::time::{Duration, Instant};

use tokio::sync::mpsc::WeakSender;

use crate::core::record::{Append, Heartbeat, Part};
use crate::core::storage::unstorable;
use crate::core::vitals::StoreVitals;
use crate::core::{Input, Verdict};
use crate::journal::handle::Task;
use crate::journal::keyed::KeyedRequests;
use crate::journal::rows::{beat, write};
use crate::machine;
use crate::store::{Store, StoreError, Write};

/// Time between two looks at whether the store is where it was.
const LOOK: Duration = Duration::from_millis(250);

/// Longest time that anchors wait for changes to be committed with.
const COMPANY_WAIT: Duration = Duration::from_millis(250);

/// Tasks in one commit, about.
const LARGEST_BATCH: usize = 16_384;

/// How the world is told something.
pub(crate) struct Teller {
    pub tell: mpsc::Sender<Verdict>,
    /// Woken when there is something to be heard at once.
    pub nudge: WeakSender<Input>,
}

impl Teller {
    pub fn tell(&self, verdict: Verdict, at_once: bool) {
        // Neither is heard where the world has ended.
        let _ = self.tell.send(verdict);
        if at_once && let Some(world) = self.nudge.upgrade() {
            let _ = world.try_send(Input::Nudge);
        }
    }
}

pub(crate) struct Writer {
    store: Box<dyn Store>,
    incoming: mpsc::Receiver<Task>,
    teller: Teller,
    keyed: Arc<KeyedRequests>,
    vitals: Arc<StoreVitals>,
    /// Anchors that wait for company.
    waiting: Vec<Append>,
    /// As it does.
    heartbeat: Option<Heartbeat>,
    last_commit: Instant,
    last_look: Instant,
    /// Why the store could not be written to.
    failure: Option<StoreError>,
    /// How often the world was told of that.
    rejections: u64,
}

impl Writer {
    /// A writer that has written nothing yet.
    pub fn new(
        store: Box<dyn Store>,
        incoming: mpsc::Receiver<Task>,
        teller: Teller,
        keyed: Arc<KeyedRequests>,
        vitals: Arc<StoreVitals>,
    ) -> Writer {
        Writer {
            store,
            incoming,
            teller,
            keyed,
            vitals,
            waiting: Vec::new(),
            heartbeat: None,
            last_commit: machine::now(),
            last_look: machine::now(),
            failure: None,
            rejections: 0,
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
        let mut first = first;
        for _ in 0..LARGEST_BATCH {
            let Some(task) = first.take().or_else(|| self.incoming.try_recv().ok()) else { break };
            match task {
                Task::Append(appends, heartbeat) => {
                    batch.extend(appends);
                    self.heartbeat = heartbeat.or(self.heartbeat);
                }
                Task::Rewrite { sessions, heartbeat, heard } => {
                    self.heartbeat = Some(heartbeat);
                    if !batch.is_empty() {
                        self.commit(std::mem::take(&mut batch), ended);
                    }
                    self.rewrite(&sessions, heard);
                }
                Task::Errand(errand) => errand.run(&mut *self.store),
            }
        }
        self.look();
        let urgent = ended
            || machine::since(self.last_commit) >= COMPANY_WAIT
            || batch.iter().any(|append| !append.can_wait());
        if urgent {
            self.commit(batch, ended);
        } else {
            self.waiting = batch;
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
        if idle && !self.store.is_durable() {
            let first = self.incoming.recv().ok();
            let ended = first.is_none();
            return (first, ended);
        }
        match self.incoming.recv_timeout(if idle { LOOK } else { COMPANY_WAIT }) {
            Ok(task) => (Some(task), false),
            Err(RecvTimeoutError::Timeout) => (None, false),
            Err(RecvTimeoutError::Disconnected) => (None, true),
        }
    }

    fn commit(&mut self, batch: Vec<Append>, ended: bool) {
        let written = match self.failure.clone() {
            Some(failure) => Err(failure),
            None => self.write(&batch),
        };
        match written {
            Ok(()) => self.conclude(batch),
            Err(failure) => self.reject(batch, failure, ended),
        }
    }

    fn write(&mut self, batch: &[Append]) -> Result<(), StoreError> {
        self.last_commit = machine::now();
        let over = self.keyed.forget_old();
        if !self.store.is_durable() {
            return Ok(());
        }
        let mut writes: Vec<Write> = over.iter().copied().map(Write::Remove).collect();
        batch.iter().for_each(|append| write(append.key, &append.parts, &mut writes));
        writes.extend(self.heartbeat.map(beat));
        if writes.is_empty() {
            return Ok(());
        }
        let began = machine::now();
        if let Err(failure) = self.store.commit(&writes) {
            self.keyed.put_back(over);
            return Err(failure);
        }
        self.heartbeat = None;
        self.vitals.committed(machine::since(began));
        Ok(())
    }

    /// Tells waiting requests, and the world, that a batch is durable.
    fn conclude(&mut self, batch: Vec<Append>) {
        for append in &batch {
            for part in &*append.parts {
                match part {
                    // Before anybody is told: who asks again then is not carried out.
                    Part::Done(done) => self.keyed.note(append.key, done.clone()),
                    Part::Checkpoint(made) => self.vitals.checkpointed(made.snapshot.len()),
                    _ => {}
                }
            }
            append.receipts.confirm(append.position);
        }
        let at_once = batch.iter().any(Append::is_news);
        self.tell(batch, at_once, Verdict::Durable);
    }

    /// Refuses a batch, and all that follows.
    fn reject(&mut self, batch: Vec<Append>, failure: StoreError, ended: bool) {
        if ended {
            // Nobody is left to take anything back.
            let why = unstorable(&failure);
            batch.iter().for_each(|append| {
                append.receipts.refuse((append.position, append.position), &why);
            });
        }
        let first = self.failure.is_none();
        self.failure = Some(failure.clone());
        self.vitals.set_healthy(false);
        if first || !batch.is_empty() {
            self.rejections += 1;
            self.tell(batch, true, |appends| Verdict::Failed(appends, failure));
        }
    }

    fn tell(
        &self,
        batch: Vec<Append>,
        at_once: bool,
        verdict: impl FnOnce(Vec<(u64, u64)>) -> Verdict,
    ) {
        if !batch.is_empty() || at_once {
            let appends = batch.iter().map(|append| (append.key, append.position)).collect();
            self.teller.tell(verdict(appends), at_once);
        }
    }

    /// Writes sessions anew. Where that succeeds, all goes on: not where the world has not `heard` of all that
    /// was refused before.
    fn rewrite(&mut self, sessions: &[(u64, Vec<Part>)], heard: u64) {
        if let Some(failure) = self.failure.clone().filter(|_| heard < self.rejections) {
            self.teller.tell(Verdict::Rewritten(Err(failure)), true);
            return;
        }
        let mut writes = Vec::new();
        sessions.iter().for_each(|(key, parts)| write(*key, parts, &mut writes));
        writes.extend(self.heartbeat.map(beat));
        let durable = self.store.is_durable();
        let written = if durable { self.store.commit(&writes) } else { Ok(()) };
        self.failure = written.as_ref().err().cloned();
        if self.failure.is_none() {
            self.heartbeat = None;
            self.last_commit = machine::now();
        }
        self.teller.tell(Verdict::Rewritten(written), true);
    }

    /// Looks from time to time whether the store is where it was: what can't be found by the next start
    /// is not stored.
    fn look(&mut self) {
        let durable = self.store.is_durable();
        if !durable || self.failure.is_some() || machine::since(self.last_look) < LOOK {
            return;
        }
        self.last_look = machine::now();
        if let Err(failure) = self.store.check() {
            self.reject(Vec::new(), failure, false);
        }
    }
}
