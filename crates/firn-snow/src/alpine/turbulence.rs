//! Turbulent exchange between air and skin (Louis 1979, as Essery 2015 has it).

use super::weather_step::WeatherStep;
use crate::material::GRAVITY;

/// von Kármán's constant, squared.
const KARMAN: f32 = 0.16;

/// Roughness of snow and of ground \[m\].
const ROUGHNESS: [f32; 2] = [0.005, 0.05];

/// The lowest height above snow that instruments count as having \[m\].
const LOWEST: f32 = 0.5;

/// 0 °C \[K\].
pub(super) const FREEZING: f32 = 273.15;

/// What exchange owes to the instruments and the wind; the rest is the skin's.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turbulence {
    /// Coefficient of exchange where air and skin are equally warm.
    neutral: f32,
    /// Richardson's number for each kelvin by which the air is warmer than the skin.
    stratification: f32,
    /// What stirs air that is colder than the skin.
    stirring: f32,
}

impl Turbulence {
    /// That over snow of a depth \[m\], or over ground.
    pub fn new(weather: &WeatherStep, snow: bool, depth: f32) -> Turbulence {
        let above = |height: f32| match weather.above_ground {
            true => (height - depth).max(LOWEST),
            false => height,
        };
        let (wind, temperature) = (above(weather.wind_height), above(weather.temperature_height));
        let roughness = ROUGHNESS[usize::from(!snow)];
        let drag = (wind / roughness).ln();
        Turbulence {
            neutral: KARMAN / (drag * (10.0 * temperature / roughness).ln()),
            stratification: GRAVITY as f32 * wind * wind
                / (temperature * (weather.air + FREEZING) * weather.wind * weather.wind),
            stirring: 75.0 * KARMAN / (drag * drag) * (wind / roughness).sqrt(),
        }
    }

    /// Coefficient of exchange where the air is so much warmer than the skin \[K\].
    pub fn exchange(&self, warmer: f32) -> f32 {
        let richardson = self.stratification * warmer;
        if richardson >= 0.0 {
            let richardson = richardson.min(0.1);
            return self.neutral / (1.0 + 15.0 * richardson * (1.0 + 5.0 * richardson).sqrt());
        }
        let stirred = 1.0 + self.stirring * (-richardson).sqrt();
        self.neutral * (1.0 - 15.0 * richardson / stirred)
    }
}
