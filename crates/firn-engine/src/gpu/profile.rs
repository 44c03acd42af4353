//! How long each kernel of a frame takes on the device, in one frame of so many.

use std::time::Duration;

use crate::frame::EngineError;

use super::device::Device;
use super::kernels::KernelId;
use super::stopwatch::Stopwatch;

/// Stamps of one frame: dispatches beyond them are not timed.
const STAMPS: u32 = 1024;

/// Times of the newest frame's kernels, where they were taken.
#[derive(Debug)]
pub struct Profile {
    watch: Stopwatch,
    /// Of so many frames one is timed.
    every: u32,
    /// Frames since the last one that was timed; 0 in that one.
    since: u32,
    /// What runs before each stamp.
    before: Vec<Option<KernelId>>,
}

impl Profile {
    /// A profile of one frame in `every`; `None` where the adapter takes no times.
    pub fn new(device: &Device, every: u32) -> Option<Profile> {
        let watch = Stopwatch::new(device, STAMPS)?;
        Some(Profile { watch, every, since: every - 1, before: Vec::new() })
    }

    /// Begins a frame.
    pub fn begin(&mut self, encoder: &mut wgpu::CommandEncoder) {
        self.since = (self.since + 1) % self.every;
        self.before.clear();
        if self.is_taking_times() {
            self.watch.begin(encoder);
        }
    }

    /// Whether the frame that was begun is one of those that are timed.
    pub fn is_taking_times(&self) -> bool {
        self.since == 0
    }

    /// Takes a stamp after a kernel, or `None` after something else.
    pub fn stamp(&mut self, encoder: &mut wgpu::CommandEncoder, kernel: Option<KernelId>) {
        if self.watch.has_room(1) {
            self.watch.stamp(encoder);
            self.before.push(kernel);
        }
    }

    /// Encodes what makes the times readable, at the end of a frame.
    pub fn finish(&self, encoder: &mut wgpu::CommandEncoder) {
        if self.is_taking_times() {
            self.watch.finish(encoder);
        }
    }

    /// The kernels of the newest frame in their order, each with its time; none where it was not
    /// timed.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`].
    pub fn kernels(&self, device: &Device) -> Result<Vec<(KernelId, Duration)>, EngineError> {
        if !self.is_taking_times() {
            return Ok(Vec::new());
        }
        let laps = self.watch.laps(device)?;
        let timed = self.before.iter().zip(laps);
        Ok(timed.filter_map(|(kernel, lap)| Some(((*kernel)?, lap))).collect())
    }
}
