//! What has happened to one session and is still to be handed to the journal.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::core::record::{
    Anchor, Append, Checkpoint, Done, Entry, Epochs, Exact, Identity, Part, Record, Stored,
};
use crate::core::session::{Command, Outlet, Simulation};
use crate::core::snapshot::Snapshot;

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
    /// Tick of the first command.
    tick: u64,
    commands: Vec<Command>,
    /// The snapshot, as bytes, of the state in which it began anew before them.
    begins_with: Option<Vec<u8>>,
    /// Somebody waits until what the frame leaves is durable.
    awaited: bool,
    /// Results of requests that carry a key.
    answered: Vec<Arc<Done>>,
    /// The session is still to be written.
    create: Option<Part>,
    /// Snapshot taken for a checkpoint.
    pub taken: Option<Box<Taken>>,
    /// How far it had come, as last submitted.
    anchor: Anchor,
    /// What is stored says something else.
    unanchored: bool,
    /// The newest seq that is sure to be of a state that was not lost, where the session went back.
    fixed: Option<u64>,
    /// Since when the newest checkpoint is not the state any more.
    outdated: Option<Instant>,
    /// Earliest time for the next, where one has failed.
    not_before: Option<Instant>,
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
        epochs: Epochs,
        anchor: Anchor,
        done: Option<Arc<Done>>,
        now: Instant,
    ) -> Log {
        Log {
            create: Some(Part::Create(identity, origin, epochs)),
            anchor,
            unanchored: true,
            answered: done.into_iter().collect(),
            outdated: Some(now),
            ..Log::default()
        }
    }

    /// Of a session that is brought back.
    pub fn resumed(record: &Record, stored: &Stored, now: Instant) -> Log {
        let outdated = stored.checkpoint.is_none() || !stored.entries.is_empty();
        Log {
            life: record.life,
            position: record.position,
            next: stored.next(),
            covered: stored.base(),
            anchor: stored.anchor,
            unanchored: true,
            fixed: match stored.anchor.exact {
                Exact::Fixed(seq) => Some(seq),
                Exact::Runs | Exact::Stands(_) => None,
            },
            outdated: outdated.then_some(now),
            ..Log::default()
        }
    }

    /// Counts how often the session was brought back.
    pub fn life(&self) -> u64 {
        self.life
    }

    /// Number of the next entry.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// The newest position that anybody was told.
    pub fn last_told(&self) -> u64 {
        self.position + u64::from(self.awaited)
    }

    /// Goes on from an append that something else has left.
    pub fn go_on_from(&mut self, position: u64) {
        self.position = position;
    }

    /// Notes a change that goes with the next frame.
    pub fn record(&mut self, tick: u64, command: Command) {
        if self.commands.is_empty() {
            self.tick = tick;
        }
        self.commands.push(command);
    }

    /// Notes that the session becomes what a snapshot holds: what was to go with the next frame is superseded.
    pub fn begin_anew(&mut self, snapshot: Vec<u8>) {
        self.commands.clear();
        self.begins_with = Some(snapshot);
    }

    /// Whether the newest checkpoint that was taken is one of some base.
    pub fn is_covered_by(&self, base: u64) -> bool {
        self.covered == base
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

    /// The seq of what is published in a round.
    pub fn seq_in(&self, round: u64) -> u64 {
        self.anchor.seq_in(round)
    }

    /// Notes that a checkpoint is stored that holds all that was published before.
    pub fn release(&mut self) {
        self.fixed = None;
    }

    /// Notes that cells may have changed.
    pub fn outdate(&mut self, now: Instant) {
        self.outdated.get_or_insert(now);
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

    /// Whether its newest anchor says that its time goes on.
    pub fn ticks(&self) -> bool {
        self.anchor.rate > 0.0
    }

    /// Notes that the newest checkpoint did not come to be; the one before it holds all entries below
    /// `base`.
    pub fn uncover(&mut self, base: u64, now: Instant) {
        self.covered = base;
        self.outdate(now);
        self.not_before = now.checked_add(RETRY);
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
    fn has_news(&mut self, ran: bool, now: Instant) -> bool {
        let changed = !self.commands.is_empty() || self.begins_with.is_some();
        if ran || changed {
            self.outdate(now);
        }
        let waited_for = self.awaited || self.create.is_some() || self.taken.is_some();
        waited_for || changed
    }

    /// What the last frame left to be made durable; `seq` is that of its publication.
    fn take(&mut self, session: &Outlet, seq: u64, anchor: Anchor) -> Append {
        let mut parts = Vec::with_capacity(3);
        parts.extend(self.create.take());
        if let Some(snapshot) = self.begins_with.take() {
            // It takes the number of an entry: what is made of an earlier state has another base.
            self.next += 1;
            self.covered = self.next;
            let (base, versions) = (self.next, session.mirror().versions().to_vec());
            parts.push(Part::Reset(Arc::new(Checkpoint { base, seq, versions, snapshot })));
        }
        if !self.commands.is_empty() {
            let commands = std::mem::take(&mut self.commands);
            let entry = Entry { tick: self.tick, seq, reached: anchor.tick, commands };
            parts.push(Part::Entry(self.next, Arc::new(entry)));
            self.next += 1;
        }
        parts.extend(self.change_anchor(anchor).map(Part::Anchor));
        parts.extend(self.answered.drain(..).map(Part::Done));
        let awaited = std::mem::take(&mut self.awaited);
        self.append(session, parts, awaited)
    }

    /// Where a session has come, unless the newest anchor says so.
    fn change_anchor(&mut self, anchor: Anchor) -> Option<Anchor> {
        if !self.unanchored && self.anchor.holds(&anchor) {
            return None;
        }
        self.unanchored = false;
        self.anchor = anchor;
        Some(anchor)
    }

    fn append(&mut self, session: &Outlet, parts: Vec<Part>, awaited: bool) -> Append {
        self.position += 1;
        let (key, position, receipts) = (session.key, self.position, session.receipts.clone());
        Append { key, position, parts: Arc::new(parts), awaited, receipts }
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
    pub(crate) fn leave(&mut self, now: Instant) -> Left {
        if self.portions.are_under_way() {
            return Left { append: None, checkpoint: None };
        }
        let ran = self.flight.advance.run.cycles > 0 || self.flight.weathered > 0;
        let append = self.log.has_news(ran, now).then(|| {
            let (seq, anchor) = (self.session.mirror().seq, self.anchor());
            self.log.take(&self.session, seq, anchor)
        });
        let checkpoint = self.log.taken.take().map(|taken| {
            self.log.cover();
            (self.log.life, self.log.next, taken)
        });
        Left { append, checkpoint }
    }

    /// How far the session has come. In the middle of a run it has not come further than before.
    pub(crate) fn anchor(&self) -> Anchor {
        let before = self.flight.clock_before.filter(|_| self.portions.are_under_way());
        let (tick, clock) = match before {
            Some(before) => (before.tick(), before),
            // Ticks that are owed are about to be taken.
            None => (self.state.clock.tick() + self.owed, self.state.clock),
        };
        let rate = if self.follows_the_beat() { clock.tick_rate() } else { 0.0 };
        let exact = match self.log.fixed {
            Some(seq) => Exact::Fixed(seq),
            None if rate > 0.0 => Exact::Runs,
            None => Exact::Stands(self.session.mirror().seq),
        };
        Anchor { tick, frame: self.frame, rate, exact, ..self.log.anchor }
    }

    /// An anchor, where the newest one does not say how far the session has come.
    pub(crate) fn change_anchor(&mut self) -> Option<Append> {
        if self.log.create.is_some() {
            return None;
        }
        let anchor = self.anchor();
        let anchor = self.log.change_anchor(anchor)?;
        Some(self.log.append(&self.session, vec![Part::Anchor(anchor)], false))
    }

    /// Whether its ticks fall on the beat.
    fn follows_the_beat(&self) -> bool {
        !self.state.settings.paused && !self.frozen && self.step.is_none() && self.replay.is_none()
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
