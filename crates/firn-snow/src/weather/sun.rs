//! Where the sun stands, and how strongly it shines above the air.

/// Radiation of the sun at its mean distance, above the air \[W/m²\] (Kopp and Lean 2011).
pub const SOLAR_CONSTANT: f64 = 1361.0;

/// Seconds of a day.
const DAY: f64 = 86_400.0;

/// Where the sun stands in the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SunPosition {
    /// Its direction \[°\]: 0 is north (+z), 90 is east (+x).
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 360))]
    pub azimuth: f64,
    /// How high it stands above the horizon \[°\]; below 0 it is night.
    #[cfg_attr(feature = "schema", schema(minimum = -90, maximum = 90))]
    pub elevation: f64,
}

impl SunPosition {
    /// The direction to it, of length 1: x east, y up, z north.
    pub fn direction(&self) -> [f64; 3] {
        let (sin_azimuth, cos_azimuth) = self.azimuth.to_radians().sin_cos();
        let (up, level) = self.elevation.to_radians().sin_cos();
        [level * sin_azimuth, up, level * cos_azimuth]
    }

    /// Sine of the elevation: the part of its radiation that meets a level surface; 0 by night.
    pub fn height(&self) -> f64 {
        self.elevation.to_radians().sin().max(0.0)
    }
}

/// Where the sun stands, seen from a latitude and a longitude \[°\], north and east positive, at an instant \[s\] since
/// 1970-01-01T00:00:00Z.
///
/// The equations of NOAA's solar calculator (after Meeus 1998), good to about 0.01° between 1800 and 2100. It is the
/// true position: the refraction of the air, which lifts a sun at the horizon by half a degree, is left out.
pub fn sun_position(latitude: f64, longitude: f64, instant: f64) -> SunPosition {
    let sun = Orbit::at(instant);
    let true_solar_minutes =
        instant.rem_euclid(DAY) / 60.0 + sun.equation_of_time + 4.0 * longitude;
    let (sin_hour, cos_hour) = (true_solar_minutes / 4.0 - 180.0).to_radians().sin_cos();
    let (sin_latitude, cos_latitude) = latitude.to_radians().sin_cos();
    let (sin_declination, cos_declination) = sun.declination.sin_cos();
    let up = sin_latitude * sin_declination + cos_latitude * cos_declination * cos_hour;
    // From the south, westwards. Without tangents it holds at the poles too.
    let west = cos_declination * sin_hour;
    let south = sin_latitude * cos_declination * cos_hour - cos_latitude * sin_declination;
    SunPosition {
        azimuth: (west.atan2(south).to_degrees() + 180.0).rem_euclid(360.0),
        elevation: up.clamp(-1.0, 1.0).asin().to_degrees(),
    }
}

/// Radiation of the sun above the air on a surface that faces it \[W/m²\], at an instant \[s\] since
/// 1970-01-01T00:00:00Z: 1361 W/m² over the square of its distance, 3.4 % more in January and less in July.
pub fn solar_irradiance(instant: f64) -> f64 {
    SOLAR_CONSTANT / Orbit::at(instant).distance.powi(2)
}

/// The sun as the earth sees it.
struct Orbit {
    /// Declination \[rad\].
    declination: f64,
    /// By how much a sundial is ahead of a clock \[min\].
    equation_of_time: f64,
    /// Distance \[AU\].
    distance: f64,
}

impl Orbit {
    /// At an instant \[s\] since 1970, by NOAA's equations; t is in Julian centuries since 2000-01-01T12:00.
    fn at(instant: f64) -> Orbit {
        let t = (instant / DAY + 2_440_587.5 - 2_451_545.0) / 36_525.0;
        let mean_longitude = (280.466_46 + t * (36_000.769_83 + t * 0.000_303_2)).to_radians();
        let anomaly = (357.529_11 + t * (35_999.050_29 - t * 0.000_153_7)).to_radians();
        let eccentricity = 0.016_708_634 - t * (0.000_042_037 + t * 0.000_000_126_7);
        let centre = (anomaly.sin() * (1.914_602 - t * (0.004_817 + t * 0.000_014))
            + (2.0 * anomaly).sin() * (0.019_993 - t * 0.000_101)
            + (3.0 * anomaly).sin() * 0.000_289)
            .to_radians();
        let node = (125.04 - 1_934.136 * t).to_radians();
        let longitude = mean_longitude + centre - (0.005_69 + 0.004_78 * node.sin()).to_radians();
        let arc_seconds = 21.448 - t * (46.815 + t * (0.000_59 - t * 0.001_813));
        let obliquity =
            (23.0 + (26.0 + arc_seconds / 60.0) / 60.0 + 0.002_56 * node.cos()).to_radians();

        let y = (obliquity / 2.0).tan().powi(2);
        let equation_of_time = y * (2.0 * mean_longitude).sin()
            - 2.0 * eccentricity * anomaly.sin()
            + 4.0 * eccentricity * y * anomaly.sin() * (2.0 * mean_longitude).cos()
            - 0.5 * y * y * (4.0 * mean_longitude).sin()
            - 1.25 * eccentricity * eccentricity * (2.0 * anomaly).sin();
        Orbit {
            declination: (obliquity.sin() * longitude.sin()).clamp(-1.0, 1.0).asin(),
            // The earth turns by a degree in four minutes.
            equation_of_time: 4.0 * equation_of_time.to_degrees(),
            distance: 1.000_001_018 * (1.0 - eccentricity * eccentricity)
                / (1.0 + eccentricity * (anomaly + centre).cos()),
        }
    }
}

#[cfg(test)]
mod tests;
