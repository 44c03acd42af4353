//! Where and when a snowpack is, and how its weather is measured.

use super::start::Start;
use super::sun::{self, SunPosition};

/// What the heights of the sensors are counted from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub enum HeightsAbove {
    /// The snow, as in weather models and where sensors are moved by hand.
    #[default]
    Snow,
    /// The ground, as on a fixed mast.
    Ground,
}

impl HeightsAbove {
    /// The lowest a sensor counts as above the snow \[m\].
    pub const LOWEST: f64 = 0.5;

    /// How high above snow of a depth \[m\] a sensor of a height \[m\] is \[m\].
    pub fn over(self, height: f64, depth: f64) -> f64 {
        match self {
            HeightsAbove::Snow => height,
            HeightsAbove::Ground => (height - depth).max(Self::LOWEST),
        }
    }
}

/// Where and when a snowpack is, and how its weather is measured.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Site {
    /// Latitude \[°\], north positive.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    #[cfg_attr(feature = "schema", schema(minimum = -90, maximum = 90))]
    pub latitude: Option<f64>,
    /// Longitude \[°\], east positive.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    #[cfg_attr(feature = "schema", schema(minimum = -180, maximum = 180))]
    pub longitude: Option<f64>,
    /// When the simulated clock is at 0, after RFC 3339.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub start: Option<Start>,
    /// Air pressure \[hPa\] while the weather tells none.
    #[cfg_attr(feature = "schema", schema(minimum = 300, maximum = 1100))]
    pub pressure: f64,
    /// Height at which the air's temperature and humidity are measured \[m\].
    #[cfg_attr(feature = "schema", schema(minimum = 0.5, maximum = 100))]
    pub temperature_height: f64,
    /// Height at which the wind is measured \[m\].
    #[cfg_attr(feature = "schema", schema(minimum = 0.5, maximum = 100))]
    pub wind_height: f64,
    /// What those heights are counted from.
    pub heights_above: HeightsAbove,
    /// Temperatures of the soil at the beginning \[°C\], in layers of 0.1, 0.2, 0.4 and 0.8 m from the top.
    #[cfg_attr(feature = "schema", schema(value_type = Vec<f64>, min_items = 4, max_items = 4))]
    pub soil: [f64; 4],
}

impl Default for Site {
    fn default() -> Self {
        Site {
            latitude: None,
            longitude: None,
            start: None,
            pressure: 1013.25,
            temperature_height: 2.0,
            wind_height: 10.0,
            heights_above: HeightsAbove::Snow,
            soil: [5.0; 4],
        }
    }
}

impl Site {
    /// Seconds since 1970-01-01T00:00:00Z at a simulated time \[s\], where the site has a start.
    pub fn instant(&self, time: f64) -> Option<f64> {
        self.start.as_ref().map(|start| start.instant() + time)
    }

    /// Where the sun stands at a simulated time \[s\], where the site says enough.
    pub fn sun(&self, time: f64) -> Option<SunPosition> {
        Some(sun::sun_position(self.latitude?, self.longitude?, self.instant(time)?))
    }

    /// What the place of the sun would need and the site does not tell.
    pub(super) fn lacks(&self) -> Vec<&'static str> {
        let needs = [
            ("latitude", self.latitude.is_none()),
            ("longitude", self.longitude.is_none()),
            ("start", self.start.is_none()),
        ];
        needs.into_iter().filter(|need| need.1).map(|need| need.0).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sensors_on_a_mast_come_nearer_to_the_snow() {
        assert_eq!(HeightsAbove::Snow.over(2.0, 1.8), 2.0);
        assert_eq!(HeightsAbove::Ground.over(2.0, 1.2), 0.8);
        assert_eq!(HeightsAbove::Ground.over(2.0, 1.8), 0.5);
    }

    #[test]
    fn the_sun_needs_a_place_and_a_time() {
        let mut site = Site { latitude: Some(45.3), longitude: Some(5.77), ..Site::default() };
        assert_eq!((site.sun(0.0), site.lacks()), (None, vec!["start"]));
        site.start = Start::parse("2006-06-21T00:00:00Z");
        let (night, day) = (site.sun(0.0).unwrap(), site.sun(43_200.0).unwrap());
        assert!(night.elevation < -10.0 && day.elevation > 60.0, "{night:?} {day:?}");
        assert!(site.lacks().is_empty());
    }
}
