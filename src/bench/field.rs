//! One snowpack on the engine alone: how fast `compact` is.

use std::time::{Duration, Instant};

use firn_engine::cpu::CpuBackend;
use firn_engine::frame::{
    Backend, Deposit, Edit, Frame, Layout, Run, TileCells, Work, WorkOutcome,
};
use firn_engine::gpu::GpuBackend;
use firn_engine::gpu::device::Device;
use firn_engine::gpu::kernels::KernelId;
use firn_snow::{Grid, MASS_QUANTA, Material};

use super::case::Case;
use super::report::{Clock, Measured, Report, pass_bytes};
use super::spread::Spread;
use super::{BenchError, Plan};

/// Time of one cycle \[s\]: a tick at 60 Hz.
const DT: f64 = 1.0 / 60.0;

/// Cycles of fresh snow before the first that counts.
const WARM_UP: u32 = 8;

/// Single cycles that follow each other in one sample.
pub(super) const IN_A_ROW: u32 = 16;

/// Cycles in one dispatch, where many go.
const MANY: u32 = 256;

/// Dispatches of many cycles that are measured at the most: each begins with fresh snow.
const MOST_LONG_SAMPLES: u32 = 20;

/// Measures the cases of one snowpack without a world around it.
pub(super) fn measure(
    plan: &Plan,
    device: Option<&Device>,
    report: &mut Report,
    observe: &mut dyn FnMut(&str),
) -> Result<(), BenchError> {
    let on_gpu = device.is_some();
    let full = |side| Grid { width: side, depth: side, ..Grid::default() };
    let grids = [
        (Case::Session, full(50), 5.8),
        (Case::Field, full(plan.side(512)), 10.0),
        (Case::World, full(plan.side(2048)), 10.0),
    ];
    for (case, grid, depth) in grids {
        let many = case == Case::Field && plan.wants(Case::FieldMany);
        if !plan.wants(case) && !many {
            continue;
        }
        let mut bed = Bed::new(on_gpu, grid, depth)?;
        if plan.wants(case) {
            observe(&format!("{}: single ticks", case.name()));
            report.cases.push(bed.single_ticks(case, plan.samples)?);
        }
        if many {
            observe(&format!("{}: {MANY} ticks in one dispatch", Case::FieldMany.name()));
            report.cases.push(bed.many_ticks(plan.samples.min(MOST_LONG_SAMPLES))?);
        }
    }
    Ok(())
}

enum Engine {
    Gpu(Box<GpuBackend>),
    Cpu(CpuBackend),
}

/// One snowpack, all columns of it alike.
struct Bed {
    engine: Engine,
    grid: Grid,
    /// Depth of fresh snow \[m\].
    depth: f64,
    clock: Clock,
}

/// What all columns have in common.
struct Stack {
    cells: u64,
    /// Cells that a cycle changes.
    moving: u64,
}

impl Bed {
    fn new(on_gpu: bool, grid: Grid, depth: f64) -> Result<Bed, BenchError> {
        let (mut engine, mut clock) = (Engine::Cpu(CpuBackend::new(None, false)), Clock::Wall);
        if on_gpu {
            let mut gpu = GpuBackend::new(None, false)?;
            if gpu.take_times() {
                clock = Clock::Device;
            }
            engine = Engine::Gpu(Box::new(gpu));
        }
        let mut bed = Bed { engine, grid, depth, clock };
        let layout = Layout {
            grid,
            material: Material::default(),
            ground: Default::default(),
            surface: None,
        };
        bed.backend().create(0, &layout)?;
        bed.lay_snow()?;
        Ok(bed)
    }

    fn backend(&mut self) -> &mut dyn Backend {
        match &mut self.engine {
            Engine::Gpu(gpu) => gpu.as_mut(),
            Engine::Cpu(cpu) => cpu,
        }
    }

    fn carry_out(&mut self, work: Work) -> Result<WorkOutcome, BenchError> {
        let backend = self.backend();
        backend.submit(Frame { work: vec![work] })?;
        loop {
            if let Some(mut outcome) = backend.poll(Duration::from_secs(1))? {
                return Ok(outcome.work.remove(0));
            }
        }
    }

