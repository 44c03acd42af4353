//! Steps of weather, and where light falls in them.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use firn_snow::alpine::{Surface, Sweep, WeatherStep};

use crate::frame::{Slot, Weathering};
use crate::gpu::kernels::KernelId;
use crate::gpu::layout::{ALONG_X, NONE, Pass, SWEEPS_BACK, ShadeJob, Shelter, WeatherJob};
use crate::gpu::resident::Resident;

use super::Planner;

/// Columns of snowpacks that shade in one step, all of them together.
const SHADED_AT_ONCE: u64 = 1 << 23;

/// Steps that a snowpack takes on some of its rows of tiles.
#[derive(Debug)]
pub(super) struct WeatherPart {
    pub slot: Slot,
    /// Its place among the work.
    pub place: u32,
    pub rows: Range<u32>,
    pub weathering: Arc<Weathering>,
}

/// What the jobs of a snowpack have in common.
struct Beginning {
    steps: Range<u32>,
    shelters: Range<u32>,
    first_shine: u32,
}

impl Planner<'_> {
    /// Plans steps of several snowpacks, all of which come before those that are planned next.
    pub(super) fn weather<'r>(
        &mut self,
        resident: impl Fn(Slot) -> Option<&'r Resident>,
        parts: &[WeatherPart],
    ) {
        let mut rest = parts;
        while !rest.is_empty() {
            let mut columns = 0;
            let fitting = rest.iter().take_while(|part| {
                let own = resident(part.slot).map_or(0, |it| it.layout.grid.columns());
                let first = columns == 0;
                columns += if part.weathering.shades() { own } else { 0 };
                first || columns <= SHADED_AT_ONCE
            });
            let (batch, later) = rest.split_at(fitting.count());
            rest = later;
            let shines = self.shade(&resident, batch);
            self.step_weather(&resident, batch, &shines);
        }
    }

    /// Plans that it is found where light falls on the snowpacks that shade. Returns where the parts of each begin.
    fn shade<'r>(
        &mut self,
        resident: impl Fn(Slot) -> Option<&'r Resident>,
        parts: &[WeatherPart],
    ) -> Vec<u32> {
        let first = self.tables.orders.shade_jobs.len();
        let (mut columns, mut sweeps, mut shades) = (0, 0, 0);
        let mut shines = Vec::with_capacity(parts.len());
        for part in parts {
            let resident = resident(part.slot);
            let step = part.weathering.steps.iter().find(|step| step.shades);
            let (Some(resident), Some(step)) = (resident, step) else {
                shines.push(NONE);
                continue;
            };
            let mut job = shade_job(part.slot, resident, step, columns);
            shines.push(columns);
            columns += resident.layout.grid.columns() as u32;
            sweeps += sweep(resident, step, &mut job).div_ceil(64);
            shades += (resident.layout.grid.columns() as u32).div_ceil(64);
            (job.sweep_end, job.shade_end) = (sweeps, shades);
            self.tables.orders.shade_jobs.push(job);
        }
        let jobs = self.tables.orders.shade_jobs.len() - first;
        self.tables.reserve_shine(self.device, columns);
        for (kernel, groups) in [(KernelId::Sweep, sweeps), (KernelId::Shade, shades)] {
            let pass = Pass { first, count: groups, cycles: jobs, ..Pass::default() };
            self.dispatch(kernel, 0, pass, groups);
        }
        shines
    }

    /// Plans the steps themselves, page by page.
    fn step_weather<'r>(
        &mut self,
        resident: impl Fn(Slot) -> Option<&'r Resident>,
        parts: &[WeatherPart],
        shines: &[u32],
    ) {
        let mut pages: BTreeMap<u32, Vec<WeatherJob>> = BTreeMap::new();
        for (part, &first_shine) in parts.iter().zip(shines) {
            let Some(resident) = resident(part.slot) else { continue };
            let Some(surface) = resident.layout.surface else { continue };
            let steps = self.steps(&part.weathering);
            let shelters = self.shelters(resident);
            let beginning = Beginning { steps, shelters, first_shine };
            let tiles = tiles_of(resident, &part.rows);
            let places = &resident.lot.places[tiles.start as usize..tiles.end as usize];
            // The pages that neighbours lie in, each once.
            let mut own: Vec<u32> = places.iter().map(|place| place.page).collect();
            own.dedup();
            own.sort_unstable();
            own.dedup();
            for page in own {
                let jobs = pages.entry(page).or_default();
                let before = jobs.last().map_or(0, |job| job.end);
                let end_tile = resident.lot.tiles.start + tiles.end;
                let end = before + tiles.len() as u32;
                jobs.push(job(part.place, end, end_tile, &beginning, &surface));
            }
        }
        for (page, jobs) in pages {
            let count = jobs.last().map_or(0, |job| job.end);
            let first = self.tables.orders.weather_jobs.len();
            let pass = Pass { first, count, cycles: jobs.len() as u32, page, ..Pass::default() };
            self.tables.orders.weather_jobs.extend(jobs);
            self.dispatch(KernelId::Weather, page, pass, count);
        }
    }

    /// Adds the rows of some steps.
    fn steps(&mut self, weathering: &Weathering) -> Range<u32> {
        let rows = &mut self.tables.orders.weather_steps;
        let first = rows.len();
        rows.extend(weathering.steps.iter().map(Into::into));
        first..rows.len()
    }

    /// Adds rows for the tiles of a snowpack on which objects keep snow off.
    fn shelters(&mut self, resident: &Resident) -> Range<u32> {
        let rows = &mut self.tables.orders.shelters;
        let first = rows.len();
        let sheltered = resident.covered.iter().filter(|(_, [snow, _])| *snow > 0);
        rows.extend(sheltered.map(|(&tile, &[snow, _])| Shelter {
            tile: resident.lot.tiles.start + tile,
            low: snow as u32,
            high: (snow >> 32) as u32,
            padding: 0,
        }));
        first..rows.len()
    }
}

