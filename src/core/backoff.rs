//! How long to wait before something that failed is tried again.

use std::time::{Duration, Instant};

/// Wait before the second attempt; the first is made at once.
const FIRST: Duration = Duration::from_millis(100);

/// Longest wait.
const LONGEST: Duration = Duration::from_secs(5);

/// Failures after which there is no other attempt.
const MOST_FAILURES: u32 = 10;

/// Time without a failure after which earlier ones do not count any more.
const CALM: Duration = Duration::from_secs(60);

/// Counts failures, each wait twice as long as the one before, until going on makes no sense.
#[derive(Debug, Default)]
pub(crate) struct Backoff {
    failures: u32,
    last: Option<Instant>,
}

impl Backoff {
    /// Time to wait before the next attempt, after a failure at some time. `None` where there is to be
    /// none.
    pub fn next(&mut self, now: Instant) -> Option<Duration> {
        let calm = self.last.is_none_or(|last| now.saturating_duration_since(last) >= CALM);
        self.failures = if calm { 1 } else { self.failures + 1 };
        self.last = Some(now);
        match self.failures {
            1 => Some(Duration::ZERO),
            MOST_FAILURES.. => None,
            failures => Some(FIRST.saturating_mul(1 << (failures - 2)).min(LONGEST)),
        }
    }

    /// Failures that count.
    pub fn failures(&self) -> u32 {
        self.failures
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Waits of a number of failures, each as soon as the attempt is made.
    fn waits(backoff: &mut Backoff, now: &mut Instant, count: usize) -> Vec<Option<u128>> {
        let next = |_| {
            let wait = backoff.next(*now);
            *now += wait.unwrap_or_default();
            wait.map(|wait| wait.as_millis())
        };
        (0..count).map(next).collect()
    }

    #[test]
    fn waits_double_up_to_a_bound_and_end() {
        let (mut backoff, mut now) = (Backoff::default(), Instant::now());
        let expected = [0, 100, 200, 400, 800, 1600, 3200, 5000, 5000].map(Some);
        assert_eq!(waits(&mut backoff, &mut now, 9), expected);
        assert_eq!(waits(&mut backoff, &mut now, 2), [None, None]);
    }

    #[test]
    fn a_time_without_failures_is_a_new_beginning() {
        let (mut backoff, mut now) = (Backoff::default(), Instant::now());
        waits(&mut backoff, &mut now, 4);
        now += CALM - Duration::from_secs(1);
        assert_eq!(waits(&mut backoff, &mut now, 1), [Some(800)]);
        now += CALM;
        assert_eq!(waits(&mut backoff, &mut now, 2), [Some(0), Some(100)]);
        assert_eq!(backoff.failures(), 2);
    }
}
