//! What one client counted.

use std::collections::BTreeMap;

/// Resolution of times \[s\].
const STEP: f64 = 1e-4;

/// How often each time was measured, in steps of 0.1 ms. It grows with the spread of the times,
/// not with the length of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Times(BTreeMap<i64, u64>);

impl Times {
    /// Notes a time \[s\].
    pub fn note(&mut self, seconds: f64) {
        *self.0.entry((seconds / STEP).floor() as i64).or_default() += 1;
    }

    /// The least step that was noted.
    pub fn least(&self) -> Option<i64> {
        self.0.first_key_value().map(|(&step, _)| step)
    }

    /// Adds all times of another, `earlier` steps earlier.
    pub fn add(&mut self, other: &Times, earlier: i64) {
        for (step, count) in &other.0 {
            *self.0.entry(step - earlier).or_default() += count;
        }
    }

    /// Number of times.
    pub fn count(&self) -> u64 {
        self.0.values().sum()
    }

    /// The least time \[ms\] that at least a share of all do not exceed.
    pub fn quantile(&self, share: f64) -> Option<f64> {
        let wanted = ((share * self.count() as f64).ceil() as u64).max(1);
        let mut so_far = 0;
        self.0.iter().find_map(|(&step, &count)| {
            so_far += count;
            (so_far >= wanted).then_some(step as f64 * STEP * 1e3)
        })
    }
}

/// What one viewer counted.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Number of its session.
    pub session: usize,
    /// Messages of heights.
    pub messages: u64,
    /// Payload of the deltas \[bytes\].
    pub bytes: u64,
    /// Columns in the tiles of the deltas.
    pub columns: u64,
    /// Arrival of each new tick less the time from tick 0 to it.
    pub arrivals: Times,
    /// Messages read after a stall until the newest state of its end was seen.
    pub catch_up: Option<u64>,
    /// Why it ended before the run did.
    pub dropped: Option<String>,
}

/// What one mover counted.
#[derive(Clone, Debug, Default)]
pub struct Moves {
    /// Batches that were acknowledged.
    pub acks: u64,
    /// Batches that were refused.
    pub refused: u64,
    /// Time from a batch to its ack.
    pub times: Times,
    /// Why it ended before the run did.
    pub dropped: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_sorted_times() {
        let mut times = Times::default();
        assert_eq!(times.quantile(0.5), None);
        for i in (1..=100).rev() {
            times.note(f64::from(i) * 1e-3 + 1e-6);
        }
        for (share, expected) in [(0.0, 1.0), (0.5, 50.0), (0.99, 99.0), (1.0, 100.0)] {
            let found = times.quantile(share).unwrap();
            assert!((found - expected).abs() < 1e-9, "{share}: {found}");
        }
    }

    #[test]
    fn times_of_sessions_are_shifted_to_a_common_zero() {
        let (mut all, mut late) = (Times::default(), Times::default());
        late.note(-5.0);
        late.note(-4.99);
        all.add(&late, late.least().unwrap());
        assert_eq!((all.quantile(0.0), all.count()), (Some(0.0), 2));
        assert!((all.quantile(1.0).unwrap() - 10.0).abs() < 0.11);
    }
}
