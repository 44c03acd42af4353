//! What is durable, as an image in memory, and what is written to it.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

use crate::session::once::Done;
use crate::store::{Kind, Row, Write};

use super::{Ack, Checkpoint, Entry, Heartbeat, Identity, Lock, Mark};

/// The row that says how far the world has come. Sessions have keys that are counted from 0.
pub(super) const HEARTBEAT: Row = Row { session: u64::MAX, kind: Kind::Heartbeat, number: 0 };

/// A session as it can be brought back.
#[derive(Clone, Debug)]
pub(crate) struct Stored {
    pub identity: Arc<Identity>,
    /// The snapshot that it was made from.
    pub origin: Option<Arc<[u8]>>,
    /// `None` stands for the state that it was created in.
    pub checkpoint: Option<Arc<Checkpoint>>,
    /// What has happened since.
    pub entries: VecDeque<Arc<Entry>>,
    /// Memory that they take.
    pub entry_bytes: usize,
    pub mark: Mark,
    /// What came of requests that carry a key, the oldest first.
    pub done: VecDeque<Arc<Done>>,
    /// Where it came back from a damaged file.
    pub lock: Option<Lock>,
    /// Counts how often the session was brought back: what was submitted by an earlier life is void.
    pub generation: u64,
}

impl Stored {
    /// Number of the first of its entries.
    pub fn base(&self) -> u64 {
        self.checkpoint.as_ref().map_or(0, |checkpoint| checkpoint.base)
    }

    /// Number of its next entry.
    pub fn next(&self) -> u64 {
        self.base() + self.entries.len() as u64
    }
}

/// What tells whether a submission belongs to a session as it is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Life {
    generation: u64,
    /// Number of its next entry.
    next: u64,
}

impl From<&Stored> for Life {
    fn from(stored: &Stored) -> Life {
        Life { generation: stored.generation, next: stored.next() }
    }
}

/// Sessions by their keys.
pub(crate) type Image = HashMap<u64, Stored>;

/// One thing to be made durable about a session.
#[derive(Clone, Debug)]
pub(crate) enum Record {
    Create(Arc<Identity>, Option<Arc<[u8]>>),
    /// Other tokens.
    Identity(Arc<Identity>),
    Entry(u64, Arc<Entry>),
    Mark(Mark),
    Checkpoint(Arc<Checkpoint>),
    /// What came of a request that carries a key.
    Done(Arc<Done>),
    /// Locked, or no longer.
    Lock(Option<Lock>),
    Delete,
}

/// What is to be made durable about a session together, and who waits for it.
pub(crate) struct Submission {
    pub key: u64,
    pub generation: u64,
    pub records: Vec<Record>,
    pub acks: Vec<Ack>,
}

impl Submission {
    /// A mark, by itself.
    pub fn of_mark(key: u64, generation: u64, mark: Mark) -> Submission {
        Submission { key, generation, records: vec![Record::Mark(mark)], acks: Vec::new() }
    }

    /// Whether nobody waits for it and it replaces what came before.
    pub fn can_wait(&self) -> bool {
        self.acks.is_empty() && self.records.iter().all(|record| matches!(record, Record::Mark(_)))
    }

    /// Whether it removes the session.
    pub fn deletes(&self) -> bool {
        self.records.iter().any(|record| matches!(record, Record::Delete))
    }

    /// Whether it belongs to a session as it is stored, `None` where it is not. If so, `life` becomes
    /// what it is after that: a checkpoint may hold entries that are committed together with it, and
    /// nothing follows a deletion.
    pub fn fits(&self, life: &mut Option<Life>) -> bool {
        let begins = matches!(self.records.first(), Some(Record::Create(..)));
        let mut after = match *life {
            None if begins => Life { generation: self.generation, next: 0 },
            Some(life) if life.generation == self.generation => life,
            _ => return false,
        };
        for record in &self.records {
            match record {
                Record::Checkpoint(checkpoint) if checkpoint.base > after.next => return false,
                Record::Entry(number, _) => after.next = number + 1,
                _ => {}
            }
        }
        *life = (!self.deletes()).then_some(after);
        true
    }

    /// What it writes.
    pub fn writes(&self, writes: &mut Vec<Write>) {
        let session = self.key;
        let row = |kind, number| Row { session, kind, number };
        for record in &self.records {
            match record {
                Record::Create(identity, origin) => {
                    writes.push(Write::Put(row(Kind::Identity, 0), json(&**identity)));
                    if let Some(origin) = origin {
                        writes.push(Write::Put(row(Kind::Origin, 0), origin.to_vec()));
                    }
                }
                Record::Identity(identity) => {
                    writes.push(Write::Put(row(Kind::Identity, 0), json(&**identity)));
                }
                Record::Entry(number, entry) => {
                    writes.push(Write::Put(row(Kind::Entry, *number), json(&**entry)));
                }
                Record::Mark(mark) => writes.push(Write::Put(row(Kind::Mark, 0), json(mark))),
                Record::Checkpoint(checkpoint) => {
                    let before = checkpoint.base;
                    writes.push(Write::Put(row(Kind::Checkpoint, 0), checkpoint.encode()));
                    writes.push(Write::RemoveEntries { session, before });
                }
                Record::Done(done) => {
                    writes.push(Write::Put(row(Kind::Answer, done.number()), json(&**done)));
                }
                Record::Lock(lock) => writes.push(Lock::write(*lock, session)),
                Record::Delete => writes.push(Write::RemoveSession(session)),
            }
        }
    }

