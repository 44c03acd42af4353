//! States of a session, as clients know them and as they find them.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use firn_protocol::SessionSpec;

/// A session, as far as clients can know it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct State {
    /// Mass that clients have let fall, in quanta.
    pub fallen: u128,
    /// Temperature of the air \[°C\].
    pub air: i32,
    /// Whether its time stands still.
    pub paused: bool,
    /// Masses of its objects \[kg\].
    pub objects: BTreeMap<u8, u32>,
    /// Hash of its token; `None` where it has one that nobody was told.
    pub token: Option<String>,
    /// Which of its beginnings a reset brings it back to.
    pub origin: usize,
    /// States that are kept under names.
    pub kept: BTreeMap<u8, State>,
}

/// A session, as somebody finds it.
#[derive(Clone, Debug)]
pub struct Found {
    /// What clients may have let fall of the mass that has fallen, in quanta: the rest fell by itself.
    pub fallen: RangeInclusive<u128>,
    /// Mass that was cleared, in quanta.
    pub cleared: u128,
    /// Temperature of the air \[°C\].
    pub air: i32,
    /// Whether its time stands still.
    pub paused: bool,
    /// Masses of its objects \[kg\].
    pub objects: BTreeMap<u8, u32>,
    /// Hash of its token.
    pub token: String,
    /// The tick that it has come to.
    pub tick: u64,
    /// Names under which states of it are kept.
    pub kept: BTreeSet<u8>,
}

impl State {
    /// As it begins, by a spec after which so much snow has fallen.
    pub fn new(spec: &SessionSpec, fallen: u128) -> State {
        State {
            fallen,
            air: spec.air_temperature as i32,
            paused: spec.paused,
            objects: BTreeMap::new(),
            token: None,
            origin: 0,
            kept: BTreeMap::new(),
        }
    }

    /// The same session, in another state.
    pub fn becomes(self, other: State) -> State {
        State { token: self.token, origin: self.origin, kept: self.kept, ..other }
    }

    /// Whether it can be what was found, with a token that is `fresh` or was known before.
    pub fn is(&self, found: &Found, fresh: bool) -> bool {
        let Found { fallen, air, paused, objects, token, kept, .. } = found;
        fallen.contains(&self.fallen)
            && (self.air, self.paused) == (*air, *paused)
            && self.objects == *objects
            && self.kept.keys().eq(kept)
            && self.token.as_ref().map_or(fresh, |own| own == token)
    }
}
