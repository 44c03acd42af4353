//! How hard alpine snow is, and how far it is pressed.

/// Hardness of snow of 500 kg/m³ at −5 °C \[Pa\].
const HARDNESS: f32 = 100e3;

/// Gold's exponent of density, and his factor of temperature \[1/K\] (Gold 1956).
const EXPONENT: f32 = 3.92;
const WARMTH: f32 = 0.063;

/// Water, as a part of the volume, above which snow gets no softer.
const SOAKED: f32 = 0.02;

/// Part of hardness that is left at 1 kg/m³.
fn factor(celsius: f32, wetness: f32) -> f32 {
    let water = 1.0 - 2.0 / 3.0 * (wetness / SOAKED).min(1.0);
    HARDNESS * (-WARMTH * (celsius + 5.0)).exp() * water
}

/// Hardness \[Pa\] of snow of a density \[kg/m³\], a temperature \[°C\] and a part of water in its volume.
pub fn hardness(density: f32, celsius: f32, wetness: f32) -> f32 {
    (density / 500.0).powf(EXPONENT) * factor(celsius, wetness)
}

/// The density \[kg/m³\] at which snow of a temperature \[°C\] and wetness carries a stress \[Pa\].
pub fn pressed_density(stress: f32, celsius: f32, wetness: f32) -> f32 {
    500.0 * (stress / factor(celsius, wetness)).powf(1.0 / EXPONENT)
}
