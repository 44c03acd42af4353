//! How far a session has come, told once: until something changes that, one heartbeat of the world says so for
//! all sessions.
//!
//! A session is published at most once in a *round*, a frame of the device, with a seq that is an offset plus
//! the number of the round. So how far ticks and seqs have come follows from an anchor and the heartbeat.
//!
//! Every start of a server begins an *epoch* with a name of its own, far above every seq that anybody may have
//! been told. What an epoch had come to when it ended is kept for the last of them: who names an epoch and a
//! seq up to there holds a state that is still known.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};
use ulid::Ulid;

use crate::core::session::ticks_between;

/// Seqs between the end of an epoch and the beginning of the next: more than there are rounds until a batch
/// is stored.
const SKIP: u64 = 1 << 24;

/// Epochs that are remembered.
const REMEMBERED: usize = 16;

/// How far the world has come: beats and rounds. They go on from life to life of the server.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Heartbeat {
    pub frame: u64,
    #[serde(default)]
    pub round: u64,
}

/// How far a session has come at some beat, and how it goes on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Anchor {
    pub tick: u64,
    /// Beat up to which its ticks are counted.
    pub frame: u64,
    /// Ticks per second \[Hz\] from there on; 0 where its time stands still, or somebody steps it.
    pub rate: f64,
    /// What its seqs are ahead of the rounds.
    pub offset: i64,
    /// Which seqs are durable.
    pub exact: Exact,
    /// Fingerprint of what carries its frames out.
    pub adapter: u64,
}

/// Which seqs of a session are durable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Exact {
    /// All up to the heartbeat's round.
    Runs,
    /// All up to this one, and to that of the newest entry.
    Stands(u64),
    /// All up to this one: it went back after that, so later ones may be of states that were lost.
    Fixed(u64),
}

impl Default for Exact {
    fn default() -> Exact {
        Exact::Stands(1)
    }
}

impl Anchor {
    /// The tick that it stands for at a beat.
    pub fn tick_at(&self, frame: u64) -> u64 {
        self.tick.saturating_add(ticks_between(self.rate, self.frame, frame))
    }

    /// The seq of what is published in a round.
    pub fn seq_in(&self, round: u64) -> u64 {
        self.offset.saturating_add_unsigned(round).max(1) as u64
    }

    /// Has the seq of a round be this one.
    pub fn set_seq(&mut self, round: u64, seq: u64) {
        self.offset = (seq as i64).saturating_sub_unsigned(round);
    }

    /// The newest seq whose state is stored.
    pub fn durable(&self, heartbeat: Heartbeat, newest_entry: u64) -> u64 {
        match self.exact {
            Exact::Runs => self.seq_in(heartbeat.round).max(newest_entry),
            Exact::Stands(seq) => seq.max(newest_entry),
            Exact::Fixed(seq) => seq,
        }
    }

    /// Whether it says all that a later one says.
    pub fn holds(&self, later: &Anchor) -> bool {
        let exact = match (self.exact, later.exact) {
            // What has come since came with entries.
            (Exact::Stands(_), Exact::Stands(_)) => true,
            (own, other) => own == other,
        };
        exact
            && self.rate == later.rate
            && self.tick_at(later.frame) == later.tick
            && (self.offset, self.adapter) == (later.offset, later.adapter)
    }
}

/// The epoch of a session, and those before it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Epochs {
    /// Name and first seq of the present one.
    now: (Ulid, u64),
    /// Names, first and last known seqs of those before, the oldest first.
    past: VecDeque<(Ulid, u64, u64)>,
}

impl Epochs {
    /// The first one.
    pub fn first(name: Ulid, seq: u64) -> Epochs {
        Epochs { now: (name, seq), past: VecDeque::new() }
    }

    /// Name of the present one.
    pub fn name(&self) -> String {
        self.now.0.to_string()
    }

    /// First seq of the present one.
    pub fn first_seq(&self) -> u64 {
        self.now.1
    }

    /// Begins one; of the present one all is known up to a seq.
    pub fn begin(&mut self, name: Ulid, durable: u64) {
        let (ended, first) = self.now;
        // Above every span that is kept, and every seq that may have been told.
        self.now = (name, durable.max(first).saturating_add(SKIP));
        self.past.push_back((ended, first, durable));
        if self.past.len() > REMEMBERED {
            self.past.pop_front();
        }
    }

