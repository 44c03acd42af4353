//! Threads that give way to those that step snowpacks.

use std::sync::Arc;

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use tokio::sync::oneshot;

/// How far a thread gives way to those that step snowpacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Priority {
    /// It has about a tenth of what another gets: somebody waits for it.
    Low,
    /// It has what nobody else wants.
    Lowest,
}

/// Has this thread, and those that it starts, give way to others. Where there are few processors, or the
/// device is one of them, frames would take twice as long beside it.
#[cfg(target_os = "linux")]
pub fn give_way(priority: Priority) {
    // On Linux a thread has a priority of its own. That it can't be lowered is no reason not to go on.
    let _ = rustix::process::nice(match priority {
        Priority::Low => 10,
        Priority::Lowest => 19,
    });
}

/// Elsewhere that would be the priority of the whole process.
#[cfg(not(target_os = "linux"))]
pub fn give_way(_: Priority) {}

/// Threads for work that somebody waits for, and that gives way to the stepping of snowpacks. Clones are
/// handles to the same.
#[derive(Clone, Debug)]
pub struct Pool(Arc<ThreadPool>);

impl Pool {
    /// A number of threads, named alike.
    ///
    /// # Errors
    /// Where the operating system refuses them.
    pub fn new(threads: usize, name: &'static str) -> Result<Pool, ThreadPoolBuildError> {
        let builder = ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(move |number| format!("{name}-{number}"))
            .start_handler(|_| give_way(Priority::Low))
            // A panic shows where the result of the work is waited for.
            .panic_handler(|_| {});
        builder.build().map(|pool| Pool(Arc::new(pool)))
    }

    /// Does some work; nothing comes of it where it panics. It is done to its end although nobody may
    /// wait for it any more.
    pub async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Option<T> {
        let (send, done) = oneshot::channel();
        self.0.spawn(move || drop(send.send(work())));
        done.await.ok()
    }
}
