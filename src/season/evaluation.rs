//! What was measured in a season, day by day.

use std::collections::BTreeMap;
use std::path::Path;

use time::Date;

use super::table::Table;
use super::{SeasonError, read_text};

/// What was measured on a day. Nothing of it has to be there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Depth of snow \[m\].
    pub depth: Option<f64>,
    /// Snow water equivalent \[kg/m²\].
    pub water: Option<f64>,
    /// Mean temperature of the surface \[°C\].
    pub skin: Option<f64>,
    /// Albedo.
    pub albedo: Option<f64>,
    /// Water that has run off \[kg/m²\].
    pub runoff: Option<f64>,
}

/// The columns of a file, of which one at least has to be there.
const COLUMNS: [&str; 5] = ["depth_m", "swe_kgm2", "tsurf_c", "albedo", "runoff_kgm2d"];

/// What was measured in a season.
#[derive(Clone, Debug, Default)]
pub struct Evaluation {
    /// Days, and what was measured on them.
    pub days: BTreeMap<Date, Measured>,
}

impl Evaluation {
    /// Reads comma-separated values.
    ///
    /// # Errors
    /// What can't be read, with its line and column.
    pub fn read(path: &Path) -> Result<Evaluation, SeasonError> {
        let table = Table::csv(path, &read_text(path)?)?;
        let [date] = table.require(["date"])?;
        let columns = COLUMNS.map(|name| table.find(name));
        if columns.iter().all(Option::is_none) {
            let message = format!("expected a column of {}, found none", COLUMNS.join(", "));
            return Err(SeasonError::line(path, table.names_line, message));
        }
        let mut days = BTreeMap::new();
        for row in &table.rows {
            let mut values = [None; COLUMNS.len()];
            for (value, column) in values.iter_mut().zip(columns) {
                if let Some(column) = column {
                    *value = table.number(row, column)?;
                }
            }
            let [depth, water, skin, albedo, runoff] = values;
            let day = Measured { depth, water, skin, albedo, runoff };
            if days.insert(table.date(row, date)?, day).is_some() {
                let message = format!("expected every day once, found {} again", row.fields[date]);
                return Err(table.wrong(row, date, message));
            }
        }
        Ok(Evaluation { days })
    }

    /// What was measured on a day.
    pub fn on(&self, date: Date) -> Measured {
        self.days.get(&date).copied().unwrap_or_default()
    }

    /// Whether something was measured on any day.
    pub fn has(&self, value: impl Fn(&Measured) -> Option<f64>) -> bool {
        self.days.values().any(|day| value(day).is_some())
    }
}
