//! Snow that has fallen and is still too thin for a cell.

use super::weather_step::LEAST_WIND;
use crate::grid::{CELL, Grid, MASS_QUANTA};
use crate::weather::{Felt, new_snow_density};

/// Thickness that is laid at least, in quanta.
const DUE: u64 = CELL as u64 / 256;

/// Snow that has fallen on every column of a snowpack and is still too thin for a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gathering {
    /// Mass in quanta.
    pub mass: u64,
    /// Thickness in quanta.
    pub thickness: u64,
    /// Temperature \[°C\].
    pub celsius: f64,
}

/// What comes down on every column in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Due {
    /// Mass of snow, in quanta.
    pub mass: u32,
    /// Its thickness in quanta.
    pub thickness: u32,
    /// Its temperature \[°C\].
    pub celsius: f32,
    /// Mass of rain, in quanta.
    pub rain: u32,
}

impl Gathering {
    /// Lets it snow and rain for so many seconds; returns what comes down.
    pub fn fall(&mut self, felt: &Felt, seconds: f64, grid: &Grid) -> Due {
        let quanta = |rate: f64| (rate * seconds * MASS_QUANTA).round();
        let rain = quanta(felt.rainfall) as u32;
        let mass = quanta(felt.snowfall);
        if mass > 0.0 {
            let wind = felt.wind_speed.max(LEAST_WIND);
            let density = new_snow_density(felt.air_temperature, wind);
            let cells = felt.snowfall * seconds / (density * grid.cell_size);
            let celsius = felt.air_temperature.min(0.0);
            self.celsius += (celsius - self.celsius) * mass / (self.mass as f64 + mass);
            self.mass += mass as u64;
            self.thickness += (cells * f64::from(CELL)).round() as u64;
        }
        if self.thickness < DUE {
            return Due { rain, ..Due::default() };
        }
        // What no column has room for in one step waits for the next.
        let thickness = self.thickness.min(u64::from(grid.height) * u64::from(CELL));
        let part = u128::from(self.mass) * u128::from(thickness) / u128::from(self.thickness);
        let mass = part as u64;
        let due = Due {
            mass: mass as u32,
            thickness: thickness as u32,
            celsius: self.celsius as f32,
            rain,
        };
        (self.mass, self.thickness) = (self.mass - mass, self.thickness - thickness);
        due
    }
}
