//! What is durable, as an image in memory, and what is written to it.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::Arc;

use serde::de::DeserializeOwned;

use crate::session::once::Done;
use crate::store::{Content, Kind, Row, Write};

use super::{Ack, Checkpoint, Entry, Identity, Mark};

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
    pub mark: Mark,
    /// What came of requests that carry a key, the oldest first.
    pub done: VecDeque<Arc<Done>>,
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
    /// Whether nobody waits for it and it replaces what came before.
    pub fn can_wait(&self) -> bool {
        self.acks.is_empty() && self.records.iter().all(|record| matches!(record, Record::Mark(_)))
    }

    /// Whether it removes the session.
    pub fn deletes(&self) -> bool {
        self.records.iter().any(|record| matches!(record, Record::Delete))
    }

    /// Whether it belongs to what is in the image.
    pub fn fits(&self, image: &Image) -> bool {
        match image.get(&self.key) {
            None => matches!(self.records.first(), Some(Record::Create(..))),
            Some(stored) => {
                let durable = |record: &Record| match record {
                    Record::Checkpoint(checkpoint) => checkpoint.base <= stored.next(),
                    _ => true,
                };
                stored.generation == self.generation && self.records.iter().all(durable)
            }
        }
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
                    mark: Mark::default(),
                    done: VecDeque::new(),
                    generation: self.generation,
                };
                image.insert(self.key, stored);
            } else if matches!(record, Record::Delete) {
                image.remove(&self.key);
            } else if let Some(stored) = image.get_mut(&self.key) {
                stored.enter(record);
            }
        }
    }
}

impl Stored {
    fn enter(&mut self, record: &Record) {
        match record {
            Record::Identity(identity) => self.identity = identity.clone(),
            Record::Entry(_, entry) => self.entries.push_back(entry.clone()),
            Record::Mark(mark) => self.mark = mark.clone(),
            Record::Checkpoint(checkpoint) => {
                let covered = checkpoint.base.saturating_sub(self.base()) as usize;
                self.entries.drain(..covered.min(self.entries.len()));
                self.checkpoint = Some(checkpoint.clone());
            }
            Record::Done(done) => self.done.push_back(done.clone()),
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
        let entries = (self.base()..).zip(&self.entries);
        records.extend(entries.map(|(number, entry)| Record::Entry(number, entry.clone())));
        Submission { key, generation: self.generation, records, acks: Vec::new() }
    }
}

/// Puts rows together to sessions; and says of each that is not whole what is missing.
pub(crate) fn assemble(rows: BTreeMap<Row, Content>) -> (BTreeMap<u64, Stored>, Vec<String>) {
    let mut by_session: BTreeMap<u64, Vec<(Row, Content)>> = BTreeMap::new();
    for (row, content) in rows {
        by_session.entry(row.session).or_default().push((row, content));
    }
    let mut names: HashMap<String, u64> = HashMap::new();
    let (mut whole, mut broken) = (BTreeMap::new(), Vec::new());
    for (key, rows) in by_session {
        match put_together(rows) {
            Ok(stored) => {
                // The newer of two sessions of one name has it.
                if let Some(older) = names.insert(stored.identity.id.clone(), key) {
                    whole.remove(&older);
                    let id = &stored.identity.id;
                    broken.push(format!("an older session '{id}' (key {older}): name taken"));
                }
                whole.insert(key, stored);
            }
            Err(why) => broken.push(format!("{why} (key {key})")),
        }
    }
    (whole, broken)
}

fn put_together(rows: Vec<(Row, Content)>) -> Result<Stored, String> {
    let all =
        |kind| rows.iter().filter(move |(row, _)| row.kind == kind).map(|(_, content)| content);
    let one = |kind| all(kind).next();
    let identity: Identity = one(Kind::Identity)
        .and_then(|content| parse(&content.bytes))
        .ok_or("a session without a name")?;
    let id = identity.id.clone();
    let missing = |what: &str| format!("the session '{id}': {what}");
    let mark = one(Kind::Mark).ok_or_else(|| missing("how far it had come is not known"))?;
    let marked = mark.batch;
    let mark: Mark = parse(&mark.bytes).ok_or_else(|| missing("its mark can't be read"))?;
    let checkpoint = match one(Kind::Checkpoint) {
        None => None,
        Some(content) => Some(
            Checkpoint::decode(&content.bytes)
                .ok_or_else(|| missing("its checkpoint can't be read"))?,
        ),
    };
    let base = checkpoint.as_ref().map_or(0, |checkpoint| checkpoint.base);
    let mut entries = VecDeque::new();
    for (row, content) in &rows {
        // Left over in a damaged file: replaced by the checkpoint, or undone before the mark.
        let undone = row.number >= mark.next && content.batch < marked;
        if row.kind != Kind::Entry || row.number < base || undone {
            continue;
        }
        let entry: Entry = parse(&content.bytes)
            .filter(|_| row.number == base + entries.len() as u64)
            .ok_or_else(|| missing("changes are missing from its journal"))?;
        entries.push_back(Arc::new(entry));
    }
    if base + (entries.len() as u64) < mark.next {
        return Err(missing("the last changes are missing from its journal"));
    }
    let done = all(Kind::Answer).filter_map(|content| parse::<Done>(&content.bytes));
    let mut done: Vec<Arc<Done>> = done.map(Arc::new).collect();
    done.sort_by_key(|done| done.at);
    let done = VecDeque::from(done);
    Ok(Stored {
        identity: Arc::new(identity),
        origin: one(Kind::Origin).map(|content| content.bytes.clone().into()),
        checkpoint: checkpoint.map(Arc::new),
        entries,
        mark,
        done,
        generation: 0,
    })
}

fn json(value: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("what is journaled has string keys and finite numbers")
}

fn parse<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    serde_json::from_slice(bytes).ok()
}
