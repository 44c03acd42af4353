//! Weather: what a client tells of it, and what a column of snow feels.
//!
//! A client gives a [`Weather`] that holds until it is replaced, or a [`WeatherSeries`]; both are a
//! [`WeatherInput`]. [`WeatherInput::check`] refuses what can't be. [`WeatherInput::felt`] makes of it, of the
//! [`Site`] and of the simulated clock a [`Felt`], in which nothing is missing: radiation that was not given is
//! worked out.

mod air;
mod check;
mod felt;
#[cfg(feature = "serde")]
mod fields;
mod radiation;
mod series;
mod site;
mod start;
mod sun;

pub use air::{
    KELVIN, SNOW_UP_TO, air_density, new_snow_density, saturation_over_ice, saturation_over_water,
    specific_humidity, split_precipitation, vapour_pressure,
};
pub use check::Problem;
pub use felt::{Derived, Felt};
pub use radiation::{
    LOWEST_DIRECT, STEFAN_BOLTZMANN, clear_sky, clear_sky_emissivity, diffuse_fraction,
    diffuse_part, longwave, shortwave,
};
pub use series::{MOST_ROWS, WeatherInput, WeatherRow, WeatherSeries};
pub use site::{HeightsAbove, Site};
pub use start::Start;
pub use sun::{SOLAR_CONSTANT, SunPosition, solar_irradiance, sun_position};

/// The weather at one time, as a client tells it.
///
/// Radiation that is left out is worked out: see [`shortwave`](fn@shortwave) and [`longwave`](fn@longwave).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Weather {
    /// Temperature of the air \[°C\].
    #[cfg_attr(feature = "schema", schema(minimum = -60, maximum = 50))]
    pub air_temperature: f64,
    /// Relative humidity over water \[%\].
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 100))]
    pub relative_humidity: f64,
    /// Wind speed \[m/s\].
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 100))]
    pub wind_speed: f64,
    /// Where the wind comes from \[°\]: 0 is north (+z), 90 is east (+x).
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 360))]
    pub wind_direction: Option<f64>,
    /// Air pressure \[hPa\]; the site's where there is none.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    #[cfg_attr(feature = "schema", schema(minimum = 300, maximum = 1100))]
    pub pressure: Option<f64>,
    /// Snowfall, as water \[mm/h\]; 0 where there is none.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 1000))]
    pub snowfall: Option<f64>,
    /// Rainfall \[mm/h\]; 0 where there is none.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 1000))]
    pub rainfall: Option<f64>,
    /// Snow and rain together \[mm/h\], in place of `snowfall` and `rainfall`: all snow up to 1.2 °C, else rain.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 1000))]
    pub precipitation: Option<f64>,
    /// Short-wave radiation on a level surface \[W/m²\]; worked out from the sun and the clouds where there is none.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 2000))]
    pub shortwave: Option<f64>,
    /// Long-wave radiation from the sky \[W/m²\]; worked out from temperature, humidity and clouds where there is
    /// none.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 1000))]
    pub longwave: Option<f64>,
    /// Part of the sky that clouds cover, 0 to 1. Where there is none, the sky is overcast while snow or rain falls
    /// and clear else.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 1))]
    pub cloud_cover: Option<f64>,
    /// Where the sun stands; worked out from the site and the clock where there is none.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub sun: Option<SunPosition>,
}

impl Default for Weather {
    /// A dry winter's day with a light wind.
    fn default() -> Self {
        Weather {
            air_temperature: -3.0,
            relative_humidity: 80.0,
            wind_speed: 2.0,
            wind_direction: None,
            pressure: None,
            snowfall: None,
            rainfall: None,
            precipitation: None,
            shortwave: None,
            longwave: None,
            cloud_cover: None,
            sun: None,
        }
    }
}

#[cfg(test)]
mod tests;
