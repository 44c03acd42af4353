//! Continuous snowfall, kept to the fraction of a quantum until there is enough to deposit.

use serde::{Deserialize, Serialize};

use crate::snow::{CELL, MASS_QUANTA};

/// Continuous snowfall that has not been deposited yet, in quanta of one column.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Falling {
    depth: f64,
    mass: f64,
}

impl Falling {
    /// Least depth that is deposited, h/256.
    const LEAST: f64 = (CELL / 256) as f64;

    /// Whether it is not impossible.
    pub fn is_sound(&self) -> bool {
        [self.depth, self.mass].iter().all(|quanta| (0.0..1e12).contains(quanta))
    }

    /// Snow of a rate \[m/h\] over a time \[s\].
    pub fn fall(&mut self, rate: f64, time: f64, density: f64, cell_size: f64) {
        let depth = rate / 3600.0 * time;
        self.depth += depth / cell_size * f64::from(CELL);
        self.mass += depth * density * MASS_QUANTA;
    }

    /// Ticks of a length \[s\] until enough has fallen.
    pub fn ticks_until_due(&self, rate: f64, dt: f64, cell_size: f64) -> u64 {
        let per_tick = rate / 3600.0 * dt / cell_size * f64::from(CELL);
        if per_tick <= 0.0 {
            return u64::MAX;
        }
        ((Self::LEAST - self.depth) / per_tick).ceil().max(1.0) as u64
    }

    /// Whole quanta of depth and mass, once enough has fallen; fractions stay.
    pub fn take(&mut self) -> Option<(u64, u64)> {
        if self.depth < Self::LEAST || self.mass < 1.0 {
            return None;
        }
        let taken = (self.depth.floor(), self.mass.floor());
        self.depth -= taken.0;
        self.mass -= taken.1;
        Some((taken.0 as u64, taken.1 as u64))
    }
}