    /// Whatever is later than a seq is not known: it was of another device.
    pub fn bound(&mut self, seq: u64) {
        self.past.iter_mut().for_each(|(.., last)| *last = (*last).min(seq));
    }

    /// Whether all that has changed since a state is known, where `newest` is the newest seq.
    pub fn recovers(&self, epoch: &str, seq: u64, newest: u64) -> bool {
        let (name, first) = self.now;
        let spans = self.past.iter().copied().chain([(name, first, newest)]);
        let named = Ulid::from_string(epoch);
        let holds = |(name, first, last): (Ulid, u64, u64)| {
            named == Ok(name) && (first..=last).contains(&seq)
        };
        spans.into_iter().any(holds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn anchor() -> Anchor {
        let (rate, exact) = (20.0, Exact::Runs);
        Anchor { tick: 100, frame: 600, rate, offset: 20, exact, adapter: 0 }
    }

    #[test]
    fn time_goes_on_with_the_beat_and_seqs_with_the_rounds() {
        let ticks = [0, 600, 602, 603, 660].map(|frame| anchor().tick_at(frame));
        assert_eq!(ticks, [100, 100, 100, 101, 120]);
        let heartbeat = Heartbeat { frame: 660, round: 80 };
        assert_eq!(anchor().durable(heartbeat, 0), 100);
        assert_eq!(anchor().durable(heartbeat, 115), 115, "a change after the heartbeat");
        let stands = Anchor { exact: Exact::Stands(90), ..anchor() };
        assert_eq!([0, 95].map(|entry| stands.durable(heartbeat, entry)), [90, 95]);
        let fixed = Anchor { exact: Exact::Fixed(50), ..anchor() };
        assert_eq!(fixed.durable(heartbeat, 115), 50);
        let mut other = anchor();
        other.set_seq(7, 1);
        assert_eq!([7, 8, 107].map(|round| other.seq_in(round)), [1, 2, 101]);
    }

    #[test]
    fn an_anchor_holds_until_something_else_happens() {
        let later = Anchor { tick: 120, frame: 660, ..anchor() };
        assert!(anchor().holds(&later));
        for other in [
            Anchor { tick: 119, ..later },
            Anchor { rate: 0.0, ..later },
            Anchor { rate: 21.0, ..later },
            Anchor { offset: 21, ..later },
            Anchor { exact: Exact::Fixed(7), ..later },
            Anchor { adapter: 1, ..later },
        ] {
            assert!(!anchor().holds(&other), "{other:?}");
        }
        let stands = |seq| Anchor { rate: 0.0, exact: Exact::Stands(seq), ..anchor() };
        assert!(stands(5).holds(&stands(9)));
    }

    #[test]
    fn what_was_durable_stays_known_and_nothing_else_does() {
        let names = [1, 2, 3].map(Ulid);
        let [one, two, three] = names.map(|name| name.to_string());
        let mut epochs = Epochs::first(names[0], 1);
        assert!(epochs.recovers(&one, 7, 7) && !epochs.recovers(&one, 8, 7));
        assert!(!epochs.recovers(&one, 0, 7) && !epochs.recovers("other", 1, 7));
        epochs.begin(names[1], 100);
        let first = epochs.first_seq();
        assert!(first > 100);
        assert!(epochs.recovers(&one, 100, first + 5) && !epochs.recovers(&one, 101, first + 5));
        assert!(epochs.recovers(&two, first, first) && !epochs.recovers(&two, 100, first));
        // Nothing was stored in the second one.
        epochs.begin(names[2], 50);
        assert!(epochs.first_seq() > first);
        assert!(!epochs.recovers(&two, first, u64::MAX) && epochs.recovers(&one, 100, u64::MAX));
        assert!(epochs.recovers(&three, epochs.first_seq(), u64::MAX));
        epochs.bound(60);
        assert!(epochs.recovers(&one, 60, u64::MAX) && !epochs.recovers(&one, 61, u64::MAX));
        for name in 10..40 {
            epochs.begin(Ulid(name), 0);
        }
        assert!(epochs.past.len() == REMEMBERED && !epochs.recovers(&one, 60, u64::MAX));
    }
}
