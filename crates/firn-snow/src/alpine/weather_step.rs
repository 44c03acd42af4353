//! The weather in one step, made ready for all columns.

use crate::weather::{Felt, HeightsAbove, Site, air_density, specific_humidity, vapour_pressure};

use super::gathering::Due;

/// Time in which cold snow and wet snow age \[s\].
const AGEING: [f64; 2] = [300.0 * 3600.0, 70.0 * 3600.0];

/// Snow that makes a surface new \[kg/m²\].
const RENEWING: f64 = 3.0;

/// Albedo of old snow, and of new.
const ALBEDO: [f64; 2] = [0.55, 0.90];

/// Wind below which none is told from none \[m/s\].
pub(super) const LEAST_WIND: f64 = 0.1;

/// The weather in one step, the same for all columns of a snowpack.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WeatherStep {
    /// Length of the step \[s\].
    pub seconds: f32,
    /// Temperature of the air \[°C\].
    pub air: f32,
    /// Specific humidity of the air.
    pub humidity: f32,
    /// Density of the air \[kg/m³\].
    pub air_density: f32,
    /// Pressure \[Pa\].
    pub pressure: f32,
    /// Speed of the wind \[m/s\], at least 0.1.
    pub wind: f32,
    /// Short wave on level ground \[W/m²\].
    pub shortwave: f32,
    /// Long wave from the sky \[W/m²\].
    pub longwave: f32,
    /// Albedo that cold snow tends to, and that wet snow does.
    pub aged: [f32; 2],
    /// How much of the way there is left after the step, for cold snow and for wet.
    pub young: [f32; 2],
    /// Height at which temperature and humidity are measured \[m\].
    pub temperature_height: f32,
    /// Height at which wind is measured \[m\].
    pub wind_height: f32,
    /// Those heights are above ground rather than above the snow.
    pub above_ground: bool,
    /// Snow falls, whether any of it is due or not.
    pub snows: bool,
    /// Mass of the snow that is due, in quanta.
    pub snow: u32,
    /// Its thickness in quanta.
    pub snow_thickness: u32,
    /// Its temperature \[°C\].
    pub snow_temperature: f32,
    /// Mass of rain, in quanta.
    pub rain: u32,
    /// The sun's place is known, so that each column has its own part of the short wave.
    pub shades: bool,
    /// Part of the short wave that comes from all over the sky.
    pub diffuse: f32,
    /// Direction to the sun: east, up, north.
    pub sun: [f32; 3],
}

impl WeatherStep {
    /// A step of so many seconds, in which snow comes down that is due.
    pub fn new(felt: &Felt, site: &Site, seconds: f64, due: Due) -> WeatherStep {
        let pressure = 100.0 * felt.pressure;
        let vapour = vapour_pressure(felt.air_temperature, felt.relative_humidity);
        let renewal = felt.snowfall / RENEWING;
        let thin_air = (felt.pressure / 870.0).clamp(0.5, 1.0);
        let ageing = AGEING.map(|time| {
            let decay = thin_air / time;
            let rate = decay + renewal;
            let limit = (ALBEDO[0] * decay + ALBEDO[1] * renewal) / rate;
            [limit as f32, (-rate * seconds).exp() as f32]
        });
        WeatherStep {
            seconds: seconds as f32,
            air: felt.air_temperature as f32,
            humidity: specific_humidity(vapour, pressure) as f32,
            air_density: air_density(pressure, felt.air_temperature) as f32,
            pressure: pressure as f32,
            wind: felt.wind_speed.max(LEAST_WIND) as f32,
            shortwave: felt.shortwave as f32,
            longwave: felt.longwave as f32,
            aged: ageing.map(|[limit, _]| limit),
            young: ageing.map(|[_, left]| left),
            temperature_height: site.temperature_height as f32,
            wind_height: site.wind_height as f32,
            above_ground: site.heights_above == HeightsAbove::Ground,
            snows: felt.snowfall > 0.0,
            snow: due.mass,
            snow_thickness: due.thickness,
            snow_temperature: due.celsius,
            rain: due.rain,
            shades: felt.sun.is_some() && felt.shortwave > 0.0,
            diffuse: felt.diffuse as f32,
            sun: felt.sun.map_or([0.0; 3], |sun| sun.direction().map(|part| part as f32)),
        }
    }
}
