//! The layout of the thesis, for comparison: a struct of 88 bytes for each cell of the fixed grid,
//! index = x + w·y + w·h·z, five kernels for each cycle.

use std::time::{Duration, Instant};

use firn_engine::frame::EngineError;
use firn_engine::gpu::device::Device;
use firn_engine::gpu::stopwatch::Stopwatch;
use firn_snow::Grid;

use super::bandwidth::wait;
use super::case::Case;
use super::field::IN_A_ROW;
use super::report::{Clock, Measured, Report};
use super::spread::Spread;
use super::{BenchError, Plan};

/// Words of a cell.
const CELL_WORDS: u64 = 22;

/// Times that a cycle moves a whole cell: four kernels read and write it, the last one reads it.
const CELL_MOVES: u64 = 9;

/// Samples before the first that counts.
const WARM_UP: u32 = 2;

/// Words of a cell that are not zero in the beginning: density, temperature and mass.
const DENSITY: usize = 16;
const TEMPERATURE: usize = 17;
const MASS: usize = 19;

/// The kernels in their order, and whether there is a thread for each cell or for each column.
const KERNELS: [(&str, bool); 5] = [
    ("populate", true),
    ("pressures", false),
    ("apply", true),
    ("resample", false),
    ("update_columns", false),
];

/// Constants of the kernels, as the shader declares them.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Constants {
    width: u32,
    height: u32,
    depth: u32,
    cell_size: f32,
    dt: f32,
    snow_height: f32,
    zero: f32,
    integer_zero: i32,
}

/// Measures the cases in the thesis's layout.
pub(super) fn measure(
    plan: &Plan,
    device: &Device,
    report: &mut Report,
    observe: &mut dyn FnMut(&str),
) -> Result<(), BenchError> {
    let full = |side| Grid { width: side, depth: side, ..Grid::default() };
    let grids =
        [(Case::SessionThesis, full(50), 5.8), (Case::FieldThesis, full(plan.side(512)), 10.0)];
    for (case, grid, snow) in grids {
        if !plan.wants(case) {
            continue;
        }
        observe(&format!("{}: five kernels", case.name()));
        let mut thesis = Thesis::new(device, grid, snow)?;
        let times = thesis.cycles(plan.samples)?;
        let clock = if thesis.watch.is_some() { Clock::Device } else { Clock::Wall };
        if let Some(time) = Spread::of(times) {
            let sides = [grid.width, grid.depth, grid.height];
            let cells = grid.columns() * u64::from(grid.height);
            let measured = Measured::new(case, 1, sides, clock, time);
            let bytes = cells * CELL_WORDS * 4 * CELL_MOVES;
            report.cases.push(measured.with_work(cells, 0, 1, bytes));
        }
    }
    Ok(())
}

/// A snowpack in the thesis's layout.
struct Thesis<'a> {
    device: &'a Device,
    pipelines: Vec<(wgpu::ComputePipeline, u32)>,
    binding: wgpu::BindGroup,
    watch: Option<Stopwatch>,
}

