//! What is on its way to be durable of a session, and what the session comes back from with it.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use crate::core::record::{
    Anchor, Checkpoint, Done, Entry, Epochs, Exact, Identity, Lock, RestorePoints, Stored,
};
use crate::core::session::{Answer, Receipts};

/// One thing to be made durable about a session.
#[derive(Clone, Debug)]
pub(crate) enum Part {
    Create(Arc<Identity>, Option<Arc<[u8]>>, Epochs),
    /// Other tokens.
    Identity(Arc<Identity>),
    Entry(u64, Arc<Entry>),
    Anchor(Anchor),
    Epochs(Epochs),
    Checkpoint(Arc<Checkpoint>),
    /// It became what this holds: nothing that happened before says anything any more.
    Reset(Arc<Checkpoint>),
    /// What came of a request that carries a key.
    Done(Arc<Done>),
    /// Locked, or no longer.
    Lock(Option<Lock>),
    /// Which restore points there are.
    Points(Arc<RestorePoints>),
    /// The snapshot of the restore point of a number.
    Point(u64, Arc<[u8]>),
    /// Snapshots of restore points that are no more.
    RemovePoints(Vec<u64>),
    /// All is written anew, but for the snapshots of these restore points.
    Anew(Arc<RestorePoints>),
    Delete,
}

/// What is to be made durable about a session together.
#[derive(Clone, Debug)]
pub(crate) struct Append {
    pub key: u64,
    pub position: u64,
    pub parts: Arc<Vec<Part>>,
    /// Somebody waits for it.
    pub awaited: bool,
    /// Told when it is durable.
    pub receipts: Arc<Receipts>,
}

impl Append {
    /// Whether nobody waits for it and it replaces what came before.
    pub fn can_wait(&self) -> bool {
        !self.awaited && self.parts.iter().all(|part| matches!(part, Part::Anchor(_)))
    }

    /// Whether the world has something to do as soon as it is durable.
    pub fn is_news(&self) -> bool {
        let news = |part: &Part| {
            matches!(
                part,
                Part::Checkpoint(_)
                    | Part::Delete
                    | Part::Identity(_)
                    | Part::Lock(_)
                    | Part::Points(_)
            )
        };
        self.parts.iter().any(news)
    }
}

/// What is on its way to be durable.
pub(crate) struct Pending {
    pub position: u64,
    /// Life of the session that it is of.
    pub life: u64,
    pub parts: Arc<Vec<Part>>,
    awaited: bool,
    /// Who is answered when it is.
    pub replies: Vec<Answer<()>>,
}

impl Pending {
    /// Whether the session has to go back where this is not made durable: somebody has waited for what it
    /// has become.
    fn shows(&self) -> bool {
        let shows =
            |part: &Part| matches!(part, Part::Create(..) | Part::Entry(..) | Part::Reset(_));
        self.awaited || self.parts.iter().any(shows)
    }

    fn deletes(&self) -> bool {
        self.parts.iter().any(|part| matches!(part, Part::Delete))
    }
}

/// What a session comes back from.
pub(crate) struct Record {
    /// What is durable.
    pub stored: Stored,
    /// Whether anything is.
    pub exists: bool,
    /// Counts how often the session has come back.
    pub life: u64,
    /// Of the newest append.
    pub position: u64,
    pending: VecDeque<Pending>,
    receipts: Arc<Receipts>,
}

impl Record {
    /// Of a session that is stored.
    pub fn of(stored: Stored, receipts: Arc<Receipts>) -> Record {
        let pending = VecDeque::new();
        Record { stored, exists: true, life: 0, position: 0, pending, receipts }
    }

    /// Of a session that is to be stored.
    pub fn new(
        identity: Arc<Identity>,
        origin: Option<Arc<[u8]>>,
        epochs: Epochs,
        receipts: Arc<Receipts>,
    ) -> Record {
        Record { exists: false, ..Record::of(Stored::new(identity, origin, epochs), receipts) }
    }

    /// Notes what is on its way.
    pub fn push(&mut self, append: &Append, replies: Vec<Answer<()>>) {
        let &Append { position, awaited, .. } = append;
        let (life, parts) = (self.life, append.parts.clone());
        self.position = position;
        self.pending.push_back(Pending { position, life, parts, awaited, replies });
    }

    /// An append of some parts by themselves.
    pub fn append(&self, key: u64, parts: Vec<Part>) -> Append {
        let (position, receipts) = (self.position + 1, self.receipts.clone());
        Append { key, position, parts: Arc::new(parts), awaited: false, receipts }
    }

    /// What is on its way to delete it, if anything is.
    pub fn deletion(&mut self) -> Option<&mut Pending> {
        self.pending.iter_mut().find(|pending| pending.deletes())
    }

    /// Whether it is being deleted.
    pub fn is_leaving(&self) -> bool {
        self.pending.iter().any(Pending::deletes)
    }

    /// All up to a position is durable. Returns what was on its way until now. Forgets requests that are over
    /// by the store's clock.
    pub fn confirm(&mut self, position: u64, now: Duration) -> Vec<Pending> {
        let count = self.pending.partition_point(|pending| pending.position <= position);
        let confirmed: Vec<Pending> = self.pending.drain(..count).collect();
        for part in confirmed.iter().flat_map(|pending| &*pending.parts) {
            self.exists |= matches!(part, Part::Create(..));
            self.stored.enter(part);
        }
        while self.stored.done.pop_front_if(|done| done.is_over(now)).is_some() {}
        self.stored.weigh();
        confirmed
    }