    /// Replaces whatever there is by fresh snow of the material's density at −3 °C.
    fn lay_snow(&mut self) -> Result<(), BenchError> {
        let columns = self.grid.all();
        let mass = (self.depth * Material::default().fresh_density * MASS_QUANTA).round() as u32;
        let depth = self.grid.thickness_quanta(self.depth) as u32;
        let edits = vec![
            Edit::Clear { columns, depth: 0 },
            Edit::Deposit(Deposit { columns, depth, mass, temperature: -3.0 }),
        ];
        self.carry_out(Work { edits, ..Work::default() })?;
        Ok(())
    }

    /// Runs cycles. Returns what `compact` took on the device, or the whole frame where the
    /// device takes no times.
    fn run(&mut self, cycles: u32) -> Result<Duration, BenchError> {
        let begun = Instant::now();
        self.carry_out(Work { run: Run { cycles, dt: DT }, ..Work::default() })?;
        let whole = begun.elapsed();
        match &self.engine {
            Engine::Gpu(gpu) if self.clock == Clock::Device => {
                let times = gpu.kernel_times()?;
                let compact = times.iter().filter(|(kernel, _)| *kernel == KernelId::Compact);
                Ok(compact.map(|(_, time)| *time).sum())
            }
            _ => Ok(whole),
        }
    }

    /// Runs one cycle and counts the cells of a column, and those of them that it changed.
    fn count(&mut self) -> Result<Stack, BenchError> {
        let before = self.probe()?;
        self.run(1)?;
        let after = self.probe()?;
        let stack = |column| Stack {
            cells: after[0].column(column).count() as u64,
            moving: before[0]
                .column(column)
                .zip(after[0].column(column))
                .filter(|(a, b)| a.thickness != b.thickness)
                .count() as u64,
        };
        let alike = before == vec![before[0].clone(); before.len()]
            && after == vec![after[0].clone(); after.len()];
        if !alike {
            let what = "columns under the same snow differ".to_owned();
            return Err(BenchError::Stuck { case: "field", what });
        }
        Ok(stack(0))
    }

    /// Cells of a few whole tiles, far apart.
    fn probe(&mut self) -> Result<Vec<TileCells>, BenchError> {
        let whole = (self.grid.width / 8, self.grid.depth / 8);
        let tile = |x: u32, z: u32| z * self.grid.tiles_x() + x;
        let gather =
            vec![tile(0, 0), tile(whole.0 / 2, whole.1 / 2), tile(whole.0 - 1, whole.1 - 1)];
        Ok(self.carry_out(Work { gather, ..Work::default() })?.gathered)
    }

    fn single_ticks(&mut self, case: Case, samples: u32) -> Result<Measured, BenchError> {
        let mut times = Vec::new();
        for _ in 0..samples {
            self.lay_snow()?;
            self.run(WARM_UP)?;
            self.run_one_by_one(true);
            times.push(self.run(IN_A_ROW)? / IN_A_ROW);
            self.run_one_by_one(false);
        }
        // A cell that has come to rest stays so: those that move now have moved all the time.
        let stack = self.count()?;
        self.measured(case, times, &stack, 1)
    }

    fn run_one_by_one(&mut self, one_by_one: bool) {
        if let Engine::Gpu(gpu) = &mut self.engine {
            gpu.run_one_by_one(one_by_one);
        }
    }

    fn many_ticks(&mut self, samples: u32) -> Result<Measured, BenchError> {
        let mut times = Vec::new();
        for sample in 0..=samples {
            self.lay_snow()?;
            let time = self.run(MANY)?;
            if sample > 0 {
                times.push(time);
            }
        }
        self.lay_snow()?;
        self.run(MANY - 1)?;
        let stack = self.count()?;
        self.measured(Case::FieldMany, times, &stack, MANY)
    }

    fn measured(
        &self,
        case: Case,
        times: Vec<Duration>,
        stack: &Stack,
        cycles: u32,
    ) -> Result<Measured, BenchError> {
        let grid = [self.grid.width, self.grid.depth, self.grid.height];
        let nothing = || BenchError::Stuck { case: case.name(), what: "nothing was timed".into() };
        let time = Spread::of(times).ok_or_else(nothing)?;
        let columns = self.grid.columns();
        let (cells, moving) = (columns * stack.cells, columns * stack.moving);
        let measured = Measured::new(case, 1, grid, self.clock, time);
        Ok(measured.with_work(cells, moving, cycles.into(), pass_bytes(cells, moving)))
    }
}
