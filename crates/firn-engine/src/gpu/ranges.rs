//! Ranges of rows in a table, taken and given back.

use std::collections::BTreeMap;
use std::ops::Range;

/// Free ranges of `0..capacity`, neighbours joined.
#[derive(Clone, Debug, Default)]
pub struct Ranges {
    capacity: u32,
    /// Length of each free range, by its start.
    free: BTreeMap<u32, u32>,
}

impl Ranges {
    /// All of `0..capacity` is free.
    pub fn new(capacity: u32) -> Ranges {
        let mut ranges = Ranges::default();
        ranges.grow(capacity);
        ranges
    }

    /// Rows, free or not.
    pub fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Whether every row is free.
    pub fn is_empty(&self) -> bool {
        self.free.get(&0) == Some(&self.capacity) || self.capacity == 0
    }

    /// End of the last row that is taken.
    pub fn end(&self) -> u32 {
        match self.free.last_key_value() {
            Some((&start, &length)) if start + length == self.capacity => start,
            _ => self.capacity,
        }
    }

    /// Adds free rows at the end.
    pub fn grow(&mut self, capacity: u32) {
        let old = std::mem::replace(&mut self.capacity, capacity);
        self.give_back(old..capacity);
    }

    /// The free ranges.
    pub fn free(&self) -> impl Iterator<Item = Range<u32>> + '_ {
        self.free.iter().map(|(&start, &length)| start..start + length)
    }

    /// Length of the longest free range.
    pub fn longest(&self) -> u32 {
        self.free.values().copied().max().unwrap_or(0)
    }

    /// Takes the first range of a length, where there is one.
    pub fn take(&mut self, length: u32) -> Option<Range<u32>> {
        let (&start, &found) = self.free.iter().find(|&(_, &free)| free >= length)?;
        self.free.remove(&start);
        if found > length {
            self.free.insert(start + length, found - length);
        }
        Some(start..start + length)
    }

    /// Gives a range back.
    pub fn give_back(&mut self, range: Range<u32>) {
        if range.is_empty() {
            return;
        }
        let (mut start, mut end) = (range.start, range.end);
        if let Some((&before, &length)) = self.free.range(..start).next_back()
            && before + length == start
        {
            start = before;
        }
        if let Some(length) = self.free.remove(&end) {
            end += length;
        }
        self.free.insert(start, end - start);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_join_again() {
        let mut ranges = Ranges::new(10);
        let (a, b, c) = (ranges.take(3).unwrap(), ranges.take(4).unwrap(), ranges.take(3).unwrap());
        assert_eq!((a.clone(), b.clone(), c.clone()), (0..3, 3..7, 7..10));
        assert_eq!((ranges.take(1), ranges.end()), (None, 10));
        ranges.give_back(a);
        ranges.give_back(c);
        assert_eq!((ranges.longest(), ranges.end()), (3, 7));
        assert!(!ranges.is_empty());
        ranges.give_back(b);
        assert!(ranges.is_empty());
        assert_eq!((ranges.longest(), ranges.end()), (10, 0));
        ranges.grow(12);
        assert_eq!(ranges.take(12), Some(0..12));
    }
}
