//! The same for many things, on several threads where that pays.

use std::num::NonZeroUsize;
use std::sync::OnceLock;
use std::thread::available_parallelism;

use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

/// Things from which on several threads work on them.
const MANY: usize = 64;

/// Does something with each, in order, many at a time where there are many.
pub fn each<A: Send, T: Send>(items: Vec<A>, act: impl Fn(A) -> T + Send + Sync) -> Vec<T> {
    if items.len() < MANY {
        return items.into_iter().map(act).collect();
    }
    items.into_par_iter().with_min_len(MANY / 4).map(act).collect()
}

/// Who works on many things that have nothing to do with each other. Results are in the order of the things, so
/// that it makes no difference to them who does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Executor {
    /// The thread that asks.
    OneThread,
    /// Several threads, where that pays.
    #[default]
    Threads,
}

impl Executor {
    /// Does something with each.
    pub fn each<A: Send, T: Send>(
        self,
        items: Vec<A>,
        act: impl Fn(A) -> T + Send + Sync,
    ) -> Vec<T> {
        match self {
            Executor::OneThread => items.into_iter().map(act).collect(),
            Executor::Threads => each(items, act),
        }
    }

    /// Does something with each pair of two equally long lists.
    pub fn each_pair<A: Send, B: Send, T: Send>(
        self,
        first: Vec<A>,
        second: Vec<B>,
        act: impl Fn(A, B) -> T + Send + Sync,
    ) -> Vec<T> {
        if self == Executor::OneThread || first.len() < MANY {
            return first.into_iter().zip(second).map(|(a, b)| act(a, b)).collect();
        }
        let pairs = first.into_par_iter().zip(second);
        pairs.with_min_len(MANY / 4).map(|(a, b)| act(a, b)).collect()
    }
}

/// Processors that this process may use.
pub fn processors() -> usize {
    available_parallelism().map_or(1, NonZeroUsize::get)
}

/// Starts the worker threads. Without this call they start at their first use, in the middle of a frame, where
/// a failure to start them could not be reported.
///
/// # Errors
/// Says why the operating system refuses them.
pub fn start() -> Result<(), String> {
    // All servers of a process share them.
    static STARTED: OnceLock<Result<(), String>> = OnceLock::new();
    let start = || ThreadPoolBuilder::new().build_global().map_err(|error| error.to_string());
    STARTED.get_or_init(start).clone()
}
