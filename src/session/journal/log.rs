//! What has happened to one session and is still to be handed to the journal.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::machine;
use crate::session::handle::Session;
use crate::session::once::Done;
use crate::session::simulation::Simulation;
use crate::session::snapshot::Snapshot;

use super::{Append, Entry, Event, Identity, Mark, Part, Record, Rest, Stored};

/// Entries after which a checkpoint is due, however young the last is.
const LONGEST_JOURNAL: u64 = 8192;

/// Time after a checkpoint that failed before the next is tried.
const RETRY: Duration = Duration::from_secs(1);

/// What one session has to tell the journal.
#[derive(Default)]
pub(crate) struct Log {
    /// Counts how often the session was brought back.
    life: u64,
    /// Of the newest append.
    position: u64,
    /// Number of the next entry.
    next: u64,
    /// Entries that the newest checkpoint holds.
    covered: u64,
    /// Tick of the first event.
    tick: u64,
    events: Vec<Event>,
    /// Somebody waits until what the frame leaves is durable.
    awaited: bool,
    /// What came of requests that carry a key.
    answered: Vec<Arc<Done>>,
    /// The session is still to be written.
    create: Option<Part>,
    /// Snapshot taken for a checkpoint.
    pub taken: Option<Box<Taken>>,
    /// As last submitted.
    mark: Mark,
    /// What is stored says something else.
    unmarked: bool,
    /// Since when the newest checkpoint is not the state any more.
    outdated: Option<Instant>,
    /// Earliest time for the next, where one has failed.
    not_before: Option<Instant>,
}

/// How far a session has come.
struct Progress {
    tick: u64,
    seq: u64,
    rest: Option<Rest>,
}

/// A snapshot that is to be a checkpoint.
pub(crate) struct Taken {
    pub snapshot: Snapshot,
    pub seq: u64,
    pub versions: Vec<u64>,
}

impl Log {
    /// Of a session that is being created.
    pub fn created(
        identity: Arc<Identity>,
        origin: Option<Arc<[u8]>>,
        done: Option<Arc<Done>>,
    ) -> Log {
        Log {
            create: Some(Part::Create(identity, origin)),
            answered: done.into_iter().collect(),
            outdated: Some(machine::now()),
            ..Log::default()
        }
    }

    /// Of a session that is brought back.
    pub fn resumed(record: &Record, stored: &Stored) -> Log {
        let outdated = stored.checkpoint.is_none() || !stored.entries.is_empty();
        Log {
            life: record.life,
            position: record.position,
            next: stored.next(),
            covered: stored.base(),
            mark: stored.mark.clone(),
            unmarked: true,
            outdated: outdated.then(machine::now),
            ..Log::default()
        }
    }

    /// Counts how often the session was brought back.
    pub fn life(&self) -> u64 {
        self.life
    }

    /// Position that somebody waits for and nothing was handed over for.
    pub fn unkept(&self) -> Option<u64> {
        self.awaited.then_some(self.position + 1)
    }

    /// Goes on from an append that something else has left.
    pub fn go_on_from(&mut self, position: u64) {
        self.position = position;
    }

    /// Notes a change that goes with the next frame.
    pub fn record(&mut self, tick: u64, event: Event) {
        if self.events.is_empty() {
            self.tick = tick;
        }
        self.events.push(event);
    }

    /// Notes what came of a request that carries a key, with the change that it made.
    pub fn answered(&mut self, done: Done) {
        self.answered.push(Arc::new(done));
    }

    /// Position of what this frame leaves: somebody waits until that is durable.
    pub fn receipt(&mut self) -> u64 {
        self.awaited = true;
        self.position + 1
    }

    /// Notes seqs whose states are lost. Returns all of them.
    pub fn lose(&mut self, first: u64, last: u64) -> &[(u64, u64)] {
        self.mark.lose(first, last);
        &self.mark.lost
    }

    /// Notes that cells may have changed.
    pub fn outdate(&mut self) {
        self.outdated.get_or_insert_with(machine::now);
    }

    /// Whether the newest checkpoint is the present state, but for its clock.
    pub fn is_covered(&self) -> bool {
        self.outdated.is_none()
    }

    /// When a checkpoint is due that is made some time after a change.
    pub fn checkpoint_due(&self, interval: Duration) -> Option<Instant> {
        let since = self.outdated?;
        if self.next - self.covered >= LONGEST_JOURNAL {
            return Some(since);
        }
        since.checked_add(interval)
    }

    /// Whether its newest mark says that it is at rest.
    pub fn rests(&self) -> bool {
        self.mark.rest.is_some()
    }

