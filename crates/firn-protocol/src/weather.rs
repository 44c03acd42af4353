//! Snowfalls, clearings, the air's temperature, and the weather of alpine snow.

use std::sync::Arc;

use firn_snow::weather::{SunPosition, WeatherInput};
use serde::{Deserialize, Serialize};

use crate::session::Stamp;

/// Fresh snow on a region.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Snowfall {
    /// Depth \[m\], at least `cell_size`/256.
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0, maximum = 1000))]
    pub depth: f64,
    /// Density \[kg/m³\]; the material's `fresh_density` where there is none, in alpine snow that of new snow in this
    /// weather.
    #[cfg_attr(feature = "schema", schema(minimum = 10, maximum = 917))]
    pub density: Option<f64>,
    /// Temperature \[°C\], in alpine snow down to −60; the air's where there is none, 0 at most.
    #[cfg_attr(feature = "schema", schema(minimum = -60, maximum = 0))]
    pub temperature: Option<f64>,
    /// Where it falls; everywhere where there is none.
    pub region: Option<Region>,
}

impl Snowfall {
    /// A depth \[m\] of fresh snow everywhere, as the session's material and air make it.
    pub fn new(depth: f64) -> Snowfall {
        Snowfall { depth, density: None, temperature: None, region: None }
    }
}

/// A plough: leaves at most a depth of snow standing.
///
/// It clears either a `region`, or a `path` of a `width`, or everything.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Clearing {
    /// Depth left standing \[m\].
    #[cfg_attr(feature = "schema", schema(minimum = 0))]
    pub depth: f64,
    /// A rectangle that is cleared.
    pub region: Option<Region>,
    /// The way of a plough: points \[x, z\] \[m\]. The columns whose centres lie within half the width of it are
    /// cleared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<Vec<Vec<f64>>>, min_items = 2, max_items = 4096))]
    pub path: Option<Vec<[f64; 2]>>,
    /// Width of the path \[m\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(minimum = 0.001, maximum = 1000))]
    pub width: Option<f64>,
}

/// A rectangle in metres: the columns whose centres lie in it, lower edges included, upper ones
/// not.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Lower edge along x \[m\].
    pub x: f64,
    /// Lower edge along z \[m\].
    pub z: f64,
    /// Extent along x \[m\].
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
    pub width: f64,
    /// Extent along z \[m\].
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
    pub depth: f64,
}

/// Another air temperature.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct AirTemperature {
    /// Temperature \[°C\], from −40 to 0; in alpine snow from −60 to 50.
    #[cfg_attr(feature = "schema", schema(minimum = -60, maximum = 50))]
    pub celsius: f64,
}

/// Answer to a snowfall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SnowfallReply {
    /// When it was applied.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// Mass that fell \[kg\], the refused part included.
    pub fallen_mass: f64,
    /// Mass that found no room \[kg\].
    pub refused_mass: f64,
}

/// Answer to a clearing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ClearingReply {
    /// When it was applied.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// Mass that was removed \[kg\].
    pub cleared_mass: f64,
}

/// Answer to an air temperature.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct AirTemperatureReply {
    /// When it was applied.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// Temperature of the air \[°C\].
    pub celsius: f64,
}

/// The weather of alpine snow: what was told, and what holds now.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct WeatherView {
    /// When this holds.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// Simulated time \[s\].
    pub sim_time: f64,
    /// Steps of weather that the snow has taken.
    pub steps: u64,
    /// What holds now.
    pub now: WeatherNow,
    /// What of that was not told but worked out: `shortwave`, `longwave`, `sun`, `pressure`, `cloud_cover`.
    pub derived: Vec<String>,
    /// What was told.
    #[cfg_attr(feature = "schema", schema(value_type = WeatherInput))]
    pub weather: Arc<WeatherInput>,
}

/// The weather at one time, with nothing left out but the sun where nobody knows where it stands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct WeatherNow {
    /// Temperature of the air \[°C\].
    pub air_temperature: f64,
    /// Relative humidity over water \[%\].
    pub relative_humidity: f64,
    /// Wind speed \[m/s\].
    pub wind_speed: f64,
    /// Where the wind comes from \[°\]; `null` where nobody has told.
    #[cfg_attr(feature = "schema", schema(required = true))]
    pub wind_direction: Option<f64>,
    /// Air pressure \[hPa\].
    pub pressure: f64,
    /// Snowfall, as water \[mm/h\].
    pub snowfall: f64,
    /// Rainfall \[mm/h\].
    pub rainfall: f64,
    /// Short-wave radiation on a level surface \[W/m²\].
    pub shortwave: f64,
    /// Long-wave radiation from the sky \[W/m²\].
    pub longwave: f64,
    /// Part of the sky that clouds cover, 0 to 1.
    pub cloud_cover: f64,
    /// Where the sun stands; `null` where nobody knows.
    #[cfg_attr(feature = "schema", schema(required = true))]
    pub sun: Option<SunPosition>,
}
