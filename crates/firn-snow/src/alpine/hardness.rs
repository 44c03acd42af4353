//! How hard alpine snow is, and how far it is pressed.

use super::WATER_DENSITY;
use crate::column::Cell;

/// Hardness of snow of 500 kg/m³ at −5 °C \[Pa\].
const HARDNESS: f32 = 100e3;

/// Gold's exponent of density, and his factor of temperature \[1/K\] (Gold 1956).
const EXPONENT: f32 = 3.92;
const WARMTH: f32 = 0.063;

/// Water, as a part of the volume, above which snow gets no softer.
const SOAKED: f32 = 0.02;

/// The density \[kg/m³\] beyond which no load presses snow. Snow that is denser stays as it is.
pub const PRESSED_DENSITY: f32 = 700.0;

/// Hardness \[Pa\] of snow of a density \[kg/m³\], a temperature \[°C\] and a part of water in its volume.
pub fn hardness(density: f32, celsius: f32, wetness: f32) -> f32 {
    (density / 500.0).powf(EXPONENT) * (warmth(celsius) * softness(wetness))
}

/// The density \[kg/m³\] at which snow of a temperature \[°C\] and wetness carries a stress \[Pa\].
pub fn pressed_density(stress: f32, celsius: f32, wetness: f32) -> f32 {
    500.0 * (stress / (warmth(celsius) * softness(wetness))).powf(1.0 / EXPONENT)
}

/// Hardness \[Pa\] of dry snow of 500 kg/m³ at a temperature \[°C\].
fn warmth(celsius: f32) -> f32 {
    HARDNESS * (-WARMTH * (celsius + 5.0)).exp()
}

/// Part of hardness that water leaves.
fn softness(wetness: f32) -> f32 {
    1.0 - 2.0 / 3.0 * (wetness / SOAKED).min(1.0)
}

/// What hardness of a cell owes to its temperature and its water: for a look at many densities.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Strength {
    /// Hardness \[Pa\] of dry snow of 500 kg/m³.
    warmth: f32,
    /// Water in a unit of density, as a part of the volume \[m³/kg\]: pressed snow is wetter.
    wet: f32,
}

impl Strength {
    /// That of dry snow.
    pub fn dry(celsius: f32) -> Strength {
        Strength { warmth: warmth(celsius), wet: 0.0 }
    }

    /// That of a cell.
    pub fn of(cell: &Cell) -> Strength {
        let dry = Strength::dry(cell.celsius());
        match cell.water() {
            0 => dry,
            water => Strength { wet: water as f32 / cell.mass as f32 / WATER_DENSITY, ..dry },
        }
    }

    /// Whether there is no water in it.
    pub fn is_dry(&self) -> bool {
        self.wet == 0.0
    }

    /// Hardness \[Pa\] at a density \[kg/m³\].
    pub fn hardness(&self, density: f32) -> f32 {
        (density / 500.0).powf(EXPONENT) * (self.warmth * softness(self.wet * density))
    }

    /// The density \[kg/m³\] at which it carries a stress \[Pa\], as wet as it is at a density.
    pub fn pressed(&self, stress: f32, density: f32) -> f32 {
        let factor = self.warmth * softness(self.wet * density);
        500.0 * (stress / factor).powf(1.0 / EXPONENT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hardness_is_that_of_its_sources_and_the_density_pressed_to_inverts_it() {
        let near = |a: f32, b: f32| assert!((a / b - 1.0).abs() < 1e-4, "{a} is not {b}");
        near(hardness(500.0, -5.0, 0.0), 100e3);
        near(hardness(250.0, -5.0, 0.0), 100e3 / 2_f32.powf(3.92));
        near(hardness(500.0, 0.0, 0.0), 72_979.0);
        near(hardness(500.0, -5.0, 0.01), 200e3 / 3.0);
        near(hardness(500.0, -5.0, 0.02), 100e3 / 3.0);
        assert_eq!(hardness(500.0, 0.0, 0.3), hardness(500.0, 0.0, 0.02));
        for (density, celsius, wetness) in
            [(80.0, -20.0, 0.0), (300.0, 0.0, 0.01), (650.0, 0.0, 0.1)]
        {
            let stress = hardness(density, celsius, wetness);
            near(pressed_density(stress, celsius, wetness), density);
        }
    }

    #[test]
    fn a_cell_is_as_wet_as_it_is_thick() {
        let mut cell = Cell { mass: 30 << 18, thickness: 1 << 23, ..Cell::default() };
        cell.set_heat(-7.0, 0);
        let dry = Strength::of(&cell);
        assert!(dry.is_dry());
        assert_eq!(dry.hardness(300.0), hardness(300.0, -7.0, 0.0));
        cell.set_heat(0.0, 1 << 18);
        let wet = Strength::of(&cell);
        // A thirtieth of the mass is water: 10 kg/m³ at 300 kg/m³, twice as much when it is twice as dense.
        for (density, wetness) in [(300.0, 0.01), (600.0, 0.02), (690.0, 0.023)] {
            let (found, expected) = (wet.hardness(density), hardness(density, 0.0, wetness));
            assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
        }
    }
}
