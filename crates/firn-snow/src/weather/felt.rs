//! What a column feels of the weather.

use super::air::split_precipitation;
use super::site::Site;
use super::sun::{SOLAR_CONSTANT, SunPosition, solar_irradiance};
use super::{Weather, radiation};

/// What was not given but worked out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Derived {
    /// The short wave.
    pub shortwave: bool,
    /// The long wave.
    pub longwave: bool,
}

/// What a level column in the open feels of the weather: what a weather step is made of. Nothing is missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Felt {
    /// Temperature of the air \[°C\].
    pub air_temperature: f64,
    /// Relative humidity over water \[%\].
    pub relative_humidity: f64,
    /// Wind speed \[m/s\].
    pub wind_speed: f64,
    /// Air pressure \[hPa\].
    pub pressure: f64,
    /// Snowfall \[kg/m²/s\].
    pub snowfall: f64,
    /// Rainfall \[kg/m²/s\].
    pub rainfall: f64,
    /// Short wave on a level surface \[W/m²\].
    pub shortwave: f64,
    /// Long wave from the sky \[W/m²\].
    pub longwave: f64,
    /// Diffuse part of the short wave, 0 to 1; 1 where nobody knows where the sun is.
    pub diffuse: f64,
    /// Where the sun stands, where that is known.
    pub sun: Option<SunPosition>,
    /// What of it was worked out.
    pub derived: Derived,
}

impl Weather {
    /// What a column feels of it at a site at a simulated time \[s\].
    ///
    /// Where the short wave is neither given nor to be worked out, which [`check`](Weather::check) refuses, it is 0.
    pub fn felt(&self, site: &Site, time: f64) -> Felt {
        let sun = self.sun.or_else(|| site.sun(time));
        let (snowfall, rainfall) = self.snow_and_rain();
        let cloud_cover = self.cloudiness();
        let shortwave = self
            .shortwave
            .unwrap_or_else(|| sun.map_or(0.0, |sun| radiation::shortwave(sun, cloud_cover)));
        let longwave = self.longwave.unwrap_or_else(|| {
            radiation::longwave(self.air_temperature, self.relative_humidity, cloud_cover)
        });
        let irradiance = site.instant(time).map_or(SOLAR_CONSTANT, solar_irradiance);
        Felt {
            air_temperature: self.air_temperature,
            relative_humidity: self.relative_humidity,
            wind_speed: self.wind_speed,
            pressure: self.pressure.unwrap_or(site.pressure),
            // A millimetre of water is a kilogram per square metre.
            snowfall: snowfall / 3600.0,
            rainfall: rainfall / 3600.0,
            shortwave,
            longwave,
            diffuse: sun.map_or(1.0, |sun| radiation::diffuse_part(shortwave, sun, irradiance)),
            sun,
            derived: Derived {
                shortwave: self.shortwave.is_none(),
                longwave: self.longwave.is_none(),
            },
        }
    }

    /// Snowfall and rainfall \[mm/h\].
    pub fn snow_and_rain(&self) -> (f64, f64) {
        match self.precipitation {
            Some(precipitation) => split_precipitation(precipitation, self.air_temperature),
            None => (self.snowfall.unwrap_or(0.0), self.rainfall.unwrap_or(0.0)),
        }
    }

    /// Part of the sky that clouds cover, 0 to 1: where it is not given, all of it while snow or rain falls and none
    /// else.
    pub fn cloudiness(&self) -> f64 {
        let (snow, rain) = self.snow_and_rain();
        self.cloud_cover.unwrap_or(if snow + rain > 0.0 { 1.0 } else { 0.0 })
    }
}
