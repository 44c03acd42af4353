//! What is handed to the journal, and what the journal says of it: what is durable, and what has to be taken
//! back. Until what the store may hold wrongly is written anew, changes are refused and everything else goes
//! on.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tracing::{error, info};

use crate::core::inputs::gone;
use crate::core::record::{Anchor, Append, Checkpoint, Part, Pending, Record};
use crate::core::session::{Answer, Receipts, SessionError};
use crate::core::{Effect, Verdict, World};
use crate::store::StoreError;

/// Time between two attempts to write to a store that failed.
const RETRY: Duration = Duration::from_millis(250);

/// Appends that may be on their way; beyond them changes are refused.
const LONGEST_BACKLOG: usize = 65_536;

/// How the store is doing, as far as the world has heard.
#[derive(Default)]
pub(crate) struct Storage {
    /// Why it can't be written to.
    pub(super) failure: Option<StoreError>,
    /// Sessions that it may hold wrongly.
    pub(super) spoiled: BTreeSet<u64>,
    /// Sessions that are being written anew: how far they had come by their records, and by what is written.
    pub(super) rewriting: Option<BTreeMap<u64, Option<[Anchor; 2]>>>,
    /// Rejections that were heard of.
    pub(super) heard: u64,
    pub(super) next_attempt: Option<Instant>,
    /// Appends that nothing has been heard of.
    pub(super) under_way: usize,
    /// Positions of sessions, first and last, that were taken back. Requests that wait for them are refused when
    /// the session is back, so that a client that reads then never sees what was not stored.
    pub(super) taken_back: BTreeMap<u64, Vec<TakenBack>>,
    /// Nobody is left who would commit anything.
    pub(super) dead: bool,
}

type TakenBack = (Arc<Receipts>, (u64, u64), SessionError);

impl Storage {
    /// Whether all is written as it should be.
    pub fn is_settled(&self) -> bool {
        self.failure.is_none() && self.rewriting.is_none()
    }

    /// Whether it has failed, and nothing is under way that would mend that.
    pub fn is_to_be_rewritten(&self) -> bool {
        self.failure.is_some() && self.rewriting.is_none()
    }

    /// Why changes can't be taken now, if they can't.
    pub fn refusal(&self) -> Option<SessionError> {
        if self.dead {
            return Some(unavailable());
        }
        if let Some(failure) = &self.failure {
            return Some(unstorable(failure));
        }
        (self.under_way > LONGEST_BACKLOG).then(|| {
            let waiting = self.under_way;
            SessionError::Unavailable(format!("{waiting} changes wait for the disk already"))
        })
    }
}

impl World {
    /// Hands something of a session to the journal. The replies are given when it is durable.
    pub(crate) fn submit(&mut self, append: Append, replies: Vec<Answer<()>>) {
        let key = append.key;
        if let Some(Part::Create(identity, origin, epochs)) = append.parts.first() {
            let receipts = append.receipts.clone();
            let record = || Record::new(identity.clone(), origin.clone(), epochs.clone(), receipts);
            self.records.entry(key).or_insert_with(record).stored.weigh();
        }
        let Some(record) = self.records.get_mut(&key).filter(|record| !record.is_leaving()) else {
            replies.into_iter().for_each(|reply| reply.refuse(&gone()));
            return;
        };
        if self.storage.dead {
            append.receipts.end(&nobody_knows());
        }
        record.push(&append, replies);
        if let Some(simulation) = self.simulations.get_mut(&key) {
            simulation.log.go_on_from(append.position);
        }
        self.storage.under_way += 1;
        self.effects.push(Effect::Append(append));
    }

    /// Hands parts of a session to the journal at once.
    pub(crate) fn submit_parts(&mut self, key: u64, parts: Vec<Part>, reply: Option<Answer<()>>) {
        if let Some(record) = self.records.get(&key) {
            let append = record.append(key, parts);
            self.submit(append, reply.into_iter().collect());
        } else if let Some(reply) = reply {
            reply.refuse(&gone());
        }
    }

    /// Whether a session is being deleted.
    pub(crate) fn is_leaving(&self, key: u64) -> bool {
        self.records.get(&key).is_some_and(Record::is_leaving)
    }

    /// Nobody is left who would commit anything.
    pub(crate) fn lose_journal(&mut self) {
        self.storage.dead = true;
        self.vitals.store.set_healthy(false);
        self.end_receipts(&nobody_knows());
    }

    /// Tells everybody who waits until something is durable why it never will be.
    pub(crate) fn end_receipts(&self, why: &SessionError) {
        self.records.values().for_each(|record| record.receipts().end(why));
    }

    /// Takes in what the journal says.
    pub(crate) fn hear(&mut self, verdict: Verdict) {
        match verdict {
            Verdict::Durable(appends) => {
                self.storage.under_way -= appends.len();
                appends.into_iter().for_each(|(key, position)| self.confirm(key, position));
            }
            Verdict::Failed(appends, failure) => {
                self.storage.under_way -= appends.len();
                self.storage.heard += 1;
                self.fail(&failure);
                self.take_back(&appends, &unstorable(&failure));
            }
            Verdict::Rewritten(result) => self.rewritten(result),
            Verdict::Packed { key, life, checkpoint } => self.packed(key, life, checkpoint),
        }
    }

