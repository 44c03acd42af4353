//! How often something may happen for each of many.

use std::hash::Hash;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use governor::clock::{Clock, DefaultClock};
use governor::{DefaultKeyedRateLimiter, Quota, RateLimiter};

/// Things counted between two looks for those whose rate needs no remembering any more.
const SWEEP: u64 = 10_000;

/// A rate for each of many, forgotten where nothing has happened for a while.
#[derive(Debug)]
pub struct Rates<K: Hash + Eq + Clone> {
    limiter: DefaultKeyedRateLimiter<K>,
    counted: AtomicU64,
    held: AtomicUsize,
}

impl<K: Hash + Eq + Clone> Rates<K> {
    /// Rates of which none is more than a quota.
    pub fn new(quota: Quota) -> Rates<K> {
        let limiter = RateLimiter::keyed(quota);
        Rates { limiter, counted: AtomicU64::new(0), held: AtomicUsize::new(0) }
    }

    /// Counts that something happens.
    ///
    /// # Errors
    /// The time until it may, where it happens too often.
    pub fn count(&self, of: &K) -> Result<(), Duration> {
        if self.counted.fetch_add(1, Ordering::Relaxed) % SWEEP == SWEEP - 1 {
            self.limiter.retain_recent();
            self.held.store(self.limiter.len(), Ordering::Relaxed);
        }
        let checked = self.limiter.check_key(of);
        checked.map_err(|early| early.wait_time_from(DefaultClock::default().now()))
    }

    /// Of how many it is remembered: as many as were remembered at the last look, which is no more
    /// than 10 000 things ago.
    pub fn held(&self) -> usize {
        self.held.load(Ordering::Relaxed)
    }
}

/// A time as `Retry-After` tells it: rounded up, and never 0.
pub fn whole_seconds(time: Duration) -> u32 {
    (time.as_secs_f64().ceil() as u32).max(1)
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::*;

    #[test]
    fn each_has_a_rate_of_its_own_and_is_forgotten() {
        let rates = Rates::new(Quota::per_second(NonZeroU32::new(1_000_000).unwrap()));
        for number in 0..SWEEP * 20 {
            assert_eq!(rates.count(&number), Ok(()));
        }
        // What happened a microsecond ago is no longer remembered.
        assert!(rates.held() < 2 * SWEEP as usize, "{}", rates.held());
        let rare = Rates::new(Quota::per_minute(NonZeroU32::MIN));
        assert_eq!(rare.count(&1), Ok(()));
        assert!(rare.count(&1).is_err_and(|wait| whole_seconds(wait) <= 60));
        assert_eq!(rare.count(&2), Ok(()));
    }
}
