//! The bandwidth that everything else is compared with: a large buffer, copied.

use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::report::{Clock, CopyRate};
use super::spread::Spread;
use super::{BenchError, Plan};
use crate::engine::frame::EngineError;
use crate::engine::gpu::device::Device;
use crate::engine::gpu::stopwatch::Stopwatch;

/// Bytes of the buffer at full scale: many times what any cache holds.
const BYTES: f64 = (1u64 << 30) as f64;

/// Copies before the first that counts.
const WARM_UP: u32 = 3;

/// Copies a large buffer on the device, or in the host's memory where there is none.
pub(super) fn copy_rate(device: Option<&Device>, plan: &Plan) -> Result<CopyRate, BenchError> {
    let bytes = ((BYTES * plan.scale) as u64).max(1 << 24).next_multiple_of(4);
    let (bytes, clock, times) = match device {
        Some(device) => {
            let bytes = bytes.min(device.largest_binding() / 4 * 4);
            let (clock, times) = on_device(device, bytes, plan.samples)?;
            (bytes, clock, times)
        }
        None => (bytes, Clock::Wall, on_host(bytes as usize, plan.samples)),
    };
    let nothing = || BenchError::Stuck { case: "copy", what: "no copy was timed".to_owned() };
    let time_s = Spread::of(times).ok_or_else(nothing)?;
    let bytes = 2 * bytes;
    Ok(CopyRate { bytes, time_s, bytes_per_s: bytes as f64 / time_s.median, clock })
}

fn on_device(
    device: &Device,
    bytes: u64,
    samples: u32,
) -> Result<(Clock, Vec<Duration>), EngineError> {
    let buffers = device.allocate(|| {
        ["source", "target"].map(|label| {
            device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes,
                usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })
    })?;
    let mut watch = Stopwatch::new(device, 2);
    let mut times = Vec::new();
    for sample in 0..WARM_UP + samples {
        let mut encoder = device.device.create_command_encoder(&Default::default());
        if let Some(watch) = &mut watch {
            watch.reset();
            watch.stamp(&mut encoder);
        }
        encoder.copy_buffer_to_buffer(&buffers[0], 0, &buffers[1], 0, bytes);
        if let Some(watch) = &mut watch {
            watch.stamp(&mut encoder);
            watch.finish(&mut encoder);
        }
        let begun = Instant::now();
        device.queue.submit([encoder.finish()]);
        let time = match &watch {
            Some(watch) => watch.laps(device)?[0],
            None => {
                wait(device)?;
                begun.elapsed()
            }
        };
        if sample >= WARM_UP {
            times.push(time);
        }
    }
    Ok((if watch.is_some() { Clock::Device } else { Clock::Wall }, times))
}

/// Waits until the device has done everything.
pub(super) fn wait(device: &Device) -> Result<(), EngineError> {
    let done = device.device.poll(wgpu::PollType::wait_indefinitely());
    done.map_err(|error| EngineError::DeviceFailed(error.to_string()))?;
    device.check()
}

fn on_host(bytes: usize, samples: u32) -> Vec<Duration> {
    let source = vec![1u8; bytes];
    let mut target = vec![0u8; bytes];
    let part = bytes.div_ceil(rayon::current_num_threads());
    let mut copy = || {
        let begun = Instant::now();
        target
            .par_chunks_mut(part)
            .zip(source.par_chunks(part))
            .for_each(|(target, source)| target.copy_from_slice(source));
        begun.elapsed()
    };
    (0..WARM_UP + samples).map(|_| copy()).skip(WARM_UP as usize).collect()
}
