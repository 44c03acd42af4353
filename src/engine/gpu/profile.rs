//! How long each kernel of a frame takes on the device.

use std::time::Duration;

use crate::engine::frame::EngineError;

use super::device::Device;
use super::kernels::KernelId;
use super::stopwatch::Stopwatch;

/// Stamps of one frame: dispatches beyond them are not timed.
const STAMPS: u32 = 1024;

/// Times of the newest frame's kernels.
#[derive(Debug)]
pub struct Profile {
    watch: Stopwatch,
    /// What runs before each stamp.
    before: Vec<Option<KernelId>>,
}

impl Profile {
    /// A profile; `None` where the adapter takes no times.
    pub fn new(device: &Device) -> Option<Profile> {
        Some(Profile { watch: Stopwatch::new(device, STAMPS)?, before: Vec::new() })
    }

    /// Begins a frame.
    pub fn begin(&mut self, encoder: &mut wgpu::CommandEncoder) {
        self.watch.begin(encoder);
        self.before.clear();
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
        self.watch.finish(encoder);
    }

    /// The kernels of the newest frame in their order, each with its time.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`].
    pub fn kernels(&self, device: &Device) -> Result<Vec<(KernelId, Duration)>, EngineError> {
        let laps = self.watch.laps(device)?;
        let timed = self.before.iter().zip(laps);
        Ok(timed.filter_map(|(kernel, lap)| Some(((*kernel)?, lap))).collect())
    }
}