    /// Nothing that is on its way will be durable. Returns it, and the positions that this is the end of,
    /// where the session has to go back for it.
    pub fn cut(&mut self) -> (Vec<Pending>, Option<(u64, u64)>) {
        let cut: Vec<Pending> = self.pending.drain(..).collect();
        let shows = cut.iter().any(Pending::shows);
        if !shows {
            // How far it has come is so all the same, and will be written with the rest.
            let parts = cut.iter().flat_map(|pending| &*pending.parts);
            parts
                .filter(|part| matches!(part, Part::Anchor(_)))
                .for_each(|it| self.stored.enter(it));
        } else if !matches!(self.stored.anchor.exact, Exact::Fixed(_)) {
            // States were shown that are lost now, whether or not the session comes back to say so itself.
            self.stored.anchor.exact = Exact::Fixed(self.stored.newest_seq());
        }
        let range = cut.first().map(|first| (first.position, self.position));
        (cut, range.filter(|_| shows))
    }

    /// The session as it is stored once all is durable that is on its way.
    pub fn present(&self) -> Stored {
        let mut stored = self.stored.clone();
        self.pending_parts().for_each(|part| stored.enter(part));
        stored
    }

    /// Where the session has come, with all that is on its way.
    pub fn anchor(&self) -> Anchor {
        let anchor = |part: &Part| match part {
            Part::Anchor(anchor) => Some(*anchor),
            _ => None,
        };
        self.pending_parts().rev().find_map(anchor).unwrap_or(self.stored.anchor)
    }

    /// Its restore points, with all that is on its way.
    pub fn points(&self) -> &Arc<RestorePoints> {
        let points = self.pending_parts().rev().find_map(|part| match part {
            Part::Points(points) => Some(points),
            _ => None,
        });
        points.unwrap_or(&self.stored.points)
    }

    /// Tick that it has come to at a beat, as [`Stored::tick_at`], with all that is on its way.
    pub fn tick_at(&self, frame: u64) -> u64 {
        let reached = |part: &Part| match part {
            Part::Entry(_, entry) => Some(entry.reached),
            Part::Reset(_) => Some(0),
            _ => None,
        };
        let stored = self.stored.entries.back().map_or(0, |entry| entry.reached);
        let told = self.pending_parts().rev().find_map(reached).unwrap_or(stored);
        self.anchor().tick_at(frame).max(told)
    }

    fn pending_parts(&self) -> impl DoubleEndedIterator<Item = &Part> {
        self.pending.iter().flat_map(|pending| &*pending.parts)
    }

    /// Where waiting requests learn what is durable.
    pub fn receipts(&self) -> &Arc<Receipts> {
        &self.receipts
    }

    /// Whether something of a position is on its way.
    pub fn awaits(&self, position: u64) -> bool {
        self.pending.iter().any(|pending| pending.position == position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::record::Weight;
    use crate::session::Tokens;
    use firn_protocol::SessionSpec;
    use ulid::Ulid;

    fn record() -> Record {
        let identity = Identity {
            sid: Ulid(7),
            id: "a".to_owned(),
            created_at: "c".to_owned(),
            owner: None,
            weight: Weight::default(),
            tokens: Tokens::generate().unwrap().hashes(),
            spec: SessionSpec::default(),
        };
        let epochs = Epochs::first(identity.sid, 1);
        Record::of(Stored::new(Arc::new(identity), None, epochs), Arc::default())
    }

    fn push(record: &mut Record, part: Part) {
        let append = record.append(7, vec![part]);
        record.push(&append, Vec::new());
    }

    fn entry(number: u64) -> Part {
        Part::Entry(number, Arc::new(Entry { tick: 0, seq: 1, reached: 0, commands: Vec::new() }))
    }

    fn checkpoint(base: u64) -> Part {
        let (versions, snapshot) = (Vec::new(), Vec::new());
        Part::Checkpoint(Arc::new(Checkpoint { base, seq: 0, versions, snapshot }))
    }

    #[test]
    fn what_is_on_its_way_is_part_of_what_a_session_comes_back_from() {
        let mut record = record();
        for part in [entry(0), entry(1), checkpoint(1)] {
            push(&mut record, part);
        }
        let counts = |stored: &Stored| (stored.base(), stored.entries.len());
        assert_eq!([counts(&record.stored), counts(&record.present())], [(0, 0), (1, 1)]);
        assert_eq!(record.confirm(2, Duration::ZERO).len(), 2);
        assert_eq!([counts(&record.stored), counts(&record.present())], [(0, 2), (1, 1)]);
        let (cut, range) = record.cut();
        assert_eq!((cut.len(), range), (1, None), "nobody has seen a checkpoint");
        assert_eq!(counts(&record.present()), (0, 2));
    }

    #[test]
    fn a_session_goes_back_where_somebody_saw_what_is_not_durable() {
        let mut record = record();
        push(&mut record, Part::Anchor(Anchor::default()));
        assert_eq!(record.cut().1, None);
        push(&mut record, Part::Anchor(Anchor::default()));
        push(&mut record, entry(0));
        push(&mut record, Part::Anchor(Anchor::default()));
        assert_eq!(record.cut().1, Some((2, 4)), "with all that was on its way");
        assert_eq!(record.stored.anchor.exact, Exact::Fixed(1), "what was shown since is lost");
        let step =
            Append { awaited: true, ..record.append(7, vec![Part::Anchor(Anchor::default())]) };
        record.push(&step, Vec::new());
        assert_eq!(record.cut().1, Some((5, 5)), "as the end of a step");
        push(&mut record, Part::Delete);
        assert!(record.is_leaving());
        assert_eq!(record.cut().1, None);
    }
}
