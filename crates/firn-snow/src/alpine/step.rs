//! A weather step of one column.

use super::conduction::{GROUND_HEAT, Scratch, half_of, half_of_ground};
use super::descent::{Descent, Layer};
use super::fall::fall;
use super::housekeeping::House;
use super::skin::{Balance, Skin};
use super::surface::{FRESH_ALBEDO, GROUND_ALBEDO, Surface};
use super::turbulence::Turbulence;
use super::weather_step::WeatherStep;
use super::wet::{capacity, kilograms, quanta};
use super::{FUSION, WATER_HEAT};
use crate::column::{Cell, Column};
use crate::grid::{CELL, Grid};

/// Density of hoar \[kg/m³\].
const HOAR_DENSITY: f32 = 150.0;

/// What came into a column and left it in a step, in mass quanta, beside what falls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exchange {
    /// Snow that found no room.
    pub refused: u32,
    /// Vapour that settled on the snow, as hoar or water.
    pub deposited: u32,
    /// Ice and water that left as vapour.
    pub sublimated: u32,
    /// Water that ran off.
    pub runoff: u32,
}

/// What came of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stepped {
    /// What came in and left.
    pub exchange: Exchange,
    /// Albedo that was seen.
    pub albedo: f32,
    /// Short wave that was taken in \[J/m²\].
    pub absorbed: f32,
    /// Heat that came into snow and soil \[J/m²\]: through the skin, with the rain, and from below; less what found no
    /// snow to melt and went back into the air.
    pub heat: f32,
    /// Heat that mass brought with it less what it took \[J/m²\], above that of as much ice at 0 °C.
    pub brought: f32,
}

impl Column {
    /// Takes a step of weather. `shine` is the part of the short wave on level ground that falls on this column;
    /// nothing snows on it where it is `sheltered`.
    pub fn weather(
        &mut self,
        surface: &mut Surface,
        weather: &WeatherStep,
        grid: &Grid,
        shine: f32,
        sheltered: bool,
        scratch: &mut Scratch,
    ) -> Stepped {
        let metres = (grid.cell_size / f64::from(CELL)) as f32;
        let mut stepped = Stepped::default();
        if weather.snow > 0 && !sheltered {
            let refused = fall(&mut self.cells, weather, grid.height);
            stepped.exchange.refused = refused;
            let fallen = capacity(weather.snow - refused, 0);
            stepped.brought = fallen * weather.snow_temperature.min(0.0);
        }
        let depth = self.height() as f32 * metres;
        let albedo = age(surface, self.cells.last(), weather, depth);
        let shortwave = (1.0 - albedo) * (weather.shortwave * shine);

        // The rain's heat comes into the topmost cell with the conduction, its mass later.
        let rain_heat = match self.cells.is_empty() {
            true => 0.0,
            false => WATER_HEAT * weather.air.max(0.0) * kilograms(weather.rain) / weather.seconds,
        };
        let top = scratch.eliminate(&self.cells, &surface.soil, metres, rain_heat, weather.seconds);
        let half = self.cells.last().map_or(half_of_ground(), |top| half_of(top, metres));
        let snow = !self.cells.is_empty();
        let turbulence = Turbulence::new(weather, snow, depth);
        let skin = Skin { weather, snow, turbulence, shortwave, conductance: 1.0 / half, top };
        let balance = skin.solve(surface.skin);
        surface.skin = balance.skin;
        let through = skin.conducted(balance.skin) + balance.melt + rain_heat + GROUND_HEAT;
        stepped.albedo = albedo;
        stepped.absorbed = shortwave * weather.seconds;
        stepped.heat = through * weather.seconds;

        if snow {
            self.descend(surface, weather, &balance, grid, scratch, &mut stepped);
            let house = House { metres, slots: grid.height, snows: weather.snows };
            if let Some(scrap) = house.keep(&mut self.cells) {
                stepped.exchange.runoff += scrap.mass;
                stepped.brought -= scrap.heat();
            }
        } else {
            scratch.soil(surface, balance.skin);
            stepped.exchange.runoff = weather.rain;
        }
        surface.runoff += u64::from(stepped.exchange.runoff);
        stepped
    }

    /// From the skin down: vapour, melting, water, settling.
    fn descend(
        &mut self,
        surface: &mut Surface,
        weather: &WeatherStep,
        balance: &Balance,
        grid: &Grid,
        scratch: &Scratch,
        stepped: &mut Stepped,
    ) {
        let metres = (grid.cell_size / f64::from(CELL)) as f32;
        let melting = balance.skin >= 0.0;
        let vapour = balance.vapour * weather.seconds;
        let (leaves, comes) = (quanta(vapour), quanta(-vapour));
        let hoar = if melting { 0 } else { comes };
        let mut descent = Descent {
            metres,
            seconds: weather.seconds,
            vapour: leaves,
            from_water: melting,
            energy: balance.melt * weather.seconds,
            water: weather.rain + comes - hoar,
            above: 0,
            taken: 0.0,
        };
        stepped.brought += FUSION * kilograms(descent.water);
        let frost = lay_hoar(&mut self.cells, hoar, metres, balance.skin, grid.height);
        stepped.brought += match frost {
            Some(frost) => frost.heat(),
            None => capacity(hoar, 0) * scratch.cell(self.cells.len() - 1, balance.skin),
        };
        let mut above = balance.skin;
        for (index, cell) in self.cells.iter_mut().enumerate().rev() {
            above = scratch.cell(index, above);
            let mut layer = Layer::of(cell, above);
            descent.pass(&mut layer);
            layer.store(cell);
        }
        stepped.brought -= descent.taken + FUSION * kilograms(descent.water);
        stepped.exchange.deposited = comes;
        stepped.exchange.sublimated = leaves - descent.vapour;
        stepped.exchange.runoff = descent.water;
        stepped.heat -= scratch.ground(surface, above, weather.air, descent.energy);
        self.cells.retain(|cell| cell.mass > 0);
        self.cells.extend(frost);
    }
}

/// Lets the snow's surface age; returns the albedo that is seen.
fn age(surface: &mut Surface, top: Option<&Cell>, weather: &WeatherStep, depth: f32) -> f32 {
    let Some(top) = top else {
        surface.albedo = FRESH_ALBEDO;
        return GROUND_ALBEDO;
    };
    let kind = usize::from(surface.skin >= -0.01 || top.water() > 0);
    let limit = weather.aged[kind];
    surface.albedo = limit + (surface.albedo - limit) * weather.young[kind];
    surface.seen_albedo(depth)
}

/// Lays hoar on the topmost cell; returns a cell of its own where it doesn't fit there.
fn lay_hoar(cells: &mut [Cell], hoar: u32, metres: f32, skin: f32, slots: u32) -> Option<Cell> {
    let free = (cells.len() as u32) < slots;
    let top = cells.last_mut().filter(|_| hoar > 0)?;
    let thickness = ((kilograms(hoar) / HOAR_DENSITY / metres).round_ties_even() as u32).max(1);
    if top.thickness + thickness > CELL && free {
        return Some(Cell { mass: hoar, thickness, temperature: skin, stress: 0.0 });
    }
    top.mass += hoar;
    top.thickness = (top.thickness + thickness).min(CELL);
    None
}
