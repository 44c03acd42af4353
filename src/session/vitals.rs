//! How the engine is doing, for whoever asks from another thread.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use crate::engine::frame::DeviceInfo;

/// How the engine is doing.
#[derive(Debug)]
pub struct Vitals {
    /// The device the snowpacks live on.
    pub device: DeviceInfo,
    pub(super) healthy: AtomicBool,
    pub(super) recovered: AtomicBool,
    pub(super) memory: AtomicU64,
    pub(super) slipped_us: AtomicU64,
}

impl Vitals {
    /// Whether frames are being carried out.
    pub fn is_healthy(&self) -> bool {
        self.healthy.load(Ordering::Relaxed)
    }

    /// Whether all sessions that outlived the last stop are back.
    pub fn is_recovered(&self) -> bool {
        self.recovered.load(Ordering::Acquire)
    }

    /// Bytes of device memory held for snowpacks.
    pub fn memory(&self) -> u64 {
        self.memory.load(Ordering::Relaxed)
    }

    /// Time by which ticks have slipped behind the wall clock because frames were too slow.
    pub fn slipped(&self) -> Duration {
        Duration::from_micros(self.slipped_us.load(Ordering::Relaxed))
    }
}
