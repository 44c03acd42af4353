//! What is written about a session.

use firn_protocol::SessionSpec;
use serde::{Deserialize, Serialize};

use crate::session::change::Change;
use crate::session::clock::ticks_between;
use crate::session::token::TokenHashes;

use super::Weight;

/// Ranges of lost seqs that are remembered one by one.
const MOST_LOST: usize = 16;

/// Who a session is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Identity {
    pub id: String,
    pub epoch: String,
    /// RFC 3339.
    pub created_at: String,
    /// Name of the tenant it belongs to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub owner: Option<String>,
    /// Memory that the journal holds of the session.
    #[serde(skip)]
    pub weight: Weight,
    #[serde(flatten)]
    pub tokens: TokenHashes,
    pub spec: SessionSpec,
}

/// Something that happened to a session and not by the passing of time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Event {
    /// A change, with a name for a collider that had none.
    Change(Change),
    /// Back to the state it was created in.
    Reset,
}

/// What happened to a session in one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Entry {
    /// Tick at which it happened.
    pub tick: u64,
    pub events: Vec<Event>,
}

/// How far a session has come.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Mark {
    pub tick: u64,
    /// Newest published seq.
    pub seq: u64,
    /// Entries written so far, those that a checkpoint has replaced included.
    pub next: u64,
    /// Seqs, first and last, whose states were lost.
    pub lost: Vec<(u64, u64)>,
    /// Where its ticks pass by themselves, and the heartbeat says how many have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest: Option<Rest>,
}

/// A session in which nothing moves while its time goes on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Rest {
    /// Frame up to which its ticks are counted in the mark.
    pub since: u64,
    /// Ticks per second \[Hz\] from there on.
    pub tick_rate: f64,
}

/// How far the world has come, in frames. They go on from life to life of the server.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Heartbeat {
    pub frame: u64,
}

impl Mark {
    /// The tick that it stands for once the world has come to a frame.
    pub fn tick_at(&self, frame: u64) -> u64 {
        let passed = self.rest.map_or(0, |rest| ticks_between(rest.tick_rate, rest.since, frame));
        self.tick.saturating_add(passed)
    }

    /// Whether it says all that another one says, which was made later.
    pub fn holds(&self, later: &Mark) -> bool {
        let (own, other) = (self.rest, later.rest);
        let frame = other.map_or(0, |rest| rest.since);
        own.map(|rest| rest.tick_rate) == other.map(|rest| rest.tick_rate)
            && self.tick_at(frame) == later.tick
            && (self.seq, self.next, &self.lost) == (later.seq, later.next, &later.lost)
    }

    /// Has its time stand still at the tick that it stands for at a frame.
    pub fn stop_at(&mut self, frame: u64) {
        self.tick = self.tick_at(frame);
        self.rest = None;
    }

    /// Adds a range of lost seqs. The oldest are joined where they are too many: resuming at a seq
    /// below them is refused, which is safe.
    pub fn lose(&mut self, first: u64, last: u64) {
        if first > last {
            return;
        }
        self.lost.push((first, last));
        if self.lost.len() > MOST_LOST {
            let (_, last) = self.lost.remove(0);
            self.lost[0] = (0, self.lost[0].1.max(last));
        }
    }
}

/// A session at some tick.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Checkpoint {
    /// Number of the first entry that is not in it.
    pub base: u64,
    /// Newest published seq.
    pub seq: u64,
    /// Seq at which each tile last changed.
    pub versions: Vec<u64>,
    /// The snapshot, encoded.
    pub snapshot: Vec<u8>,
}

