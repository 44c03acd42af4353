//! How the engine is doing, for whoever asks from another thread.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use crate::engine::frame::DeviceInfo;

/// How the engine is doing.
#[derive(Debug, Default)]
pub struct Vitals {
    /// The device the snowpacks live on.
    pub device: DeviceInfo,
    pub(super) healthy: AtomicBool,
    pub(super) memory: AtomicU64,
    pub(super) frames: AtomicU64,
    pub(super) frame_time_us: AtomicU64,
    pub(super) slipped_us: AtomicU64,
    pub(super) overloaded: AtomicBool,
}

impl Vitals {
    /// Of an engine that is about to start.
    pub(super) fn new(device: DeviceInfo, memory: u64) -> Vitals {
        let (healthy, memory) = (AtomicBool::new(true), AtomicU64::new(memory));
        Vitals { device, healthy, memory, ..Vitals::default() }
    }

    /// Whether frames are being carried out.
    pub fn is_healthy(&self) -> bool {
        self.healthy.load(Ordering::Relaxed)
    }

    /// Bytes of device memory held for snowpacks.
    pub fn memory(&self) -> u64 {
        self.memory.load(Ordering::Relaxed)
    }

    /// Frames that were carried out.
    pub fn frames(&self) -> u64 {
        self.frames.load(Ordering::Relaxed)
    }

    /// Time that they took, from planning to publishing.
    pub fn frame_time(&self) -> Duration {
        Duration::from_micros(self.frame_time_us.load(Ordering::Relaxed))
    }

    /// Whether ticks keep slipping, so that no more sessions should be placed here.
    pub fn is_overloaded(&self) -> bool {
        self.overloaded.load(Ordering::Relaxed)
    }

    /// Time by which ticks have slipped behind the wall clock because frames were too slow.
    pub fn slipped(&self) -> Duration {
        Duration::from_micros(self.slipped_us.load(Ordering::Relaxed))
    }
}
