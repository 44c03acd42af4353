//! When sessions have to be looked at. What is due is found without looking at any other.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

/// A deadline for each of some sessions.
///
/// They are looked at when they come due and not before. To put something off the deadline is left as it is;
/// where it turns out to be too early, it is set anew then.
#[derive(Debug)]
pub(crate) struct Deadlines<T = Instant> {
    queue: BTreeSet<(T, u64)>,
    of: BTreeMap<u64, T>,
}

impl<T> Default for Deadlines<T> {
    fn default() -> Self {
        Deadlines { queue: BTreeSet::new(), of: BTreeMap::new() }
    }
}

impl<T: Copy + Ord> Deadlines<T> {
    /// Has a session looked at by some time, or earlier where it is to be already.
    pub fn set(&mut self, key: u64, deadline: Option<T>) {
        let Some(deadline) = deadline else { return };
        if let Some(known) = self.of.get(&key) {
            if *known <= deadline {
                return;
            }
            self.queue.remove(&(*known, key));
        }
        self.queue.insert((deadline, key));
        self.of.insert(key, deadline);
    }

    /// Forgets a session's deadline.
    pub fn remove(&mut self, key: u64) {
        if let Some(known) = self.of.remove(&key) {
            self.queue.remove(&(known, key));
        }
    }

    /// Takes out the session that has been due for longest, if any is.
    pub fn pop_due(&mut self, now: T) -> Option<u64> {
        let &(deadline, key) = self.queue.first()?;
        if deadline > now {
            return None;
        }
        self.remove(key);
        Some(key)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn what_is_due_comes_in_order_and_once() {
        let begin = Instant::now();
        let at = |seconds| begin + Duration::from_secs(seconds);
        let mut deadlines = Deadlines::<Instant>::default();
        for (key, seconds) in [(1, 30), (2, 10), (3, 20), (1, 15), (2, 40), (4, 10)] {
            deadlines.set(key, Some(at(seconds)));
        }
        deadlines.set(5, None);
        deadlines.remove(4);
        assert_eq!(deadlines.pop_due(at(9)), None);
        let due = |deadlines: &mut Deadlines, seconds| {
            std::iter::from_fn(|| deadlines.pop_due(at(seconds))).collect::<Vec<_>>()
        };
        assert_eq!(
            due(&mut deadlines, 15),
            [2, 1],
            "an earlier deadline stays, a later one yields"
        );
        assert_eq!(due(&mut deadlines, 100), [3]);
        deadlines.set(2, Some(at(50)));
        assert_eq!(due(&mut deadlines, 100), [2]);
        assert_eq!((deadlines.queue.len(), deadlines.of.len()), (0, 0));
    }
}