impl Thesis<'_> {
    fn new(device: &Device, grid: Grid, snow: f64) -> Result<Thesis<'_>, EngineError> {
        let columns = grid.columns();
        let bytes = columns * u64::from(grid.height) * CELL_WORDS * 4;
        if bytes > device.largest_binding() {
            return Err(EngineError::OutOfMemory(format!(
                "the thesis's layout needs {bytes} bytes in one binding; the device binds {}",
                device.largest_binding()
            )));
        }
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let [cells, heights, constants] = device.allocate(|| {
            let buffer = |label, size, usage| {
                device.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some(label),
                    size,
                    usage,
                    mapped_at_creation: false,
                })
            };
            let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
            let size = std::mem::size_of::<Constants>() as u64;
            [
                buffer("thesis cells", bytes, usage),
                buffer("thesis columns", columns * 8, usage),
                buffer("thesis constants", size, uniform),
            ]
        })?;
        device.queue.write_buffer(
            &constants,
            0,
            bytemuck::bytes_of(&Constants {
                width: grid.width,
                height: grid.height,
                depth: grid.depth,
                cell_size: grid.cell_size as f32,
                dt: 1.0 / 60.0,
                snow_height: snow as f32,
                zero: 0.0,
                integer_zero: 0,
            }),
        );
        fill(device, &cells, &heights, grid, snow);
        let (pipelines, layout) = pipelines(device, grid);
        let binding = device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("thesis"),
            layout: &layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: constants.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: cells.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 2, resource: heights.as_entire_binding() },
            ],
        });
        device.check()?;
        Ok(Thesis { device, pipelines, binding, watch: Stopwatch::new(device, 3) })
    }

    /// Runs cycles, some in a row for each sample.
    fn cycles(&mut self, samples: u32) -> Result<Vec<Duration>, EngineError> {
        let mut times = Vec::new();
        for sample in 0..WARM_UP + samples {
            let time = self.cycles_in_a_row()?;
            if sample >= WARM_UP {
                times.push(time / IN_A_ROW);
            }
        }
        Ok(times)
    }

    fn cycles_in_a_row(&mut self) -> Result<Duration, EngineError> {
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        if let Some(watch) = &mut self.watch {
            watch.begin(&mut encoder);
        }
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_bind_group(0, &self.binding, &[]);
        for (pipeline, groups) in (0..IN_A_ROW).flat_map(|_| &self.pipelines) {
            let (x, y) = self.device.groups(*groups);
            pass.set_pipeline(pipeline);
            pass.dispatch_workgroups(x, y, 1);
        }
        drop(pass);
        if let Some(watch) = &mut self.watch {
            watch.stamp(&mut encoder);
            watch.finish(&mut encoder);
        }
        let begun = Instant::now();
        self.device.queue.submit([encoder.finish()]);
        match &self.watch {
            Some(watch) => Ok(watch.laps(self.device)?[0]),
            None => {
                wait(self.device)?;
                Ok(begun.elapsed())
            }
        }
    }
}

/// Writes fresh snow of 20 kg/m³ at −3 °C into every cell, one layer of the world at a time.
fn fill(device: &Device, cells: &wgpu::Buffer, heights: &wgpu::Buffer, grid: Grid, snow: f64) {
    let volume = grid.cell_size.powi(3);
    let layer = u64::from(grid.width) * u64::from(grid.height);
    let mut words = vec![0f32; (layer * CELL_WORDS) as usize];
    for cell in words.chunks_exact_mut(CELL_WORDS as usize) {
        (cell[DENSITY], cell[TEMPERATURE], cell[MASS]) = (20.0, -3.0, (20.0 * volume) as f32);
    }
    for z in 0..u64::from(grid.depth) {
        let offset = z * layer * CELL_WORDS * 4;
        device.queue.write_buffer(cells, offset, bytemuck::cast_slice(&words));
        // So that no more than a layer waits in the host's memory.
        device.queue.submit([]);
    }
    let full = vec![[snow as f32, 0.0]; grid.columns() as usize];
    device.queue.write_buffer(heights, 0, bytemuck::cast_slice(&full));
}

/// The kernels with the workgroups of each, and the layout they share.
fn pipelines(
    device: &Device,
    grid: Grid,
) -> (Vec<(wgpu::ComputePipeline, u32)>, wgpu::BindGroupLayout) {
    let device = &device.device;
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("thesis"),
        source: wgpu::ShaderSource::Wgsl(SOURCE.into()),
    });
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    let storage = wgpu::BufferBindingType::Storage { read_only: false };
    let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("thesis"),
        entries: &[
            entry(0, wgpu::BufferBindingType::Uniform),
            entry(1, storage),
            entry(2, storage),
        ],
    });
    let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("thesis"),
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    let pipelines = KERNELS.map(|(kernel, per_cell)| {
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(kernel),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(kernel),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let threads =
            if per_cell { grid.columns() * u64::from(grid.height) } else { grid.columns() };
        (pipeline, threads.div_ceil(64) as u32)
    });
    (pipelines.into(), layout)
}

const SOURCE: &str = include_str!("../../shaders/baseline/thesis.wgsl");
