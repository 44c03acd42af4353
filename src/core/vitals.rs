//! How the engine is doing, for readers on other threads.

pub(crate) mod store;

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use firn_engine::frame::DeviceInfo;
use tokio::sync::watch;

pub use store::{StoreState, StoreVitals};

/// Frames that are remembered.
const REMEMBERED: usize = 1024;

/// What one frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameTime {
    /// Counts the frames from 1, those between beats included.
    pub number: u64,
    /// Sessions in it.
    pub sessions: u32,
    /// Tiles whose heights it published.
    pub published_tiles: u32,
    /// Checkpoints that were taken with it.
    pub checkpoints: u32,
    /// Time from when it was begun until all of it was published.
    pub took: Duration,
    /// What that was made of.
    pub parts: FrameParts,
}

/// What the time of a frame is made of, but for looking after sessions and taking the time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameParts {
    /// Asking sessions what they do.
    pub planning: Duration,
    /// Telling the backend, as commands for a device.
    pub submitting: Duration,
    /// Waiting for the backend, and reading what it found.
    pub waiting: Duration,
    /// Publishing and answering.
    pub concluding: Duration,
}

/// What the stages of frames took on the device, in those frames that were timed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StageTimes {
    /// Frames that were timed.
    pub frames: u64,
    /// Time of each stage in all of these together.
    pub stages: BTreeMap<&'static str, Duration>,
}

/// How the engine is doing.
#[derive(Debug, Default)]
pub struct Vitals {
    /// The device the snowpacks live on.
    pub device: DeviceInfo,
    pub(crate) healthy: AtomicBool,
    pub(crate) recovered: AtomicBool,
    pub(crate) rebuilds: AtomicU64,
    /// The engine has failed for good.
    given_up: watch::Sender<bool>,
    pub(crate) memory: AtomicU64,
    pub(crate) frames: AtomicU64,
    pub(crate) frame_time_us: AtomicU64,
    pub(crate) slipped_us: AtomicU64,
    pub(crate) weather_steps: AtomicU64,
    pub(crate) waits: AtomicU64,
    device_ns: AtomicU64,
    pub(crate) frame_times: Mutex<VecDeque<FrameTime>>,
    stage_times: Mutex<StageTimes>,
    pub(crate) overloaded: AtomicBool,
    pub(crate) hibernating: AtomicU64,
    /// How the store is doing.
    pub store: Arc<StoreVitals>,
}

impl Vitals {
    /// Of an engine that is about to start.
    pub(crate) fn new(device: DeviceInfo, memory: u64) -> Vitals {
        let (healthy, memory) = (AtomicBool::new(true), AtomicU64::new(memory));
        Vitals { device, healthy, memory, ..Vitals::default() }
    }

    /// Whether frames are being carried out.
    pub fn is_healthy(&self) -> bool {
        self.healthy.load(Ordering::Relaxed)
    }

    /// How often the engine had failed and was started anew.
    pub fn rebuilds(&self) -> u64 {
        self.rebuilds.load(Ordering::Relaxed)
    }

    /// Whether the engine has failed for good: only a new process helps.
    pub fn gave_up(&self) -> bool {
        *self.given_up.borrow()
    }

    /// Waits until it has; for ever where it never does.
    pub async fn until_it_gives_up(&self) {
        let mut given_up = self.given_up.subscribe();
        if given_up.wait_for(|given_up| *given_up).await.is_err() {
            std::future::pending().await
        }
    }

    pub(crate) fn give_up(&self) {
        self.given_up.send_replace(true);
    }

    /// Whether all sessions that outlived the last stop are back.
    pub fn is_recovered(&self) -> bool {
        self.recovered.load(Ordering::Acquire)
    }

    /// Sessions that hibernate.
    pub fn hibernating(&self) -> u64 {
        self.hibernating.load(Ordering::Relaxed)
    }

    /// Bytes of device memory held for snowpacks.
    pub fn memory(&self) -> u64 {
        self.memory.load(Ordering::Relaxed)
    }

    /// What the newest frames took, the oldest of them first: those of about the last 17 s.
    pub fn frame_times(&self) -> Vec<FrameTime> {
        let times = self.frame_times.lock().unwrap_or_else(PoisonError::into_inner);
        times.iter().copied().collect()
    }

    /// Notes what a frame took, and numbers it.
    pub(crate) fn note(&self, frame: FrameTime) {
        let mut times = self.frame_times.lock().unwrap_or_else(PoisonError::into_inner);
        let number = times.back().map_or(0, |last| last.number) + 1;
        if times.len() == REMEMBERED {
            times.pop_front();
        }
        times.push_back(FrameTime { number, ..frame });
        drop(times);
        if frame.sessions > 0 {
            self.frames.fetch_add(1, Ordering::Relaxed);
            self.frame_time_us.fetch_add(frame.took.as_micros() as u64, Ordering::Relaxed);
        }
    }

    /// What the stages of frames took on the device.
    pub fn stage_times(&self) -> StageTimes {
        self.stage_times.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Notes what the stages of a frame took, where that is known.
    pub(crate) fn note_stages(&self, stages: &[(&'static str, Duration)]) {
        if stages.is_empty() {
            return;
        }
        let mut times = self.stage_times.lock().unwrap_or_else(PoisonError::into_inner);
        times.frames += 1;
        for &(stage, time) in stages {
            *times.stages.entry(stage).or_default() += time;
        }
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

    /// Frames that sessions have waited for, because others had taken less device time: each frame counts once
    /// for each of them.
    pub fn waits(&self) -> u64 {
        self.waits.load(Ordering::Relaxed)
    }

    /// Notes what the sessions of a frame are charged with.
    pub(crate) fn charge(&self, took: Duration) {
        self.device_ns.fetch_add(took.as_nanos() as u64, Ordering::Relaxed);
    }

    /// Device time that all sessions have been charged with.
    pub fn device_time(&self) -> Duration {
        Duration::from_nanos(self.device_ns.load(Ordering::Relaxed))
    }

    /// Steps of weather that snowpacks have taken, those that were gone through again included.
    pub fn weather_steps(&self) -> u64 {
        self.weather_steps.load(Ordering::Relaxed)
    }

    /// Time by which ticks have slipped behind the wall clock because frames were too slow.
    pub fn slipped(&self) -> Duration {
        Duration::from_micros(self.slipped_us.load(Ordering::Relaxed))
    }
}
