//! Refuses weather that can't be.

use super::Weather;
use super::series::{MOST_ROWS, WeatherInput, WeatherRow, WeatherSeries};
use super::site::Site;

/// What is wrong with a weather or a site.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// The field that is wrong, as `wind_speed` or `series[3].wind_speed`.
    pub field: String,
    /// What was expected and what was found.
    pub message: String,
}

impl Problem {
    fn new(field: impl Into<String>, message: impl Into<String>) -> Problem {
        Problem { field: field.into(), message: message.into() }
    }

    /// The JSON pointer (RFC 6901) to the field: `/series/3/wind_speed`.
    pub fn pointer(&self) -> String {
        let path = self.field.replace('[', "/").replace(']', "").replace('.', "/");
        format!("/{path}")
    }
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "`{}`: {}", self.field, self.message)
    }
}

impl std::error::Error for Problem {}

/// A value, and between what it has to be: with its unit, which may be empty.
type Ranged = (&'static str, Option<f64>, f64, f64, &'static str);

/// Checks that values which are there are within their ranges; NaN is in none.
fn within(values: &[Ranged]) -> Result<(), Problem> {
    for &(field, value, low, high, unit) in values {
        if let Some(value) = value.filter(|value| !(low..=high).contains(value)) {
            let space = if unit.is_empty() { "" } else { " " };
            let message = format!("expected {low} to {high}{space}{unit}, found {value}");
            return Err(Problem::new(field, message));
        }
    }
    Ok(())
}

impl Weather {
    /// Checks that it can be, and that radiation is given or can be worked out at the site.
    ///
    /// # Errors
    /// The first field that is wrong.
    pub fn check(&self, site: &Site) -> Result<(), Problem> {
        within(&[
            ("air_temperature", Some(self.air_temperature), -60.0, 50.0, "°C"),
            ("relative_humidity", Some(self.relative_humidity), 0.0, 100.0, "%"),
            ("wind_speed", Some(self.wind_speed), 0.0, 100.0, "m/s"),
            ("wind_direction", self.wind_direction, 0.0, 360.0, "degrees"),
            ("pressure", self.pressure, 300.0, 1100.0, "hPa"),
            ("snowfall", self.snowfall, 0.0, 1000.0, "mm/h"),
            ("rainfall", self.rainfall, 0.0, 1000.0, "mm/h"),
            ("precipitation", self.precipitation, 0.0, 1000.0, "mm/h"),
            ("shortwave", self.shortwave, 0.0, 2000.0, "W/m²"),
            ("longwave", self.longwave, 0.0, 1000.0, "W/m²"),
            ("cloud_cover", self.cloud_cover, 0.0, 1.0, ""),
            ("sun.azimuth", self.sun.map(|sun| sun.azimuth), 0.0, 360.0, "degrees"),
            ("sun.elevation", self.sun.map(|sun| sun.elevation), -90.0, 90.0, "degrees"),
        ])?;
        self.check_precipitation()?;
        self.check_shortwave(site)
    }

    fn check_precipitation(&self) -> Result<(), Problem> {
        let part = match (self.snowfall, self.rainfall) {
            (Some(_), _) => "snowfall",
            (_, Some(_)) => "rainfall",
            _ => return Ok(()),
        };
        if self.precipitation.is_none() {
            return Ok(());
        }
        let message = format!(
            "expected either all of it or its parts, found `{part}` beside it; leave out \
             `precipitation`, or `snowfall` and `rainfall`"
        );
        Err(Problem::new("precipitation", message))
    }

    fn check_shortwave(&self, site: &Site) -> Result<(), Problem> {
        let lacks = site.lacks();
        if self.shortwave.is_some() || self.sun.is_some() || lacks.is_empty() {
            return Ok(());
        }
        let message = format!(
            "is missing and can't be worked out: give it, or `sun`, or what the session's `site` lacks, which is `{}`",
            lacks.join("`, `")
        );
        Err(Problem::new("shortwave", message))
    }
}

impl WeatherSeries {
    /// Checks its rows, their number and their order.
    ///
    /// # Errors
    /// The first field that is wrong.
    pub fn check(&self, site: &Site) -> Result<(), Problem> {
        let rows = self.series.len();
        if rows == 0 {
            return Err(Problem::new("series", format!("expected 1 to {MOST_ROWS} rows, found 0")));
        }
        if rows > MOST_ROWS {
            let message = format!(
                "expected 1 to {MOST_ROWS} rows, found {rows}; send it in parts, the next one before the last row is \
                 reached"
            );
            return Err(Problem::new("series", message));
        }
        let mut before = None;
        for (index, row) in self.series.iter().enumerate() {
            row.check(before, site).map_err(|problem| Problem {
                field: format!("series[{index}].{}", problem.field),
                ..problem
            })?;
            before = Some(row.at);
        }
        Ok(())
    }
}

impl WeatherRow {
    fn check(&self, before: Option<f64>, site: &Site) -> Result<(), Problem> {
        let at = self.at;
        if !at.is_finite() || at < 0.0 {
            let message = format!("expected simulated seconds, 0 or more, found {at}");
            return Err(Problem::new("at", message));
        }
        if let Some(before) = before.filter(|&before| at <= before) {
            let message = format!(
                "expected more than the {before} s of the row before, found {at}; give the rows in order, each with a \
                 time of its own"
            );
            return Err(Problem::new("at", message));
        }
        self.weather.check(site)
    }
}

impl WeatherInput {
    /// Checks that it can be, and that radiation is given or can be worked out at the site.
    ///
    /// # Errors
    /// The first field that is wrong.
    pub fn check(&self, site: &Site) -> Result<(), Problem> {
        match self {
            WeatherInput::Steady(weather) => weather.check(site),
            WeatherInput::Series(series) => series.check(site),
        }
    }
}

impl Site {
    /// Checks that it can be.
    ///
    /// # Errors
    /// The first field that is wrong.
    pub fn check(&self) -> Result<(), Problem> {
        within(&[
            ("latitude", self.latitude, -90.0, 90.0, "degrees"),
            ("longitude", self.longitude, -180.0, 180.0, "degrees"),
            ("pressure", Some(self.pressure), 300.0, 1100.0, "hPa"),
            ("temperature_height", Some(self.temperature_height), 0.5, 100.0, "m"),
            ("wind_height", Some(self.wind_height), 0.5, 100.0, "m"),
            ("soil[0]", Some(self.soil[0]), -50.0, 50.0, "°C"),
            ("soil[1]", Some(self.soil[1]), -50.0, 50.0, "°C"),
            ("soil[2]", Some(self.soil[2]), -50.0, 50.0, "°C"),
            ("soil[3]", Some(self.soil[3]), -50.0, 50.0, "°C"),
        ])?;
        // Half a place is a mistake that would be found out only where radiation is missing.
        let missing = match (self.latitude, self.longitude) {
            (Some(_), None) => ("longitude", "latitude"),
            (None, Some(_)) => ("latitude", "longitude"),
            _ => return Ok(()),
        };
        let message = format!("is missing beside `{}`; give both or neither", missing.1);
        Err(Problem::new(missing.0, message))
    }
}