    /// What is on its way of a session up to a position is durable.
    fn confirm(&mut self, key: u64, position: u64) {
        let stored = self.now.stored;
        let Some(record) = self.records.get_mut(&key) else { return };
        for Pending { life, parts, replies, .. } in record.confirm(position, stored) {
            for part in &*parts {
                match part {
                    Part::Checkpoint(_) => self.checkpointed(key, life, true),
                    Part::Identity(identity) => {
                        if let Some(session) = self.session(key) {
                            session.set_tokens(identity.tokens);
                        }
                    }
                    Part::Lock(None) => {
                        if let Some(session) = self.session(key) {
                            info!(session = session.id, "unlocked");
                            session.set_locked(false);
                        }
                    }
                    Part::Points(points) => self.show_points(key, points),
                    Part::Delete => self.deleted(key),
                    _ => {}
                }
            }
            replies.into_iter().for_each(|reply| reply.give(Ok(())));
        }
    }

    /// Takes back what was not made durable.
    fn take_back(&mut self, appends: &[(u64, u64)], why: &SessionError) {
        let mut back = Vec::new();
        for &(key, position) in appends {
            self.storage.spoiled.insert(key);
            let Some(record) = self.records.get_mut(&key) else { continue };
            if !record.awaits(position) {
                continue;
            }
            let (exists, receipts) = (record.exists, record.receipts().clone());
            let (cut, range) = record.cut();
            for Pending { life, parts, replies, .. } in cut {
                replies.into_iter().for_each(|reply| reply.refuse(why));
                if parts.iter().any(|part| matches!(part, Part::Checkpoint(_))) {
                    self.checkpointed(key, life, false);
                }
            }
            match range {
                Some(range) if exists => {
                    receipts.take_back(range);
                    back.push(key);
                    let taken_back = self.storage.taken_back.entry(key).or_default();
                    taken_back.push((receipts, range, why.clone()));
                }
                Some(range) => {
                    receipts.refuse(range, why);
                    self.abolish(key, why);
                }
                // It goes on, where it was to be deleted.
                None => {
                    self.review(key);
                    self.schedule(key);
                }
            }
        }
        // Where the server stops nobody reads any more.
        if self.stop.is_some() {
            back.into_iter().for_each(|key| self.tell_of_taken_back(key));
        } else {
            self.go_back(&back);
        }
    }

    /// Refuses the requests that wait for what was taken back of a session.
    pub(crate) fn tell_of_taken_back(&mut self, key: u64) {
        let taken_back = self.storage.taken_back.remove(&key).unwrap_or_default();
        taken_back.into_iter().for_each(|(receipts, range, why)| receipts.refuse(range, &why));
    }

    /// Takes a session out of the world that was never stored.
    fn abolish(&mut self, key: u64, why: &SessionError) {
        self.coming.remove(&key);
        self.remove(key, why);
        self.records.remove(&key);
    }

    /// Stores how far a session that goes back has come: at once, or with what is written anew.
    pub(crate) fn submit_anchor(&mut self, key: u64, anchor: Anchor) {
        if self.storage.failure.is_none() {
            self.submit_parts(key, vec![Part::Anchor(anchor)], None);
        } else if let Some(record) = self.records.get_mut(&key) {
            record.stored.anchor = anchor;
            self.storage.spoiled.insert(key);
        }
    }

    pub(super) fn fail(&mut self, failure: &StoreError) {
        let gone = |failure: &StoreError| matches!(failure, StoreError::Gone(_));
        let before = self.storage.failure.replace(failure.clone());
        self.vitals.store.set_gone(gone(failure));
        self.vitals.store.set_healthy(false);
        if before.is_none_or(|before| gone(&before) != gone(failure)) {
            error!("the store can't be written to: {failure}; changes are refused until it can");
        }
        let next = self.storage.next_attempt;
        self.storage.next_attempt = next.or_else(|| self.now.instant.checked_add(RETRY));
    }

    /// Hands a checkpoint over that was made of a session's snapshot.
    fn packed(&mut self, key: u64, life: u64, checkpoint: Option<Arc<Checkpoint>>) {
        let log = self.simulations.get(&key).map(|sim| &sim.log);
        let log = log.filter(|log| log.life() == life);
        // Of a session that is being deleted nothing more is stored.
        let keeps = self.storage.failure.is_none() && !self.is_leaving(key);
        // Where it began anew meanwhile, the checkpoint is of what it is no more.
        let is_of_it = |made: &Arc<Checkpoint>| log.is_some_and(|log| log.is_covered_by(made.base));
        match checkpoint.filter(|made| keeps && is_of_it(made)) {
            Some(checkpoint) => self.submit_parts(key, vec![Part::Checkpoint(checkpoint)], None),
            None => self.checkpointed(key, life, false),
        }
    }
}

fn unavailable() -> SessionError {
    SessionError::Unavailable("changes can't be stored any more: only a restart helps".to_owned())
}

fn nobody_knows() -> SessionError {
    let why =
        "the thread that stores changes has died: only a restart tells whether this one is stored";
    SessionError::Internal(why.to_owned())
}

/// The error for a change that can't be stored.
pub(crate) fn unstorable(failure: &StoreError) -> SessionError {
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
