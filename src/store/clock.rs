//! The store's own clock: the time for which servers that use the store have been alive.
//!
//! It is advanced from the system's monotonic clock, and how far it has come is written with every
//! batch. A start goes on from there: how long no server ran is only known to the wall clock, which
//! somebody may have set meanwhile, so that it counts nothing. What is stored with a time of this
//! clock may so grow old too late, and never too early.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::machine;

/// Tells the time from any beginning, and never goes back.
type Source = Arc<dyn Fn() -> Duration + Send + Sync>;

/// The store's own clock. Clones tell the same time.
#[derive(Clone)]
pub struct StoreClock {
    /// What it had come to when this server started \[ms\].
    before: Arc<AtomicU64>,
    /// Time since then.
    since: Source,
}

impl StoreClock {
    /// A clock that goes on from where it had come to.
    pub fn going_on_from(before: Duration) -> StoreClock {
        let start = machine::now();
        StoreClock::driven_by(
            before,
            Arc::new(move || machine::now().saturating_duration_since(start)),
        )
    }

    pub(crate) fn driven_by(before: Duration, since: Source) -> StoreClock {
        StoreClock { before: Arc::new(milliseconds(before).into()), since }
    }

    /// The time it tells.
    pub fn now(&self) -> Duration {
        let before = Duration::from_millis(self.before.load(Ordering::Relaxed));
        before.saturating_add((self.since)())
    }

    /// Goes on from a time that is known to have been, where it began before that: a damaged file may
    /// have lost how far it had come.
    pub fn begin_no_earlier_than(&self, time: Duration) {
        self.before.fetch_max(milliseconds(time), Ordering::Relaxed);
    }

    /// As a row's content: milliseconds, so that any version reads it.
    pub(super) fn encode(&self) -> Vec<u8> {
        milliseconds(self.now()).to_le_bytes().to_vec()
    }

    /// The clock that goes on from what was written; from 0 where nothing was.
    pub(super) fn decode(content: Option<&[u8]>) -> StoreClock {
        let written = content.and_then(|bytes| bytes.try_into().ok()).map(u64::from_le_bytes);
        StoreClock::going_on_from(Duration::from_millis(written.unwrap_or(0)))
    }
}

fn milliseconds(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}

impl Default for StoreClock {
    /// That of a store that nobody has used.
    fn default() -> StoreClock {
        StoreClock::going_on_from(Duration::ZERO)
    }
}

impl fmt::Debug for StoreClock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("StoreClock").field(&self.now()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_on_from_what_was_written_and_counts_no_time_without_a_server() {
        let seconds = Arc::new(AtomicU64::new(0));
        let fake = seconds.clone();
        let source: Source = Arc::new(move || Duration::from_secs(fake.load(Ordering::Relaxed)));
        let clock = StoreClock::driven_by(Duration::from_secs(100), source);
        seconds.store(30, Ordering::Relaxed);
        assert_eq!(clock.now(), Duration::from_secs(130));
        let written = clock.encode();
        seconds.store(90, Ordering::Relaxed);
        assert_eq!(clock.clone().now(), Duration::from_secs(190));
        let next = StoreClock::decode(Some(&written));
        assert!((130..140).contains(&next.now().as_secs()), "{next:?}");
    }

    #[test]
    fn all_clones_go_on_from_what_is_known_to_have_been() {
        let clock = StoreClock::driven_by(Duration::from_secs(100), Arc::new(|| Duration::ZERO));
        let clone = clock.clone();
        for (known, now) in [(50, 100), (300, 300), (200, 300)] {
            clone.begin_no_earlier_than(Duration::from_secs(known));
            assert_eq!(clock.now(), Duration::from_secs(now));
        }
    }

    #[test]
    fn a_row_that_is_not_there_or_can_not_be_read_begins_anew() {
        for content in [None, Some(&b"short"[..])] {
            assert!(StoreClock::decode(content).now() < Duration::from_secs(60), "{content:?}");
        }
        let late = StoreClock::decode(Some(&u64::MAX.to_le_bytes()));
        assert!(late.now() > Duration::from_secs(u64::MAX / 1000 - 1));
    }
}