    /// Enters it into the image, once it is durable.
    pub fn apply(&self, image: &mut Image) {
        for record in &self.records {
            if let Record::Create(identity, origin) = record {
                let stored = Stored {
                    identity: identity.clone(),
                    origin: origin.clone(),
                    checkpoint: None,
                    entries: VecDeque::new(),
                    entry_bytes: 0,
                    mark: Mark::default(),
                    done: VecDeque::new(),
                    lock: None,
                    generation: self.generation,
                };
                image.insert(self.key, stored);
            } else if matches!(record, Record::Delete) {
                image.remove(&self.key);
            } else if let Some(stored) = image.get_mut(&self.key) {
                stored.enter(record);
            }
        }
        if let Some(stored) = image.get(&self.key) {
            stored.weigh();
        }
    }
}

impl Stored {
    pub(super) fn enter(&mut self, record: &Record) {
        match record {
            Record::Identity(identity) => self.identity = identity.clone(),
            // Of a pause at the start, which it holds already.
            Record::Entry(number, _) if *number < self.next() => {}
            Record::Entry(_, entry) => {
                self.entry_bytes += entry.bytes();
                self.entries.push_back(entry.clone());
            }
            Record::Mark(mark) => self.mark = mark.clone(),
            Record::Checkpoint(checkpoint) => {
                let covered = checkpoint.base.saturating_sub(self.base()) as usize;
                let covered = self.entries.drain(..covered.min(self.entries.len()));
                self.entry_bytes -= covered.map(|entry| entry.bytes()).sum::<usize>();
                self.checkpoint = Some(checkpoint.clone());
            }
            Record::Done(done) => self.done.push_back(done.clone()),
            Record::Lock(lock) => self.lock = *lock,
            Record::Create(..) | Record::Delete => {}
        }
    }

    /// Everything of it, to be written anew.
    pub fn submission(&self, key: u64) -> Submission {
        let mut records = vec![
            Record::Delete,
            Record::Create(self.identity.clone(), self.origin.clone()),
            Record::Mark(self.mark.clone()),
        ];
        records.extend(self.checkpoint.clone().map(Record::Checkpoint));
        records.extend(self.done.iter().cloned().map(Record::Done));
        records.extend(self.lock.map(|lock| Record::Lock(Some(lock))));
        let entries = (self.base()..).zip(&self.entries);
        records.extend(entries.map(|(number, entry)| Record::Entry(number, entry.clone())));
        Submission { key, generation: self.generation, records, acks: Vec::new() }
    }
}

/// The row of a heartbeat.
pub(super) fn beat(heartbeat: Heartbeat) -> Write {
    Write::Put(HEARTBEAT, json(&heartbeat))
}

pub(super) fn json(value: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("what is journaled has string keys and finite numbers")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn submission(generation: u64, records: Vec<Record>) -> Submission {
        Submission { key: 7, generation, records, acks: Vec::new() }
    }

    fn entry(number: u64) -> Record {
        Record::Entry(number, Arc::new(Entry { tick: 0, events: Vec::new() }))
    }

    fn checkpoint(base: u64) -> Record {
        let (versions, snapshot) = (Vec::new(), Vec::new());
        Record::Checkpoint(Arc::new(Checkpoint { base, seq: 0, versions, snapshot }))
    }

    #[test]
    fn a_checkpoint_may_hold_entries_of_its_own_batch_and_none_that_come_later() {
        let mut life = Some(Life { generation: 2, next: 5 });
        assert!(!submission(2, vec![checkpoint(6)]).fits(&mut life));
        assert!(submission(2, vec![entry(5)]).fits(&mut life));
        assert!(submission(2, vec![checkpoint(6)]).fits(&mut life));
        assert_eq!(life, Some(Life { generation: 2, next: 6 }));
    }

    #[test]
    fn nothing_follows_a_deletion_and_nothing_of_an_earlier_life_counts() {
        let mark = || Record::Mark(Mark::default());
        let mut life = Some(Life { generation: 2, next: 5 });
        assert!(!submission(1, vec![mark()]).fits(&mut life));
        assert!(!submission(1, vec![Record::Delete]).fits(&mut life));
        assert!(submission(2, vec![mark()]).fits(&mut life));
        assert!(submission(2, vec![Record::Delete]).fits(&mut life));
        for late in [entry(5), mark(), checkpoint(5), Record::Delete] {
            assert!(!submission(2, vec![late]).fits(&mut life));
        }
        assert_eq!(life, None);
    }
}
