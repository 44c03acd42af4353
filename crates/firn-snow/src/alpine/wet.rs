//! Temperature and liquid water of a cell, in the one word that holds them.
//!
//! A cell is never both cold and wet at the end of a step. Below 0 °C the word is the temperature. At 0 °C it
//! is the number whose bits are the water in quanta, counted from those of 2.0: so a wet cell has a word of 2 or
//! more, which no shader takes for a temperature and none flushes to zero.

use super::{FUSION, ICE_HEAT, MASS_QUANTA, MASS_QUANTUM, WATER_HEAT};
use crate::column::Cell;

/// The bits of 2.0, from which water is counted.
const WET: u32 = 0x4000_0000;

impl Cell {
    /// Temperature \[°C\], at most 0 in alpine snow.
    #[inline]
    pub fn celsius(&self) -> f32 {
        if self.temperature >= 2.0 { 0.0 } else { self.temperature }
    }

    /// Liquid water in mass quanta, part of the mass.
    #[inline]
    pub fn water(&self) -> u32 {
        if self.temperature >= 2.0 { self.temperature.to_bits() - WET } else { 0 }
    }

    /// Ice in mass quanta.
    #[inline]
    pub fn ice(&self) -> u32 {
        self.mass - self.water()
    }

    /// Sets the temperature \[°C\], at most 0, and the water in quanta, at most the mass. Where there is water, the
    /// temperature is 0.
    #[inline]
    pub fn set_heat(&mut self, celsius: f32, water: u32) {
        self.temperature = if water > 0 { f32::from_bits(WET + water) } else { celsius.min(0.0) };
    }

    /// Cuts it down to a thickness in quanta, at most its own. What is left keeps its part of the mass and of the
    /// water, both rounded down, and may be without mass; returns the mass that is cut off.
    pub(crate) fn cut(&mut self, thickness: u32) -> u32 {
        let part = |quanta: u32| {
            // A part of a 32-bit number.
            (u64::from(quanta) * u64::from(thickness) / u64::from(self.thickness)) as u32
        };
        let (mass, water) = (part(self.mass), part(self.water()));
        if self.water() > 0 {
            self.set_heat(0.0, water);
        }
        let cut = self.mass - mass;
        (self.mass, self.thickness) = (mass, thickness);
        cut
    }

    /// Heat \[J/m²\] above that of as much ice at 0 °C.
    #[inline]
    pub fn heat(&self) -> f32 {
        self.capacity() * self.celsius() + FUSION * kilograms(self.water())
    }

    /// Heat that warms it by 1 K \[J/(m² K)\].
    #[inline]
    pub(super) fn capacity(&self) -> f32 {
        capacity(self.ice(), self.water())
    }
}

/// Heat that warms ice and water in quanta by 1 K \[J/(m² K)\].
#[inline]
pub(super) fn capacity(ice: u32, water: u32) -> f32 {
    ICE_HEAT * kilograms(ice) + WATER_HEAT * kilograms(water)
}

/// Areal mass \[kg/m²\] of a number of quanta.
#[inline]
pub(super) fn kilograms(quanta: u32) -> f32 {
    quanta as f32 * MASS_QUANTUM
}

/// Quanta of an areal mass \[kg/m²\], to the nearest; none of a negative one.
#[inline]
pub(super) fn quanta(kilograms: f32) -> u32 {
    (kilograms * MASS_QUANTA).round_ties_even() as u32
}

/// A thickness or mass in quanta times a part of 1, to the nearest.
#[inline]
pub(super) fn part(quanta: u32, part: f32) -> u32 {
    (quanta as f32 * part).round_ties_even() as u32
}

/// Two cells as one, with their mass and their heat: cold freezes water. Stress is that of the lower one.
pub(crate) fn merge(lower: Cell, upper: Cell) -> Cell {
    let mut cell = Cell {
        mass: lower.mass + upper.mass,
        thickness: lower.thickness + upper.thickness,
        ..lower
    };
    let heat = lower.capacity() * lower.celsius() + upper.capacity() * upper.celsius();
    let water = lower.water() + upper.water();
    let frozen = quanta(-heat / FUSION).min(water);
    let (ice, water) = (cell.mass - water + frozen, water - frozen);
    let left = heat + FUSION * kilograms(frozen);
    cell.set_heat(left / capacity(ice, water), water);
    cell
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(mass: f32, celsius: f32, water: f32) -> Cell {
        let mut cell = Cell { mass: quanta(mass), thickness: 1 << 20, ..Cell::default() };
        cell.set_heat(celsius, quanta(water));
        cell
    }

    #[test]
    fn a_word_holds_a_temperature_or_water() {
        let cold = cell(10.0, -3.5, 0.0);
        assert_eq!((cold.celsius(), cold.water(), cold.ice()), (-3.5, 0, 10 << 18));
        let wet = cell(10.0, -3.5, 0.25);
        assert_eq!((wet.celsius(), wet.water(), wet.ice()), (0.0, 1 << 16, (10 << 18) - (1 << 16)));
        let dry = cell(10.0, 4.0, 0.0);
        assert_eq!((dry.celsius(), dry.water()), (0.0, 0));
        assert!(cell(2000.0, 0.0, 2000.0).temperature.is_finite());
    }

    #[test]
    fn a_cell_that_is_cut_keeps_its_part_of_the_water() {
        let cut = |mut cell: Cell, thickness| (cell.cut(thickness), cell);
        let wet = cell(10.0, 0.0, 3.0);
        let (mass, left) = cut(wet, wet.thickness / 4 * 3);
        assert_eq!((mass, left.mass), (10 << 16, 30 << 16));
        assert_eq!((left.water(), left.celsius(), left.ice()), (9 << 16, 0.0, 21 << 16));
        let (_, sliver) = cut(cell(10.0, 0.0, 1e-5), wet.thickness / 4);
        assert_eq!((sliver.water(), sliver.temperature.to_bits()), (0, 0), "less than a quantum");
        assert_eq!(cut(wet, wet.thickness), (0, wet));
        assert_eq!(cut(wet, 0).0, wet.mass);
        for celsius in [-3.7, -0.0] {
            let dry = Cell { temperature: celsius, ..cell(10.0, 0.0, 0.0) };
            let (_, left) = cut(dry, dry.thickness / 3);
            assert_eq!(left.temperature.to_bits(), celsius.to_bits());
        }
    }

    #[test]
    fn joined_cells_keep_mass_and_heat() {
        for (a, b) in [
            (cell(10.0, -8.0, 0.0), cell(4.0, -1.0, 0.0)),
            (cell(10.0, -8.0, 0.0), cell(4.0, 0.0, 0.1)),
            (cell(10.0, -8.0, 0.0), cell(4.0, 0.0, 2.0)),
            (cell(3.0, 0.0, 1.0), cell(4.0, 0.0, 2.0)),
        ] {
            for (lower, upper) in [(a, b), (b, a)] {
                let joined = merge(lower, upper);
                assert_eq!(joined.mass, a.mass + b.mass);
                assert!(joined.water() == 0 || joined.celsius() == 0.0);
                let (before, after) = (a.heat() + b.heat(), joined.heat());
                // Half a quantum of ice is 0.6 J; rounding of f32 is more for much snow.
                assert!((after - before).abs() < 1.5, "{before} {after}");
            }
        }
    }
}
