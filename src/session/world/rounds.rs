//! Which sessions are looked after in which frame: every one more than once a second, the same
//! number in each.

use std::collections::BTreeSet;

/// Frames between two looks at the same session.
pub const ROUND: u64 = 50;

/// Sessions, spread over the frames of a round.
#[derive(Debug)]
pub(super) struct Rounds([BTreeSet<u64>; ROUND as usize]);

impl Default for Rounds {
    fn default() -> Self {
        Rounds(std::array::from_fn(|_| BTreeSet::new()))
    }
}

impl Rounds {
    fn of(&mut self, key: u64) -> &mut BTreeSet<u64> {
        &mut self.0[(key % ROUND) as usize]
    }

    pub fn insert(&mut self, key: u64) {
        self.of(key).insert(key);
    }

    pub fn remove(&mut self, key: u64) {
        self.of(key).remove(&key);
    }

    /// Sessions whose turn is in a frame.
    pub fn due(&self, frame: u64) -> Vec<u64> {
        self.0[(frame % ROUND) as usize].iter().copied().collect()
    }
}
