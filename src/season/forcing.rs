//! The weather of a season, read from a file: one row after another, all as far apart.

use std::path::Path;

use firn_snow::weather::{Felt, KELVIN, Site, Weather, split_precipitation};
use time::{Duration, PrimitiveDateTime};

use super::smet::{self, Smet};
use super::table::{Row, Table};
use super::{SeasonError, read_text};

/// Fields of weather, and the columns that they are read from.
type Columns = [(&'static str, &'static str); 9];

/// Columns of comma-separated values.
const CSV: Columns = [
    ("time", "time"),
    ("shortwave", "sw_in"),
    ("longwave", "lw_in"),
    ("air_temperature", "ta_c"),
    ("relative_humidity", "rh"),
    ("wind_speed", "wind"),
    ("pressure", "ps_pa"),
    ("snowfall", "snow_kgm2s"),
    ("rainfall", "rain_kgm2s"),
];

/// Columns of SMET; `P` and `PSUM_PH` need not be there.
const SMET: Columns = [
    ("time", "timestamp"),
    ("shortwave", "ISWR"),
    ("longwave", "ILWR"),
    ("air_temperature", "TA"),
    ("relative_humidity", "RH"),
    ("wind_speed", "VW"),
    ("pressure", "P"),
    ("snowfall", "PSUM"),
    ("rainfall", "PSUM"),
];

/// How far above 100 % a humidity may be.
const MOST_WET: f64 = 5.0;

/// How far below 0 W/m² short wave may be.
const MOST_DARK: f64 = 10.0;

/// What a row's time is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stamps {
    /// When its weather begins: it holds until the time of the next row.
    #[default]
    Start,
    /// When its weather has ended: it has held since the time of the row before.
    End,
}

/// The weather of a season. Its rows are all as long as each other and follow without gaps.
#[derive(Clone, Debug)]
pub struct Forcing {
    /// When it begins, by the file's own clock.
    pub start: PrimitiveDateTime,
    /// How long a row holds \[s\].
    pub step: f64,
    /// One row after another.
    pub rows: Vec<Felt>,
}

impl Forcing {
    /// Reads comma-separated values, or SMET where the first line says so.
    ///
    /// # Errors
    /// What can't be read, is missing or is out of its range, with its line and column.
    pub fn read(path: &Path, stamps: Stamps) -> Result<Forcing, SeasonError> {
        let text = read_text(path)?;
        if smet::is(&text) {
            let Smet { table, altitude } = smet::read(path, &text)?;
            let columns = table.require(["timestamp", "TA", "RH", "VW", "ISWR", "ILWR", "PSUM"])?;
            let [time, others @ ..] = columns;
            return Forcing::from_table(&table, time, &SMET, stamps, |row, step| {
                smet_weather(&table, altitude, others, row, step)
            });
        }
        let table = Table::csv(path, &text)?;
        let [time, others @ ..] = table.require(CSV.map(|(_, column)| column))?;
        Forcing::from_table(&table, time, &CSV, stamps, |row, _| csv_weather(&table, others, row))
    }

    /// Makes it of a table, of whose rows a function makes weather, told their length in seconds.
    fn from_table(
        table: &Table,
        time: usize,
        columns: &Columns,
        stamps: Stamps,
        weather: impl Fn(&Row, f64) -> Result<Weather, SeasonError>,
    ) -> Result<Forcing, SeasonError> {
        let [first, second, ..] = table.rows.as_slice() else {
            let found = table.rows.len();
            let message = format!("expected at least 2 rows of weather below, found {found}");
            return Err(SeasonError::line(&table.path, table.names_line, message));
        };
        let start = table.time(first, time)?;
        let step = table.time(second, time)? - start;
        if step <= Duration::ZERO || step > Duration::DAY {
            let message = format!(
                "expected a time up to a day after {}, found {}",
                first.fields[time], second.fields[time]
            );
            return Err(table.wrong(second, time, message));
        }
        let (site, seconds) = (Site::default(), step.as_seconds_f64());
        let mut rows = Vec::with_capacity(table.rows.len());
        let mut at = start;
        for row in &table.rows {
            follows(table, row, time, at, seconds)?;
            at += step;
            let weather = settled(weather(row, seconds)?);
            weather.check(&site).map_err(|problem| {
                let column = columns.iter().find(|(field, _)| *field == problem.field);
                let column = column.and_then(|(_, column)| table.find(column));
                table.wrong(row, column.unwrap_or(time), problem.message)
            })?;
            rows.push(weather.felt(&site, 0.0));
        }
        let start = match stamps {
            Stamps::Start => start,
            Stamps::End => start - step,
        };
        Ok(Forcing { start, step: seconds, rows })
    }

    /// How long it is \[s\].
    pub fn seconds(&self) -> f64 {
        self.step * self.rows.len() as f64
    }

