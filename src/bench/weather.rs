//! What steps of weather cost: on one snowpack, on a large one, on thousands, and for a whole season.

use std::time::{Duration, Instant};

use firn_engine::cpu::CpuBackend;
use firn_engine::frame::{
    Backend, Deposit, Edit, Frame, Layout, Slot, Weathering, Work, WorkOutcome,
};
use firn_engine::gpu::GpuBackend;
use firn_engine::gpu::kernels::KernelId;
use firn_snow::alpine::{Gathering, Surface, WeatherStep};
use firn_snow::weather::{Felt, Site};
use firn_snow::{Grid, HardnessLaw, MASS_QUANTA, Material};

use super::case::Case;
use super::report::{Clock, Measured, Report};
use super::spread::Spread;
use super::{BenchError, Plan};

/// Length of a step \[s\].
const STEP: f64 = 900.0;

/// Steps in a day, and days in a season.
const DAY: usize = 96;
const SEASON: usize = 270;

/// Slots that a crowd fills: 5.8 m.
const CROWD_SLOTS: u32 = 29;

/// Steps that are timed at the most: each sees other snow than the one before.
const MOST_STEPS: u32 = 50;

/// Measures steps of weather.
pub(super) fn measure(
    plan: &Plan,
    on_gpu: bool,
    report: &mut Report,
    observe: &mut dyn FnMut(&str),
) -> Result<(), BenchError> {
    let small = Grid::default();
    let side = plan.side(2048);
    let large = Grid { width: side, depth: side, ..small };
    for (case, grid, sessions) in [
        (Case::WeatherSession, small, 1),
        (Case::Weather, large, 1),
        (Case::WeatherCrowd, small, plan.count(10_000)),
    ] {
        if plan.wants(case) {
            observe(&format!("{}: steps of weather", case.name()));
            let mut field = Field::new(on_gpu, grid, sessions)?;
            report.cases.push(field.steps(case, plan.samples.min(MOST_STEPS))?);
        }
    }
    for (case, grid, days) in [(Case::Season, small, SEASON), (Case::SeasonColumns, large, 1)] {
        if plan.wants(case) {
            observe(&format!("{}: {days} days of weather", case.name()));
            let mut field = Field::new(on_gpu, grid, 1)?;
            report.cases.push(field.season(case, days)?);
        }
    }
    Ok(())
}

enum Engine {
    Gpu(Box<GpuBackend>),
    Cpu(CpuBackend),
}

/// Snowpacks of alpine snow, all of them alike.
struct Field {
    engine: Engine,
    grid: Grid,
    sessions: u32,
    clock: Clock,
}

impl Field {
    fn new(on_gpu: bool, grid: Grid, sessions: u32) -> Result<Field, BenchError> {
        let (mut engine, mut clock) = (Engine::Cpu(CpuBackend::new(None, false)), Clock::Wall);
        if on_gpu {
            let mut gpu = GpuBackend::new(None, false)?;
            // Of thousands of snowpacks the host has its part too.
            if sessions == 1 && gpu.take_times() {
                clock = Clock::Device;
            }
            engine = Engine::Gpu(Box::new(gpu));
        }
        let mut field = Field { engine, grid, sessions, clock };
        let material = Material { hardness_law: HardnessLaw::Alpine, ..Material::default() };
        let surface = Some(Surface::new([0.0, 1.0, 2.0, 3.0], -5.0));
        let layout = Layout { grid, material, ground: Default::default(), surface };
        for slot in 0..sessions {
            field.backend().create(slot, &layout)?;
        }
        Ok(field)
    }

    fn backend(&mut self) -> &mut dyn Backend {
        match &mut self.engine {
            Engine::Gpu(gpu) => gpu.as_mut(),
            Engine::Cpu(cpu) => cpu,
        }
    }

    fn carry_out(&mut self, edits: &[Edit]) -> Result<Vec<WorkOutcome>, BenchError> {
        let edits = |slot: Slot| Work { slot, edits: edits.to_vec(), ..Work::default() };
        let work = (0..self.sessions).map(edits).collect();
        let backend = self.backend();
        backend.submit(Frame { work })?;
        loop {
            if let Some(outcome) = backend.poll(Duration::from_secs(1))? {
                return Ok(outcome.work);
            }
        }
    }

