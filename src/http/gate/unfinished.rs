//! Messages of stream clients that have begun and not ended. They lie in the WebSocket's buffers, where
//! nobody counts them: so it is counted what a connection has read since its last message was whole.

use std::io;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::budget::{Budget, Reservation};
use crate::limit::Limit;
use crate::metrics::LimitMetrics;

/// What every connection may have without being counted \[bytes\].
const SMALL: u64 = 16 * 1024;

/// What a connection has read of a message that has not ended.
#[derive(Debug)]
pub struct Unfinished {
    /// Whether it carries messages: before that, requests and their bodies are counted elsewhere.
    counts: AtomicBool,
    bytes: AtomicU64,
    /// What of the bodies' budget it takes.
    memory: Mutex<Option<Reservation>>,
    budget: Budget,
    limits: LimitMetrics,
}

impl Unfinished {
    /// Of a connection that has just been made.
    pub fn new(budget: Budget, limits: LimitMetrics) -> Unfinished {
        Unfinished {
            counts: AtomicBool::new(false),
            bytes: AtomicU64::new(0),
            memory: Mutex::new(None),
            budget,
            limits,
        }
    }

    /// Notes that a message is whole, and the first one begins with what is read from here on.
    pub fn end(&self) {
        self.counts.store(true, Ordering::Relaxed);
        if self.bytes.swap(0, Ordering::Relaxed) > SMALL {
            *self.memory.lock().unwrap_or_else(PoisonError::into_inner) = None;
        }
    }

    /// Counts what was read.
    ///
    /// # Errors
    /// Where unfinished messages and bodies leave no room for it.
    pub(super) fn add(&self, bytes: usize) -> io::Result<()> {
        if !self.counts.load(Ordering::Relaxed) {
            return Ok(());
        }
        let read = self.bytes.fetch_add(bytes as u64, Ordering::Relaxed) + bytes as u64;
        if read <= SMALL {
            return Ok(());
        }
        let mut memory = self.memory.lock().unwrap_or_else(PoisonError::into_inner);
        let counted = match &mut *memory {
            Some(memory) => memory.resize(read),
            free => {
                *free = self.budget.try_reserve(read);
                free.is_some()
            }
        };
        if counted {
            return Ok(());
        }
        self.limits.reached(Limit::MaxBodies);
        let why = "unfinished messages take all the memory that there is for them";
        Err(io::Error::new(io::ErrorKind::OutOfMemory, why))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_counted_until_they_are_whole() {
        let budget = Budget::new(64 * 1024);
        let connection = || Unfinished::new(budget.clone(), LimitMetrics::default());
        let (first, second) = (connection(), connection());
        first.add(1 << 20).expect("it carries no messages yet");
        first.end();
        second.end();
        first.add(SMALL as usize).unwrap();
        assert_eq!(budget.held(), 0, "small ones are not counted");
        first.add(32 * 1024).unwrap();
        assert_eq!(budget.held(), 48 * 1024);
        assert_eq!(second.add(17 * 1024).unwrap_err().kind(), io::ErrorKind::OutOfMemory);
        first.end();
        assert_eq!(budget.held(), 0);
        second.add(1).expect("there is room now");
        assert_eq!(budget.held(), 18 * 1024);
        drop(second);
        assert_eq!(budget.held(), 0);
    }
}
