//! Panics: those that are part of a simulation, and all others, which should never happen.

use std::sync::{Mutex, PoisonError};

/// What panics on purpose, and where redb does after that.
const EXPECTED: [&str; 3] = ["a simulated panic", "the disk has no manners", "/redb-"];

static UNEXPECTED: Mutex<Option<String>> = Mutex::new(None);

/// Notes panics instead of telling them.
pub fn watch() {
    std::panic::set_hook(Box::new(|panic| {
        let told = panic.to_string();
        if !EXPECTED.iter().any(|expected| told.contains(expected)) {
            UNEXPECTED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(told);
        }
    }));
}

/// The first panic that nobody expected, since this was last asked.
pub fn unexpected() -> Option<String> {
    UNEXPECTED.lock().unwrap_or_else(PoisonError::into_inner).take()
}
