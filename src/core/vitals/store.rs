//! How the store is doing, for readers on other threads.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use prometheus_client::metrics::histogram::Histogram;

/// How the store is doing.
#[derive(Debug)]
pub struct StoreVitals {
    commits: Histogram,
    /// Why changes can't be stored, if they can't.
    failing: AtomicBool,
    gone: AtomicBool,
    damaged: AtomicBool,
    checkpoints: AtomicU64,
    checkpoint_bytes: AtomicU64,
    recovery_us: AtomicU64,
    lost_sessions: AtomicU64,
    revived_sessions: AtomicU64,
}

/// What is to be known of the store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreState {
    /// Nothing.
    Sound,
    /// It was damaged when the server started.
    Damaged,
    /// It can't be written to, and changes are refused until it can.
    Failing,
    /// It is not where it was any more, and changes are refused.
    Gone,
}

impl Default for StoreVitals {
    fn default() -> Self {
        // A quarter of a millisecond, a good local disk, to 8 s, a broken one, by factors of two.
        let buckets = (0..16).map(|step| 0.00025 * f64::from(1 << step));
        StoreVitals {
            commits: Histogram::new(buckets),
            failing: AtomicBool::default(),
            gone: AtomicBool::default(),
            damaged: AtomicBool::default(),
            checkpoints: AtomicU64::default(),
            checkpoint_bytes: AtomicU64::default(),
            recovery_us: AtomicU64::default(),
            lost_sessions: AtomicU64::default(),
            revived_sessions: AtomicU64::default(),
        }
    }
}

impl StoreVitals {
    /// Time that commits took until they were on disk \[s\].
    pub fn commits(&self) -> &Histogram {
        &self.commits
    }

    /// Whether changes can be stored.
    pub fn is_healthy(&self) -> bool {
        !self.failing.load(Ordering::Relaxed)
    }

    /// What is to be known of it: the worst.
    pub fn state(&self) -> StoreState {
        let is = |flag: &AtomicBool| flag.load(Ordering::Relaxed);
        match (is(&self.failing), is(&self.gone), is(&self.damaged)) {
            (true, true, _) => StoreState::Gone,
            (true, false, _) => StoreState::Failing,
            (false, _, true) => StoreState::Damaged,
            (false, _, false) => StoreState::Sound,
        }
    }

    /// Whether it was damaged when the server started.
    pub fn was_damaged(&self) -> bool {
        self.damaged.load(Ordering::Relaxed)
    }

    /// Checkpoints that were stored.
    pub fn checkpoints(&self) -> u64 {
        self.checkpoints.load(Ordering::Relaxed)
    }

    /// Their bytes.
    pub fn checkpoint_bytes(&self) -> u64 {
        self.checkpoint_bytes.load(Ordering::Relaxed)
    }

    /// Time that bringing sessions back took at the start.
    pub fn recovery(&self) -> Duration {
        Duration::from_micros(self.recovery_us.load(Ordering::Relaxed))
    }

    /// Sessions that could not be brought back at the start.
    pub fn lost_sessions(&self) -> u64 {
        self.lost_sessions.load(Ordering::Relaxed)
    }

    /// Sessions that came back from a damaged file at the start.
    pub fn revived_sessions(&self) -> u64 {
        self.revived_sessions.load(Ordering::Relaxed)
    }

    pub(crate) fn committed(&self, took: Duration) {
        self.commits.observe(took.as_secs_f64());
    }

    pub(crate) fn set_healthy(&self, healthy: bool) {
        self.failing.store(!healthy, Ordering::Relaxed);
    }

    pub(crate) fn set_gone(&self, gone: bool) {
        self.gone.store(gone, Ordering::Relaxed);
    }

    pub(crate) fn damaged(&self) {
        self.damaged.store(true, Ordering::Relaxed);
    }

    /// A locked session comes back; at a later start it did not come from a damaged file.
    pub(crate) fn note_revived(&self) {
        let revived = u64::from(self.was_damaged());
        self.revived_sessions.fetch_add(revived, Ordering::Relaxed);
    }

    pub(crate) fn checkpointed(&self, bytes: usize) {
        self.checkpoints.fetch_add(1, Ordering::Relaxed);
        self.checkpoint_bytes.fetch_add(bytes as u64, Ordering::Relaxed);
    }

    pub(crate) fn recovered(&self, took: Duration) {
        self.recovery_us.store(took.as_micros() as u64, Ordering::Relaxed);
    }

    pub(crate) fn lost(&self, sessions: usize) {
        self.lost_sessions.fetch_add(sessions as u64, Ordering::Relaxed);
    }
}
