//! Weather over time.

use super::Weather;
use super::felt::Felt;
use super::site::Site;
use super::sun::SunPosition;

/// Most rows of a series.
pub const MOST_ROWS: usize = 20_000;

/// The weather from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct WeatherRow {
    /// Simulated time \[s\].
    pub at: f64,
    /// The weather.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub weather: Weather,
}

/// Weather over time. Before its first row and after its last these hold.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct WeatherSeries {
    /// The rows, in the order of their times.
    #[cfg_attr(feature = "schema", schema(min_items = 1, max_items = 20_000))]
    pub series: Vec<WeatherRow>,
    /// Whether the weather changes evenly from row to row; else a row holds until the next.
    #[cfg_attr(feature = "schema", schema(required = false, default = false))]
    pub interpolate: bool,
}

impl WeatherSeries {
    /// The weather at a simulated time \[s\]; the default weather where there are no rows, which is refused by
    /// [`WeatherInput::check`].
    pub fn at(&self, time: f64) -> Weather {
        let next = self.series.partition_point(|row| row.at <= time);
        let row = self.series.get(next.saturating_sub(1));
        match (row, self.series.get(next)) {
            (Some(row), Some(after)) if self.interpolate && next > 0 => {
                between(row, after, (time - row.at) / (after.at - row.at))
            }
            (row, _) => row.map_or_else(Weather::default, |row| row.weather),
        }
    }
}

/// What a client tells of the weather: one that holds until it is replaced, or a series.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "serde", serde(untagged))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub enum WeatherInput {
    /// It holds until it is replaced.
    Steady(Weather),
    /// It changes with simulated time.
    Series(WeatherSeries),
}

impl WeatherInput {
    /// The weather at a simulated time \[s\].
    pub fn at(&self, time: f64) -> Weather {
        match self {
            WeatherInput::Steady(weather) => *weather,
            WeatherInput::Series(series) => series.at(time),
        }
    }

    /// What a column feels at a simulated time \[s\].
    pub fn felt(&self, site: &Site, time: f64) -> Felt {
        self.at(time).felt(site, time)
    }

    /// Memory that it takes beside its own size \[bytes\].
    pub fn heap_bytes(&self) -> usize {
        match self {
            WeatherInput::Steady(_) => 0,
            WeatherInput::Series(series) => size_of_val(&series.series[..]),
        }
    }
}

impl From<Weather> for WeatherInput {
    fn from(weather: Weather) -> Self {
        WeatherInput::Steady(weather)
    }
}

/// The weather at a part of the way from a row to the next. What only the first tells holds; what only the next tells
/// begins there. So the same fields are told all the way, and a check of the rows is one of what lies between.
fn between(row: &WeatherRow, after: &WeatherRow, part: f64) -> Weather {
    let (from, to) = (&row.weather, &after.weather);
    let both = |from: Option<f64>, to: Option<f64>, mix: fn(f64, f64, f64) -> f64| {
        from.map(|value| to.map_or(value, |to| mix(value, to, part)))
    };
    let sun = |sun: SunPosition| {
        to.sun.map_or(sun, |to| SunPosition {
            azimuth: turned(sun.azimuth, to.azimuth, part),
            elevation: mixed(sun.elevation, to.elevation, part),
        })
    };
    Weather {
        air_temperature: mixed(from.air_temperature, to.air_temperature, part),
        relative_humidity: mixed(from.relative_humidity, to.relative_humidity, part),
        wind_speed: mixed(from.wind_speed, to.wind_speed, part),
        wind_direction: both(from.wind_direction, to.wind_direction, turned),
        pressure: both(from.pressure, to.pressure, mixed),
        snowfall: both(from.snowfall, to.snowfall, mixed),
        rainfall: both(from.rainfall, to.rainfall, mixed),
        precipitation: both(from.precipitation, to.precipitation, mixed),
        shortwave: both(from.shortwave, to.shortwave, mixed),
        longwave: both(from.longwave, to.longwave, mixed),
        cloud_cover: both(from.cloud_cover, to.cloud_cover, mixed),
        sun: from.sun.map(sun),
    }
}

/// A number on the way to another; rounding takes it past neither.
fn mixed(from: f64, to: f64, part: f64) -> f64 {
    (from + (to - from) * part).max(from.min(to)).min(from.max(to))
}

/// An angle \[°\] on the way to another, the short way round.
fn turned(from: f64, to: f64, part: f64) -> f64 {
    let turn = (to - from + 180.0).rem_euclid(360.0) - 180.0;
    (from + turn * part).rem_euclid(360.0)
}
