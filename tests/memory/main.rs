//! What a server takes of memory, by what it asks the system for.
//!
//! A program of its own, one test at a time: nothing else may ask for memory meanwhile.

mod allocated;
mod keyed;
mod peaks;
#[path = "../limits/raw.rs"]
#[allow(dead_code)]
mod raw;
mod sessions;
#[path = "../support/mod.rs"]
mod support;

use std::sync::{Mutex, PoisonError};

/// Runs a test when no other runs.
fn alone(test: impl Future<Output = ()>) {
    static TURN: Mutex<()> = Mutex::new(());
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
    runtime.expect("there are threads").block_on(test);
}