/// The tiles in some rows of them.
fn tiles_of(resident: &Resident, rows: &Range<u32>) -> Range<u32> {
    let (across, all) = (resident.row.tiles_x, resident.lot.places.len() as u32);
    let end = rows.end.saturating_mul(across).min(all);
    (rows.start * across).min(end)..end
}

fn job(
    place: u32,
    end: u32,
    end_tile: u32,
    beginning: &Beginning,
    surface: &Surface,
) -> WeatherJob {
    let [soil_0, soil_1, soil_2, soil_3] = surface.soil;
    WeatherJob {
        end,
        end_tile,
        first_step: beginning.steps.start,
        steps: beginning.steps.len() as u32,
        exchange: place,
        first_shelter: beginning.shelters.start,
        shelters: beginning.shelters.len() as u32,
        first_shine: beginning.first_shine,
        skin: surface.skin,
        soil_0,
        soil_1,
        soil_2,
        soil_3,
        padding: 0,
    }
}

fn shade_job(slot: Slot, resident: &Resident, step: &WeatherStep, first_shine: u32) -> ShadeJob {
    let [east, up, north] = step.sun;
    ShadeJob {
        session: slot,
        first_shine,
        east,
        up,
        north,
        diffuse: step.diffuse,
        lowest_cells: resident.lowest.cells(),
        lowest_fraction: resident.lowest.fraction(),
        ..ShadeJob::default()
    }
}

/// Says how a snowpack is swept away from the sun; returns in how many lines.
fn sweep(resident: &Resident, step: &WeatherStep, job: &mut ShadeJob) -> u32 {
    if step.diffuse >= 1.0 {
        return 0;
    }
    let grid = &resident.layout.grid;
    let sweep = Sweep::new(step.sun);
    let lines = sweep.lines([grid.width, grid.depth]);
    let flag = |set: bool, flag: u32| if set { flag } else { 0 };
    job.flags = flag(sweep.along_x, ALONG_X) | flag(sweep.backwards, SWEEPS_BACK);
    (job.shift, job.sinks, job.first_line) = (sweep.shift, sweep.sinks, lines.start);
    lines.len() as u32
}
