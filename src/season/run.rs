//! Columns that feel a season's weather.

use std::time::Instant;

use firn_snow::alpine::{Gathering, Scratch, Surface, WeatherStep};
use firn_snow::weather::Site;
use firn_snow::{Column, Grid, MASS_QUANTA, MAX_COLUMN_MASS};
use rayon::prelude::*;
use time::{Date, Duration};

use super::daily::Day;
use super::forcing::Forcing;
use super::ledger::Ledger;
use super::sums::{Place, Step, Sums};

/// Columns that one thread takes at a time.
const CHUNK: usize = 64;

/// Most slots of a column.
const MOST_SLOTS: f64 = 255.0;

/// Density \[kg/m³\] at which all cells of a column may be, so that its mass fits its integer.
const DENSEST: f64 = 1000.0;

/// How a season is run.
#[derive(Clone, Debug)]
pub struct Plan {
    /// How the weather was measured, and the soil at the beginning.
    pub site: Site,
    /// Side of a fresh cell \[m\].
    pub cell_size: f64,
    /// Length of a step \[s\], part of an hour.
    pub step: f64,
    /// Columns along x and z.
    pub columns: (u32, u32),
}

/// What came of a season.
#[derive(Clone, Debug)]
pub struct Season {
    /// What it ran on.
    pub grid: Grid,
    /// Its days.
    pub days: Vec<Day>,
    /// What has become of all that fell.
    pub ledger: Ledger,
    /// How long it took \[s\].
    pub seconds: f64,
}

impl Plan {
    /// The grid: with as many slots as there may be.
    pub fn grid(&self) -> Grid {
        let slots = (MAX_COLUMN_MASS / DENSEST / self.cell_size + 1e-9).floor();
        Grid {
            width: self.columns.0,
            depth: self.columns.1,
            height: slots.clamp(1.0, MOST_SLOTS) as u32,
            cell_size: self.cell_size,
        }
    }

    /// Steps that a season's weather has.
    pub fn steps(&self, forcing: &Forcing) -> u64 {
        (forcing.seconds() / self.step + 1e-9).floor() as u64
    }
}

/// Runs a season. `progress` is told how many steps were taken, [`Plan::steps`] in all.
pub fn run(plan: &Plan, forcing: &Forcing, progress: &dyn Fn(u64)) -> Season {
    let began = Instant::now();
    let grid = plan.grid();
    let air = forcing.rows.first().map_or(0.0, |row| row.air_temperature);
    let surface = Surface::new(plan.site.soil.map(|celsius| celsius as f32), air as f32);
    let place = Place { column: Column::default(), surface };
    let mut places = vec![place; grid.columns() as usize];
    let mut sky = Sky::new(plan, forcing, grid);
    let (mut days, mut ledger) = (Vec::new(), Ledger::default());
    while let Some((date, steps)) = sky.next_day() {
        let sums = pass(&mut places, &steps, &grid);
        days.extend(sums.day(date));
        ledger.present = 0;
        ledger.add(&sums.ledger);
        progress(steps.len() as u64);
    }
    sky.enter(&mut ledger);
    Season { grid, days, ledger, seconds: began.elapsed().as_secs_f64() }
}

/// Lets all columns take a day's steps.
fn pass(places: &mut [Place], steps: &[Step], grid: &Grid) -> Sums {
    let chunks = places.par_chunks_mut(CHUNK).map_init(Scratch::default, |scratch, chunk| {
        let mut sums = Sums::default();
        for place in chunk {
            sums.add(&place.pass(steps, grid, scratch));
        }
        sums
    });
    // In the order of the chunks, so that the sums do not depend on which thread ended first.
    let chunks: Vec<Sums> = chunks.collect();
    let mut sums = Sums::default();
    chunks.iter().for_each(|chunk| sums.add(chunk));
    sums
}

/// What comes from the sky, the same for all columns.
struct Sky<'a> {
    plan: &'a Plan,
    forcing: &'a Forcing,
    grid: Grid,
    gathering: Gathering,
    /// Steps taken, and all there are.
    taken: u64,
    steps: u64,
    /// Snow and rain on every column, in quanta.
    fallen: u64,
    rained: u64,
}

impl Sky<'_> {
    fn new<'a>(plan: &'a Plan, forcing: &'a Forcing, grid: Grid) -> Sky<'a> {
        Sky {
            plan,
            forcing,
            grid,
            gathering: Gathering::default(),
            taken: 0,
            steps: plan.steps(forcing),
            fallen: 0,
            rained: 0,
        }
    }

    /// The steps that begin on the next day.
    fn next_day(&mut self) -> Option<(Date, Vec<Step>)> {
        let date = (self.taken < self.steps).then(|| self.date())?;
        let mut steps = Vec::new();
        while self.taken < self.steps && self.date() == date {
            steps.push(self.step());
        }
        Some((date, steps))
    }

    /// The day on which the next step begins.
    fn date(&self) -> Date {
        let seconds = Duration::seconds_f64(self.taken as f64 * self.plan.step);
        (self.forcing.start + seconds).date()
    }

    fn step(&mut self) -> Step {
        let seconds = self.plan.step;
        let from = self.taken as f64 * seconds;
        let felt = self.forcing.mean(from, from + seconds);
        let due = self.gathering.fall(&felt, seconds, &self.grid);
        self.taken += 1;
        self.fallen += (felt.snowfall * seconds * MASS_QUANTA).round() as u64;
        self.rained += (felt.rainfall * seconds * MASS_QUANTA).round() as u64;
        let (_, minutes, beyond) = self.forcing.start.as_hms();
        let beyond = f64::from(minutes) * 60.0 + f64::from(beyond);
        let hours = |time: f64| ((beyond + time) / 3600.0).floor();
        Step {
            weather: WeatherStep::new(&felt, &self.plan.site, seconds, due),
            ends_hour: hours(from + seconds) > hours(from),
            gathered: self.gathering.mass,
        }
    }

    /// Enters what has fallen on all columns.
    fn enter(&self, ledger: &mut Ledger) {
        let columns = self.grid.columns();
        ledger.fallen = self.fallen * columns;
        ledger.rained = self.rained * columns;
        ledger.gathered = self.gathering.mass * columns;
    }
}
