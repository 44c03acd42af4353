//! Times taken on the device itself, where the adapter can.

use std::time::Duration;

use crate::frame::EngineError;

use super::device::Device;

/// What a device needs to take times.
pub const STOPWATCH_FEATURES: wgpu::Features =
    wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS);

/// Bytes of one stamp.
const STAMP_BYTES: u64 = 8;

/// Stamps written between the commands of one submit, each when all before it is done.
#[derive(Debug)]
pub struct Stopwatch {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
    capacity: u32,
    taken: u32,
    /// Seconds of one unit of a stamp.
    unit: f64,
}

impl Stopwatch {
    /// A stopwatch for up to `capacity` stamps, at most 4096; `None` where the adapter takes none.
    pub fn new(device: &Device, capacity: u32) -> Option<Stopwatch> {
        if !device.device.features().contains(STOPWATCH_FEATURES) {
            return None;
        }
        let buffer = |label, usage| {
            device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: u64::from(capacity) * STAMP_BYTES,
                usage,
                mapped_at_creation: false,
            })
        };
        use wgpu::BufferUsages as Usage;
        Some(Stopwatch {
            queries: device.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("stopwatch"),
                ty: wgpu::QueryType::Timestamp,
                count: capacity,
            }),
            resolved: buffer("stamps", Usage::QUERY_RESOLVE | Usage::COPY_SRC),
            readable: buffer("readable stamps", Usage::COPY_DST | Usage::MAP_READ),
            capacity,
            taken: 0,
            unit: f64::from(device.queue.get_timestamp_period()) * 1e-9,
        })
    }

    /// Begins anew: two stamps with nothing between them, so that it is known what a stamp itself
    /// takes.
    pub fn begin(&mut self, encoder: &mut wgpu::CommandEncoder) {
        self.taken = 0;
        self.stamp(encoder);
        self.stamp(encoder);
    }

    /// Whether there is room for some stamps more.
    pub fn has_room(&self, stamps: u32) -> bool {
        self.taken + stamps <= self.capacity
    }

    /// Takes a stamp between the commands before and after, where there is room for it.
    pub fn stamp(&mut self, encoder: &mut wgpu::CommandEncoder) {
        if self.has_room(1) {
            encoder.write_timestamp(&self.queries, self.taken);
            self.taken += 1;
        }
    }

    /// Encodes what makes the stamps readable, after the last one.
    pub fn finish(&self, encoder: &mut wgpu::CommandEncoder) {
        if self.taken > 0 {
            encoder.resolve_query_set(&self.queries, 0..self.taken, &self.resolved, 0);
            let bytes = u64::from(self.taken) * STAMP_BYTES;
            encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readable, 0, bytes);
        }
    }

    /// Waits for the submit and returns the times from the beginning to the first stamp, and from
    /// each to the next, less what a stamp takes.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`].
    pub fn laps(&self, device: &Device) -> Result<Vec<Duration>, EngineError> {
        if self.taken == 0 {
            return Ok(Vec::new());
        }
        let bytes = u64::from(self.taken) * STAMP_BYTES;
        self.readable.slice(..bytes).map_async(wgpu::MapMode::Read, |_| {});
        let failed = |error: String| EngineError::DeviceFailed(error);
        device
            .device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|error| failed(error.to_string()))?;
        device.check()?;
        let view =
            self.readable.get_mapped_range(..bytes).map_err(|error| failed(error.to_string()))?;
        let stamps: Vec<u64> = bytemuck::pod_collect_to_vec(&view);
        drop(view);
        self.readable.unmap();
        let mut laps = stamps.windows(2).map(|pair| pair[1].saturating_sub(pair[0]));
        let stamp = laps.next().unwrap_or(0);
        let seconds = |lap: u64| lap.saturating_sub(stamp) as f64 * self.unit;
        Ok(laps.map(|lap| Duration::from_secs_f64(seconds(lap))).collect())
    }
}
