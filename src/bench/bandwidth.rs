//! The bandwidth that everything else is compared with: a large buffer, copied.

use std::time::{Duration, Instant};

use firn_engine::frame::EngineError;
use firn_engine::gpu::device::Device;
use firn_engine::gpu::stopwatch::Stopwatch;
use rayon::prelude::*;

use super::report::{Clock, CopyRate};
use super::spread::Spread;
use super::{BenchError, Plan};

/// Bytes of the buffer at full scale: many times what any cache holds.
const BYTES: f64 = (1u64 << 30) as f64;

/// Copies before the first that counts.
const WARM_UP: u32 = 3;

/// Copies a large buffer on the device, or in the host's memory where there is none. On a device
/// both its copy command and a kernel are tried; the faster one counts.
pub(super) fn copy_rate(device: Option<&Device>, plan: &Plan) -> Result<CopyRate, BenchError> {
    let bytes = ((BYTES * plan.scale) as u64).max(1 << 24).next_multiple_of(16);
    let Some(device) = device else {
        return rate("host", bytes, Clock::Wall, on_host(bytes as usize, plan.samples));
    };
    let bytes = bytes.min(device.largest_binding() / 16 * 16);
    let buffers = Buffers::new(device, bytes)?;
    let mut rates = Vec::new();
    for (by, kernel) in [("command", None), ("kernel", Some(buffers.kernel(device)))] {
        let (clock, times) = buffers.copy(device, kernel.as_ref(), plan.samples)?;
        rates.push(rate(by, bytes, clock, times)?);
    }
    let faster = rates.into_iter().max_by(|a, b| a.bytes_per_s.total_cmp(&b.bytes_per_s));
    faster.ok_or_else(nothing)
}

fn nothing() -> BenchError {
    BenchError::Stuck { case: "copy", what: "no copy was timed".to_owned() }
}

fn rate(
    by: &'static str,
    bytes: u64,
    clock: Clock,
    times: Vec<Duration>,
) -> Result<CopyRate, BenchError> {
    let time_s = Spread::of(times).ok_or_else(nothing)?;
    let bytes = 2 * bytes;
    Ok(CopyRate { by, bytes, time_s, bytes_per_s: bytes as f64 / time_s.median, clock })
}

/// What is copied from, and what to.
struct Buffers([wgpu::Buffer; 2]);

/// A kernel that copies, and what it binds.
struct Kernel {
    pipeline: wgpu::ComputePipeline,
    binding: wgpu::BindGroup,
    groups: u32,
}

impl Buffers {
    fn new(device: &Device, bytes: u64) -> Result<Buffers, EngineError> {
        let usage = wgpu::BufferUsages::COPY_SRC
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::STORAGE;
        let buffers = device.allocate(|| {
            ["source", "goal"].map(|label| {
                device.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some(label),
                    size: bytes,
                    usage,
                    mapped_at_creation: false,
                })
            })
        })?;
        Ok(Buffers(buffers))
    }

    fn kernel(&self, device: &Device) -> Kernel {
        let module = device.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("copy"),
            source: wgpu::ShaderSource::Wgsl(
                include_str!("../../shaders/baseline/copy.wgsl").into(),
            ),
        });
        let pipeline = device.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("copy"),
            layout: None,
            module: &module,
            entry_point: Some("copy"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let [source, goal] = &self.0;
        let binding = device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("copy"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: source.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: goal.as_entire_binding() },
            ],
        });
        let groups = (goal.size() / 16).div_ceil(256) as u32;
        Kernel { pipeline, binding, groups }
    }

    fn copy(
        &self,
        device: &Device,
        kernel: Option<&Kernel>,
        samples: u32,
    ) -> Result<(Clock, Vec<Duration>), EngineError> {
        let mut watch = Stopwatch::new(device, 3);
        let mut times = Vec::new();
        for _ in 0..WARM_UP + samples {
            let mut encoder = device.device.create_command_encoder(&Default::default());
            if let Some(watch) = &mut watch {
                watch.begin(&mut encoder);
            }
            self.encode(device, &mut encoder, kernel);
            if let Some(watch) = &mut watch {
                watch.stamp(&mut encoder);
                watch.finish(&mut encoder);
            }
            let begun = Instant::now();
            device.queue.submit([encoder.finish()]);
            times.push(match &watch {
                Some(watch) => watch.laps(device)?[0],
                None => {
                    wait(device)?;
                    begun.elapsed()
                }
            });
        }
        let clock = if watch.is_some() { Clock::Device } else { Clock::Wall };
        Ok((clock, times.split_off(WARM_UP as usize)))
    }

    fn encode(&self, device: &Device, encoder: &mut wgpu::CommandEncoder, kernel: Option<&Kernel>) {
        let [source, goal] = &self.0;
        let Some(kernel) = kernel else {
            encoder.copy_buffer_to_buffer(source, 0, goal, 0, goal.size());
            return;
        };
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&kernel.pipeline);
        pass.set_bind_group(0, &kernel.binding, &[]);
        let (x, y) = device.groups(kernel.groups);
        pass.dispatch_workgroups(x, y, 1);
    }
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