    /// Notes that the newest checkpoint did not come to be; the one before it holds all entries below
    /// `base`.
    pub fn uncover(&mut self, base: u64) {
        self.covered = base;
        self.outdate();
        self.not_before = machine::now().checked_add(RETRY);
    }

    /// When a checkpoint may be made that is wanted at some time: not at once after one that failed.
    pub fn checkpoint_at(&self, wanted: Option<Instant>) -> Option<Instant> {
        wanted.map(|wanted| self.not_before.map_or(wanted, |earliest| wanted.max(earliest)))
    }

    /// Notes that a checkpoint of the present state has been taken.
    fn cover(&mut self) {
        self.covered = self.next;
        self.outdated = None;
    }

    /// Whether the last frame left anything to be made durable; `ran` says whether it had cycles.
    fn has_news(&mut self, ran: bool) -> bool {
        if ran || !self.events.is_empty() {
            self.outdate();
        }
        let waited_for = self.awaited || self.create.is_some() || self.taken.is_some();
        waited_for || !self.events.is_empty()
    }

    /// What the last frame left to be made durable.
    fn take(&mut self, session: &Session, progress: Progress) -> Append {
        let mut parts = Vec::with_capacity(3);
        parts.extend(self.create.take());
        if !self.events.is_empty() {
            let events = std::mem::take(&mut self.events);
            let entry = Entry { tick: self.tick, events };
            parts.push(Part::Entry(self.next, Arc::new(entry)));
            self.next += 1;
        }
        parts.push(Part::Mark(self.set_mark(self.mark_of(progress))));
        parts.extend(self.answered.drain(..).map(Part::Done));
        let awaited = std::mem::take(&mut self.awaited);
        self.append(session, parts, awaited)
    }

    fn append(&mut self, session: &Session, parts: Vec<Part>, awaited: bool) -> Append {
        self.position += 1;
        let (key, position, receipts) = (session.key, self.position, session.receipts.clone());
        Append { key, position, parts: Arc::new(parts), awaited, receipts }
    }

    fn mark_of(&self, Progress { tick, seq, rest }: Progress) -> Mark {
        Mark { tick, seq, next: self.next, lost: self.mark.lost.clone(), rest }
    }

    fn set_mark(&mut self, mark: Mark) -> Mark {
        self.unmarked = false;
        self.mark = mark.clone();
        mark
    }
}

/// What a frame has left of a session for the journal.
pub(crate) struct Left {
    pub append: Option<Append>,
    /// Life of the session, number of the first entry that is not in it, and the snapshot.
    pub checkpoint: Option<(u64, u64, Box<Taken>)>,
}

impl Left {
    /// Whether there is nothing for the journal.
    pub fn is_nothing(&self) -> bool {
        self.append.is_none() && self.checkpoint.is_none()
    }
}

impl Simulation {
    /// What the last frame has left for the journal: nothing in the middle of a run.
    pub(in crate::session) fn leave(&mut self) -> Left {
        if self.portions.are_under_way() {
            return Left { append: None, checkpoint: None };
        }
        let ran = self.flight.advance.run.cycles > 0;
        let append = self.log.has_news(ran).then(|| {
            let progress = self.progress();
            self.log.take(&self.session, progress)
        });
        let checkpoint = self.log.taken.take().map(|taken| {
            self.log.cover();
            (self.log.life, self.log.next, taken)
        });
        Left { append, checkpoint }
    }

    /// How far the session has come, where that is known.
    pub(in crate::session) fn present_mark(&self) -> Option<Mark> {
        let known = !self.portions.are_under_way() && self.replay.is_none();
        known.then(|| self.log.mark_of(self.progress()))
    }

    /// A mark, where the newest one does not say how far the session has come. In the middle of a
    /// run it has not come further than before.
    pub(in crate::session) fn mark(&mut self) -> Option<Append> {
        if self.portions.are_under_way() {
            return None;
        }
        let mark = self.log.mark_of(self.progress());
        let known = !self.log.unmarked && self.log.mark.holds(&mark);
        if known || self.log.create.is_some() {
            return None;
        }
        let mark = self.log.set_mark(mark);
        Some(self.log.append(&self.session, vec![Part::Mark(mark)], false))
    }

    fn progress(&self) -> Progress {
        let (tick, tick_rate) = (self.state.clock.tick(), self.state.clock.tick_rate());
        let rest = self.passes().then_some(Rest { since: self.frame, tick_rate });
        Progress { tick, seq: self.session.mirror().seq, rest }
    }
}

impl std::fmt::Debug for Log {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Log").field("next", &self.next).finish_non_exhaustive()
    }
}

impl std::fmt::Debug for Taken {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Taken").field("seq", &self.seq).finish_non_exhaustive()
    }
}
