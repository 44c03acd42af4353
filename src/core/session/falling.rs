//! Continuous snowfall, kept to the fraction of a quantum until there is enough to deposit.

use firn_protocol::SessionSpec;
use firn_snow::{CELL, Grid, MASS_QUANTA};
use serde::{Deserialize, Serialize};

/// Least depth that is deposited, h/256, in quanta.
const LEAST: f64 = (CELL / 256) as f64;

/// Snow of one tick, in quanta of one column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Snowing {
    depth: f64,
    mass: f64,
}

impl Snowing {
    /// Snow of a rate \[m/h\] and density \[kg/m³\] in a tick of some length \[s\].
    pub fn new(rate: f64, density: f64, dt: f64, grid: &Grid) -> Snowing {
        let depth = rate / 3600.0 * dt;
        Snowing {
            depth: depth / grid.cell_size * f64::from(CELL),
            mass: depth * density * MASS_QUANTA,
        }
    }
}

/// Snow that has not been deposited yet.
///
/// It is derived from ticks, so that the portions in which ticks are taken make no difference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Falling {
    /// Tick at which `depth` and `mass` were in the air.
    tick: u64,
    depth: f64,
    mass: f64,
}

impl Falling {
    /// Whether it is not impossible at a tick.
    pub fn is_sound(&self, tick: u64, spec: &SessionSpec) -> bool {
        // A tick may bring much, but no more than all slots of a column hold.
        let most = f64::from(spec.grid.height) * f64::from(CELL);
        let heaviest = self.depth * spec.grid.cell_size * spec.material.max_density / 64.0;
        self.tick <= tick
            && (0.0..=most).contains(&self.depth)
            && (0.0..=heaviest * 1.001 + 2.0).contains(&self.mass)
    }

    /// Counts what has fallen up to a tick, before it snows otherwise.
    pub fn mark(&mut self, tick: u64, snowing: Snowing) {
        let ticks = (tick - self.tick) as f64;
        self.depth += ticks * snowing.depth;
        self.mass += ticks * snowing.mass;
        self.tick = tick;
    }

    /// Ticks after a tick until enough has fallen, at least one; none where it doesn't snow.
    pub fn ticks_until_due(&self, tick: u64, snowing: Snowing) -> Option<u64> {
        if snowing.depth <= 0.0 {
            return None;
        }
        let ticks = ((LEAST - self.depth) / snowing.depth).ceil().max(0.0) as u64;
        Some(self.tick.saturating_add(ticks).saturating_sub(tick).max(1))
    }

    /// Whole quanta of depth and mass, where enough has fallen up to a tick; fractions stay.
    pub fn take(&mut self, tick: u64, snowing: Snowing) -> Option<(u64, u64)> {
        let mut sum = *self;
        sum.mark(tick, snowing);
        if sum.depth < LEAST || sum.mass < 1.0 {
            return None;
        }
        let taken = (sum.depth.floor(), sum.mass.floor());
        *self = Falling { tick, depth: sum.depth - taken.0, mass: sum.mass - taken.1 };
        Some((taken.0 as u64, taken.1 as u64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All that is deposited when ticks are taken in portions of some length.
    fn deposits(portion: u64) -> (Vec<(u64, u64, u64)>, Falling) {
        let snowing = Snowing::new(0.37, 20.0, 1.0 / 60.0, &Grid::default());
        let mut falling = Falling::default();
        let (mut tick, mut deposits) = (0, Vec::new());
        while tick < 50_000 {
            let due = falling.ticks_until_due(tick, snowing).unwrap();
            tick += due.min(portion).min(50_000 - tick);
            if let Some((depth, mass)) = falling.take(tick, snowing) {
                deposits.push((tick, depth, mass));
            }
        }
        (deposits, falling)
    }

    #[test]
    fn snow_falls_alike_in_portions_of_any_length() {
        let (one_by_one, rest) = deposits(1);
        assert!(one_by_one.len() > 100);
        for portion in [2, 7, 1000, 100_000] {
            assert_eq!(deposits(portion), (one_by_one.clone(), rest));
        }
        // 0.37 m/h over 50 000 sixtieths of a second, all but a rest of less than h/256.
        let depth: u64 = one_by_one.iter().map(|deposit| deposit.1).sum();
        let fallen = Grid::default().metres(depth);
        let wanted = 0.37 / 3600.0 * 50_000.0 / 60.0;
        assert!(wanted - fallen >= 0.0 && wanted - fallen < 0.2 / 255.0, "{fallen} of {wanted} m");
    }

    #[test]
    fn snow_that_hardly_falls_is_due_in_an_endless_time() {
        let snowing = Snowing::new(93.0, 20.0, 1e-290, &Grid::default());
        let falling = Falling { tick: 7, ..Falling::default() };
        assert_eq!(falling.ticks_until_due(9, snowing), Some(u64::MAX - 9));
    }
}
