//! What happens where a commit fails: everybody in it is refused, what it held is undone, and the
//! store is made whole once it can be written to again.

use tracing::{error, info};

use crate::machine;
use crate::session::journal::Record;
use crate::session::journal::handle::{Feedback, lock, unstorable};
use crate::session::journal::image::Submission;
use crate::store::{StoreError, Write};

use super::{LOOK, RETRY, Writer};

impl Writer {
    /// Refuses everything, and has it undone.
    pub(super) fn reject(&mut self, batch: Vec<Submission>, failure: &StoreError) {
        let gone = |failure: &StoreError| matches!(failure, StoreError::Gone(_));
        let before = lock(&self.shared.failure).replace(failure.clone());
        self.shared.vitals.set_gone(gone(failure));
        if before.is_none_or(|before| gone(&before) != gone(failure)) {
            self.shared.vitals.set_healthy(false);
            error!("the store can't be written to: {failure}; changes are refused until it can");
            self.next_attempt = machine::now() + RETRY;
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

    /// Looks from time to time whether the store is where it was: what can't be found by the next start
    /// is not stored.
    pub(super) fn look(&mut self) {
        if !self.durable || self.is_failed() || machine::since(self.last_look) < LOOK {
            return;
        }
        self.last_look = machine::now();
        if let Err(failure) = self.store.check() {
            self.reject(Vec::new(), &failure);
        }
    }

    /// Writes anew what the store may hold wrongly, once it can be written to again.
    pub(super) fn heal(&mut self, at_once: bool) {
        if !self.is_failed() || (machine::now() < self.next_attempt && !at_once) {
            return;
        }
        self.next_attempt = machine::now() + RETRY;
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
        if let Err(failure) = self.store.commit(&writes) {
            self.reject(Vec::new(), &failure);
            return;
        }
        info!("the store can be written to again; changes are taken");
        self.spoiled.clear();
        self.late.clear();
        *lock(&self.shared.failure) = None;
        self.shared.vitals.set_gone(false);
        self.shared.vitals.set_healthy(true);
    }

    /// Tells the world that a checkpoint did not come to be.
    pub(super) fn drop_checkpoint(&self, submission: &Submission) {
        if submission.acks.is_empty()
            && matches!(submission.records[..], [Record::Checkpoint(_)] | [])
        {
            let (key, generation) = (submission.key, submission.generation);
            self.tell(Feedback::Checkpoint { key, generation, stored: false });
        }
    }
}