    /// The mean of the weather from a time to another \[s\], both counted from the beginning.
    pub fn mean(&self, from: f64, until: f64) -> Felt {
        let last_row = self.rows.len() - 1;
        let first = ((from / self.step) as usize).min(last_row);
        let last = ((until / self.step).ceil() as usize).saturating_sub(1).clamp(first, last_row);
        let mut mean = self.rows[first];
        let mut seconds = (first + 1) as f64 * self.step - from;
        for index in first + 1..=last {
            let row = &self.rows[index];
            let overlap = until.min((index + 1) as f64 * self.step) - index as f64 * self.step;
            seconds += overlap;
            let part = overlap / seconds;
            for (mean, row) in [
                (&mut mean.air_temperature, row.air_temperature),
                (&mut mean.relative_humidity, row.relative_humidity),
                (&mut mean.wind_speed, row.wind_speed),
                (&mut mean.pressure, row.pressure),
                (&mut mean.snowfall, row.snowfall),
                (&mut mean.rainfall, row.rainfall),
                (&mut mean.shortwave, row.shortwave),
                (&mut mean.longwave, row.longwave),
            ] {
                *mean += (row - *mean) * part;
            }
        }
        mean
    }
}

/// Weather with what sensors overshoot taken off: they read a little more than saturated, and a little less than
/// dark.
fn settled(weather: Weather) -> Weather {
    let saturated = (100.0..=100.0 + MOST_WET).contains(&weather.relative_humidity);
    let dark = |shortwave: &f64| (-MOST_DARK..=0.0).contains(shortwave);
    Weather {
        relative_humidity: if saturated { 100.0 } else { weather.relative_humidity },
        shortwave: weather.shortwave.map(|given| if dark(&given) { 0.0 } else { given }),
        ..weather
    }
}

/// Sees to it that a row is of the time that follows from those before.
fn follows(
    table: &Table,
    row: &Row,
    time: usize,
    expected: PrimitiveDateTime,
    step: f64,
) -> Result<(), SeasonError> {
    let found = table.time(row, time)?;
    if found == expected {
        return Ok(());
    }
    let (date, hour, minute, second) =
        (expected.date(), expected.hour(), expected.minute(), expected.second());
    let message = format!(
        "expected {date}T{hour:02}:{minute:02}:{second:02}, {step} s after the row before, found {}",
        row.fields[time]
    );
    Err(table.wrong(row, time, message))
}

fn csv_weather(table: &Table, columns: [usize; 8], row: &Row) -> Result<Weather, SeasonError> {
    let value = |index: usize| table.value(row, columns[index]);
    Ok(Weather {
        shortwave: Some(value(0)?),
        longwave: Some(value(1)?),
        air_temperature: value(2)?,
        relative_humidity: value(3)?,
        wind_speed: value(4)?,
        pressure: Some(value(5)? / 100.0),
        snowfall: Some(value(6)? * 3600.0),
        rainfall: Some(value(7)? * 3600.0),
        ..Weather::default()
    })
}

fn smet_weather(
    table: &Table,
    altitude: Option<f64>,
    columns: [usize; 6],
    row: &Row,
    step: f64,
) -> Result<Weather, SeasonError> {
    let value = |index: usize| table.value(row, columns[index]);
    let air_temperature = value(0)? - KELVIN;
    let precipitation = value(5)? * 3600.0 / step;
    let (snowfall, rainfall) = match table.find("PSUM_PH").filter(|_| precipitation > 0.0) {
        None => split_precipitation(precipitation, air_temperature),
        Some(phase) => {
            let liquid = table.value(row, phase)?;
            if !(0.0..=1.0).contains(&liquid) {
                let message = format!("expected 0 (snow) to 1 (rain), found {liquid}");
                return Err(table.wrong(row, phase, message));
            }
            (precipitation * (1.0 - liquid), precipitation * liquid)
        }
    };
    let pascals = match (table.find("P"), altitude) {
        (Some(pressure), _) => table.value(row, pressure)?,
        (None, Some(altitude)) => standard_pressure(altitude),
        (None, None) => {
            let message = "no column 'P', nor 'altitude = …' in the header to tell the pressure by";
            return Err(SeasonError::line(&table.path, table.names_line, message));
        }
    };
    Ok(Weather {
        air_temperature,
        relative_humidity: value(1)? * 100.0,
        wind_speed: value(2)?,
        shortwave: Some(value(3)?),
        longwave: Some(value(4)?),
        pressure: Some(pascals / 100.0),
        snowfall: Some(snowfall),
        rainfall: Some(rainfall),
        ..Weather::default()
    })
}

/// Pressure of the standard atmosphere \[Pa\] at an altitude \[m\] (ICAO Doc 7488).
fn standard_pressure(altitude: f64) -> f64 {
    101_325.0 * (1.0 - 0.0065 * altitude / 288.15).max(0.0).powf(5.255_88)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weather_is_the_mean_of_its_rows() {
        let row = |celsius: f64| {
            let weather = Weather { air_temperature: celsius, ..Weather::default() };
            weather.felt(&Site::default(), 0.0)
        };
        let rows = [-4.0, 0.0, 2.0, 5.0].map(row).to_vec();
        let forcing = Forcing { start: PrimitiveDateTime::MIN, step: 600.0, rows };
        let mean = |from, until| forcing.mean(from, until).air_temperature;
        assert_eq!((mean(0.0, 600.0), mean(60.0, 120.0), mean(1800.0, 2400.0)), (-4.0, -4.0, 5.0));
        assert_eq!((mean(0.0, 1200.0), mean(450.0, 1050.0)), (-2.0, -1.0));
        assert!((mean(0.0, 2400.0) - 0.75).abs() < 1e-12);
    }
}