    /// Fills slots with snow, the cells of which are too unlike to be joined.
    fn fill(&mut self, slots: u32) -> Result<(), BenchError> {
        let columns = self.grid.all();
        let layer = |slot: u32| {
            let density = if slot.is_multiple_of(2) { 250.0 } else { 380.0 };
            let mass = (self.grid.cell_size * density * MASS_QUANTA).round() as u32;
            let depth = self.grid.thickness_quanta(self.grid.cell_size) as u32;
            Edit::Deposit(Deposit { columns, depth, mass, temperature: -4.0 })
        };
        let edits: Vec<Edit> = (0..slots).map(layer).collect();
        self.carry_out(&edits)?;
        Ok(())
    }

    /// Takes steps. Returns what they took on the device, or the whole frame where the device takes no times.
    fn step(&mut self, steps: &[WeatherStep]) -> Result<Duration, BenchError> {
        let edits: Vec<Edit> = Weathering::edits(&self.grid, steps).collect();
        let begun = Instant::now();
        self.carry_out(&edits)?;
        let whole = begun.elapsed();
        match &self.engine {
            Engine::Gpu(gpu) if self.clock == Clock::Device => {
                let times = gpu.kernel_times()?;
                let weather = times.iter().filter(|(kernel, _)| *kernel == KernelId::Weather);
                Ok(weather.map(|(_, time)| *time).sum())
            }
            _ => Ok(whole),
        }
    }

    /// Single steps.
    fn steps(&mut self, case: Case, samples: u32) -> Result<Measured, BenchError> {
        // A crowd is as deep as that of the thesis's snow.
        let slots = if self.sessions > 1 { CROWD_SLOTS } else { self.grid.height };
        self.fill(slots)?;
        let mut winter = Winter::new(self.grid);
        let mut times = Vec::new();
        for sample in 0..=samples {
            let step = winter.next();
            let time = self.step(&[WeatherStep { snow: 0, ..step }])?;
            // The first one compiles and allocates.
            if sample > 0 {
                times.push(time);
            }
        }
        self.measured(case, times)
    }

    /// Some days of winter, from bare ground on: the whole of it by the host's clock.
    fn season(&mut self, case: Case, days: usize) -> Result<Measured, BenchError> {
        let mut winter = Winter::new(self.grid);
        self.clock = Clock::Wall;
        let begun = Instant::now();
        for _ in 0..days {
            let steps: Vec<WeatherStep> = (0..DAY).map(|_| winter.next()).collect();
            self.step(&steps)?;
        }
        self.measured(case, vec![begun.elapsed()])
    }

    fn measured(&self, case: Case, times: Vec<Duration>) -> Result<Measured, BenchError> {
        let nothing = || BenchError::Stuck { case: case.name(), what: "nothing was timed".into() };
        let time = Spread::of(times).ok_or_else(nothing)?;
        let grid = [self.grid.width, self.grid.depth, self.grid.height];
        Ok(Measured::new(case, self.sessions, grid, self.clock, time))
    }
}

/// A winter that is the same in every run: cold, with snow every fifth day, and sun at noon.
struct Winter {
    grid: Grid,
    gathering: Gathering,
    site: Site,
    step: u64,
}

impl Winter {
    fn new(grid: Grid) -> Winter {
        Winter { grid, gathering: Gathering::default(), site: Site::default(), step: 0 }
    }

    fn next(&mut self) -> WeatherStep {
        let hour = self.step as f64 * STEP / 3600.0;
        let height = ((hour - 6.0) / 12.0 * std::f64::consts::PI).sin();
        let day = hour / 24.0;
        let season = (day / SEASON as f64 * std::f64::consts::PI).sin();
        let air = 6.0 - 16.0 * season + 4.0 * height;
        let snows = day % 5.0 < 1.0 && air < 1.2;
        let felt = Felt {
            air_temperature: air,
            relative_humidity: 80.0,
            wind_speed: 2.0,
            pressure: 870.0,
            snowfall: if snows { 1.2 / 3600.0 } else { 0.0 },
            rainfall: 0.0,
            shortwave: 500.0 * height.max(0.0),
            longwave: 250.0 + 3.0 * air,
            diffuse: 1.0,
            sun: None,
            derived: Default::default(),
        };
        self.step += 1;
        let due = self.gathering.fall(&felt, STEP, &self.grid);
        WeatherStep::new(&felt, &self.site, STEP, due)
    }
}