impl Checkpoint {
    /// As bytes: base, seq, number of tiles, their versions, the snapshot.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(24 + self.versions.len() * 8 + self.snapshot.len());
        for number in [self.base, self.seq, self.versions.len() as u64] {
            bytes.extend(number.to_le_bytes());
        }
        self.versions.iter().for_each(|version| bytes.extend(version.to_le_bytes()));
        bytes.extend(&self.snapshot);
        bytes
    }

    /// Reads what `encode` wrote; `None` for anything else.
    pub fn decode(bytes: &[u8]) -> Option<Checkpoint> {
        let mut rest = bytes;
        let mut number = || {
            let (number, after) = rest.split_first_chunk::<8>()?;
            rest = after;
            Some(u64::from_le_bytes(*number))
        };
        let (base, seq, count) = (number()?, number()?, number()?);
        if count > bytes.len() as u64 / 8 {
            return None;
        }
        let versions = (0..count).map(|_| number()).collect::<Option<_>>()?;
        Some(Checkpoint { base, seq, versions, snapshot: rest.to_vec() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use firn_protocol::SettingsPatch;

    #[test]
    fn a_checkpoint_is_read_as_it_was_written() {
        let checkpoint =
            Checkpoint { base: 3, seq: 9, versions: vec![1, 9, 4], snapshot: b"snow".to_vec() };
        let bytes = checkpoint.encode();
        assert_eq!(Checkpoint::decode(&bytes), Some(checkpoint));
        for length in 0..48 {
            assert_eq!(Checkpoint::decode(&bytes[..length]), None, "{length}");
        }
        assert_eq!(Checkpoint::decode(&[0xff; 64]), None);
    }

    #[test]
    fn a_session_of_a_version_that_knew_no_tenants_is_the_operators() {
        let tokens = crate::session::token::Tokens::generate().unwrap().hashes();
        let (id, epoch, created_at) = ("a".to_owned(), "b".to_owned(), "c".to_owned());
        let (spec, weight) = (SessionSpec::default(), Weight::default());
        let owner = Some("alpine".to_owned());
        let own = Identity { id, epoch, created_at, owner, weight, tokens, spec };
        let mut text = serde_json::to_value(&own).unwrap();
        let read = |text: &serde_json::Value| serde_json::from_value::<Identity>(text.clone());
        assert_eq!(read(&text).unwrap().owner, own.owner);
        text.as_object_mut().unwrap().remove("owner");
        assert_eq!(read(&text).unwrap().owner, None);
        // What the operator owns is written as it was then.
        assert_eq!(serde_json::to_value(Identity { owner: None, ..own }).unwrap(), text);
    }

    #[test]
    fn a_patch_that_forgets_a_timeout_is_not_one_that_leaves_it() {
        for patch in [
            SettingsPatch { idle_timeout_s: Some(None), ..SettingsPatch::default() },
            SettingsPatch { delete_after_s: Some(Some(0.1)), ..SettingsPatch::default() },
            SettingsPatch { paused: Some(true), ..SettingsPatch::default() },
        ] {
            let event = Event::Change(Change::Settings(patch));
            let text = serde_json::to_string(&event).unwrap();
            assert_eq!(serde_json::from_str::<Event>(&text).unwrap(), event, "{text}");
        }
    }

    #[test]
    fn a_mark_at_rest_goes_on_with_the_world() {
        let rest = |since| Some(Rest { since, tick_rate: 20.0 });
        let mark = Mark { tick: 100, seq: 7, rest: rest(600), ..Mark::default() };
        assert_eq!(
            [0, 600, 602, 603, 660].map(|frame| mark.tick_at(frame)),
            [100, 100, 100, 101, 120]
        );
        assert!(mark.holds(&Mark { tick: 120, rest: rest(660), ..mark.clone() }));
        for other in [
            Mark { tick: 119, rest: rest(660), ..mark.clone() },
            Mark { tick: 120, rest: rest(660), seq: 8, ..mark.clone() },
            Mark { tick: 120, rest: rest(660), lost: vec![(1, 2)], ..mark.clone() },
            Mark { tick: 120, rest: None, ..mark.clone() },
            Mark { rest: Some(Rest { since: 600, tick_rate: 21.0 }), ..mark.clone() },
        ] {
            assert!(!mark.holds(&other), "{other:?}");
        }
        let mut still = mark.clone();
        still.stop_at(660);
        assert_eq!((still.tick_at(u64::MAX), still.rest), (120, None));
        assert!(!still.holds(&mark), "its time goes on now");
    }

    #[test]
    fn a_mark_of_a_version_that_knew_no_rest_is_one_of_a_session_that_stands_still() {
        let old = r#"{"tick":5,"seq":9,"next":2,"lost":[[3,4]]}"#;
        let mark: Mark = serde_json::from_str(old).unwrap();
        assert_eq!(mark, Mark { tick: 5, seq: 9, next: 2, lost: vec![(3, 4)], rest: None });
        assert_eq!(serde_json::to_string(&mark).unwrap(), old);
    }

    #[test]
    fn lost_seqs_are_never_forgotten() {
        let mut mark = Mark::default();
        for i in 0..100 {
            mark.lose(i * 10 + 5, i * 10 + 9);
        }
        assert_eq!(mark.lost.len(), MOST_LOST);
        for seq in (0..100).map(|i| i * 10 + 7) {
            assert!(mark.lost.iter().any(|range| (range.0..=range.1).contains(&seq)), "{seq}");
        }
        mark.lose(5, 4);
        assert_eq!(mark.lost.len(), MOST_LOST, "an empty range is none");
    }
}
