//! What is durable of a session: it can be brought back from that.

use std::collections::VecDeque;
use std::sync::Arc;

use crate::core::record::{
    Anchor, Checkpoint, Done, Entry, Epochs, Identity, Lock, Part, RestorePoints,
};

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
    /// How far it has come.
    pub anchor: Anchor,
    pub epochs: Epochs,
    /// Results of requests that carry a key, the oldest first.
    pub done: VecDeque<Arc<Done>>,
    /// Where it came back from a damaged file.
    pub lock: Option<Lock>,
    pub points: Arc<RestorePoints>,
    /// Restore points that are no more, of which the snapshots may still be stored.
    pub gone_points: Vec<u64>,
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

    /// Tick that it has come to at a beat: no earlier one than anybody was told with a change.
    pub fn tick_at(&self, frame: u64) -> u64 {
        let told = self.entries.back().map_or(0, |entry| entry.reached);
        self.anchor.tick_at(frame).max(told)
    }

    /// The newest seq of what is stored of it, as far as a checkpoint or an entry tells.
    pub fn newest_seq(&self) -> u64 {
        let checkpoint = self.checkpoint.as_ref().map_or(1, |checkpoint| checkpoint.seq);
        self.entries.back().map_or(checkpoint, |entry| entry.seq.max(checkpoint))
    }
}

impl Stored {
    /// As it begins.
    pub fn new(identity: Arc<Identity>, origin: Option<Arc<[u8]>>, epochs: Epochs) -> Stored {
        Stored {
            identity,
            origin,
            checkpoint: None,
            entries: VecDeque::new(),
            entry_bytes: 0,
            anchor: Anchor::default(),
            epochs,
            done: VecDeque::new(),
            lock: None,
            points: Arc::default(),
            gone_points: Vec::new(),
        }
    }

    pub(crate) fn enter(&mut self, part: &Part) {
        match part {
            Part::Identity(identity) => self.identity = identity.clone(),
            // Of a pause at the start, which it holds already.
            Part::Entry(number, _) if *number < self.next() => {}
            Part::Entry(_, entry) => {
                self.entry_bytes += entry.bytes();
                self.entries.push_back(entry.clone());
            }
            Part::Anchor(anchor) => self.anchor = *anchor,
            Part::Epochs(epochs) => self.epochs = epochs.clone(),
            Part::Checkpoint(checkpoint) | Part::Reset(checkpoint) => {
                let covered = checkpoint.base.saturating_sub(self.base()) as usize;
                let covered = self.entries.drain(..covered.min(self.entries.len()));
                self.entry_bytes -= covered.map(|entry| entry.bytes()).sum::<usize>();
                self.checkpoint = Some(checkpoint.clone());
            }
            Part::Done(done) => self.done.push_back(done.clone()),
            Part::Lock(lock) => self.lock = *lock,
            Part::Points(points) => {
                let kept: Vec<u64> = points.numbers().collect();
                let gone = self.points.numbers().filter(|number| !kept.contains(number));
                self.gone_points.extend(gone);
                self.points = points.clone();
            }
            Part::RemovePoints(removed) => {
                self.gone_points.retain(|number| !removed.contains(number));
            }
            Part::Create(..) | Part::Point(..) | Part::Anew(_) | Part::Delete => {}
        }
    }

    /// Everything of it, to be written anew.
    pub fn parts(&self) -> Vec<Part> {
        let mut parts = vec![
            Part::Anew(self.points.clone()),
            Part::Create(self.identity.clone(), self.origin.clone(), self.epochs.clone()),
            Part::Anchor(self.anchor),
        ];
        parts.extend(self.checkpoint.clone().map(Part::Checkpoint));
        parts.extend(self.done.iter().cloned().map(Part::Done));
        parts.extend((!self.points.is_empty()).then(|| Part::Points(self.points.clone())));
        parts.extend(self.lock.map(|lock| Part::Lock(Some(lock))));
        let entries = (self.base()..).zip(&self.entries);
        parts.extend(entries.map(|(number, entry)| Part::Entry(number, entry.clone())));
        parts
    }
}
