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
    /// What runs after each stamp.
    after: Vec<Option<KernelId>>,
}

impl Profile {
    /// A profile; `None` where the adapter takes no times.
    pub fn new(device: &Device) -> Option<Profile> {
        Some(Profile { watch: Stopwatch::new(device, STAMPS)?, after: Vec::new() })
    }

    /// Begins a frame.
    pub fn reset(&mut self) {
        self.watch.reset();
        self.after.clear();
    }

    /// Takes a stamp before a kernel, or after the last one.
    pub fn stamp(&mut self, encoder: &mut wgpu::CommandEncoder, kernel: Option<KernelId>) {
        if self.watch.has_room(1) {
            self.watch.stamp(encoder);
            self.after.push(kernel);
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
        let timed = self.after.iter().zip(laps);
        Ok(timed.filter_map(|(kernel, lap)| kernel.map(|kernel| (kernel, lap))).collect())
    }
}
