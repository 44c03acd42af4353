//! What holds of every column in any weather.

mod energy;
mod parts;
mod random;
mod season;

use super::conduction::capacity_of_soil;
use super::*;
use crate::weather::{Felt, Site};
use crate::{CELL, Cell, Column, Grid};

/// A column, and what came of its steps.
struct Trial {
    grid: Grid,
    seconds: f64,
    site: Site,
    gathering: Gathering,
    column: Column,
    surface: Surface,
    scratch: Scratch,
    /// Mass that should be there, in quanta.
    ledger: i128,
    /// Heat above that before \[J/m²\], as it came in and as it is there.
    came: f64,
    stored: f64,
    /// Short wave that was taken in \[J/m²\].
    absorbed: f64,
}

impl Trial {
    fn new(grid: Grid, seconds: f64, soil: [f32; 4], air: f64) -> Trial {
        Trial {
            grid,
            seconds,
            site: Site { temperature_height: 1.5, wind_height: 10.0, ..Site::default() },
            gathering: Gathering::default(),
            column: Column::default(),
            surface: Surface::new(soil, air as f32),
            scratch: Scratch::default(),
            ledger: 0,
            came: 0.0,
            stored: 0.0,
            absorbed: 0.0,
        }
    }

    /// Takes a step of weather.
    fn step(&mut self, felt: &Felt) -> Stepped {
        let due = self.gathering.fall(felt, self.seconds, &self.grid);
        let weather = WeatherStep::new(felt, &self.site, self.seconds, due);
        let (heat, soil) = (self.heat(), self.surface.soil);
        let stepped = self.column.weather(
            &mut self.surface,
            &weather,
            &self.grid,
            1.0,
            false,
            &mut self.scratch,
        );
        let Exchange { refused, deposited, sublimated, runoff } = stepped.exchange;
        self.ledger += i128::from(due.mass) + i128::from(due.rain) + i128::from(deposited);
        self.ledger -= i128::from(refused) + i128::from(sublimated) + i128::from(runoff);
        self.came += f64::from(stepped.heat) + f64::from(stepped.brought);
        self.absorbed += f64::from(stepped.absorbed);
        self.stored += self.heat() - heat;
        for (layer, (before, after)) in soil.into_iter().zip(self.surface.soil).enumerate() {
            let capacity = f64::from(capacity_of_soil(layer, before));
            self.stored += capacity * (f64::from(after) - f64::from(before));
        }
        stepped
    }

    /// Heat in the snow \[J/m²\], above that of ice at 0 °C.
    fn heat(&self) -> f64 {
        let heat = |cell: &Cell| {
            let kilograms = |quanta: u32| f64::from(quanta) / crate::MASS_QUANTA;
            let (ice, water) = (kilograms(cell.ice()), kilograms(cell.water()));
            let capacity = f64::from(ICE_HEAT) * ice + f64::from(WATER_HEAT) * water;
            capacity * f64::from(cell.celsius()) + f64::from(FUSION) * water
        };
        self.column.cells.iter().map(heat).sum()
    }

    /// Heat that is not there of what came \[J/m²\].
    fn missing(&self) -> f64 {
        self.came - self.stored
    }
}

/// Pseudo-random numbers.
struct Dice(u64);

impl Dice {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) as f64 / (1u64 << 31) as f64
    }

    fn range(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.unit()
    }

    /// True once in so many times.
    fn once_in(&mut self, times: f64) -> bool {
        self.unit() * times < 1.0
    }
}

fn felt(air_temperature: f64) -> Felt {
    Felt {
        air_temperature,
        relative_humidity: 70.0,
        wind_speed: 2.0,
        pressure: 870.0,
        snowfall: 0.0,
        rainfall: 0.0,
        shortwave: 0.0,
        longwave: 250.0,
        diffuse: 1.0,
        sun: None,
        derived: Default::default(),
    }
}
