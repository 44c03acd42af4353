//! Tables of text: named columns, and fields that an error names by line and column.

use std::path::{Path, PathBuf};

use time::format_description::well_known::Iso8601;
use time::{Date, PrimitiveDateTime};

use super::SeasonError;
use crate::quote::quote;

/// A table. Every row has as many fields as there are columns.
#[derive(Clone, Debug)]
pub(super) struct Table {
    /// The file.
    pub path: PathBuf,
    /// The line that names the columns.
    pub names_line: u64,
    /// Names of the columns.
    pub names: Vec<String>,
    /// What is in them.
    pub rows: Vec<Row>,
    /// How a column's numbers are made SI units: by a factor, then a term. Empty where they are.
    pub scales: Vec<[f64; 2]>,
    /// A number that stands for a missing one.
    pub missing: Option<f64>,
}

/// A row.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// Its line in the file.
    pub line: u64,
    /// Its fields.
    pub fields: Vec<String>,
}

impl Table {
    /// Reads comma-separated values, the first line of which names the columns.
    pub fn csv(path: &Path, text: &str) -> Result<Table, SeasonError> {
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .from_reader(text.as_bytes());
        let mut table = Table {
            path: path.to_owned(),
            names_line: 1,
            names: Vec::new(),
            rows: Vec::new(),
            scales: Vec::new(),
            missing: None,
        };
        for record in reader.records() {
            let record = record.map_err(|error| table.broken(&error))?;
            let line = record.position().map_or(0, csv::Position::line);
            let fields = record.iter().map(str::to_owned).collect();
            if table.names.is_empty() {
                (table.names_line, table.names) = (line, fields);
            } else {
                table.push(line, fields)?;
            }
        }
        Ok(table)
    }

    /// Adds a row.
    pub fn push(&mut self, line: u64, fields: Vec<String>) -> Result<(), SeasonError> {
        let (expected, found) = (self.names.len(), fields.len());
        if found != expected {
            let names = self.names_line;
            let message = format!("expected {expected} fields, as in line {names}, found {found}");
            return Err(SeasonError::line(&self.path, line, message));
        }
        self.rows.push(Row { line, fields });
        Ok(())
    }

    fn broken(&self, error: &csv::Error) -> SeasonError {
        let line = error.position().map_or(0, csv::Position::line);
        SeasonError::line(&self.path, line, error.to_string())
    }

    /// A column, by its name in any case.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| known.eq_ignore_ascii_case(name))
    }

    /// Columns that have to be there.
    pub fn require<const N: usize>(&self, names: [&str; N]) -> Result<[usize; N], SeasonError> {
        let mut columns = [0; N];
        for (column, name) in columns.iter_mut().zip(names) {
            *column = self.find(name).ok_or_else(|| {
                let message = format!("no column '{name}'; expected {}", names.join(", "));
                SeasonError::line(&self.path, self.names_line, message)
            })?;
        }
        Ok(columns)
    }

    /// A number, where it is not missing.
    pub fn number(&self, row: &Row, column: usize) -> Result<Option<f64>, SeasonError> {
        let field = row.fields[column].as_str();
        if field.is_empty() {
            return Ok(None);
        }
        let number = field.parse().ok().filter(|number: &f64| number.is_finite());
        let number = number.ok_or_else(|| {
            self.wrong(row, column, format!("expected a number, found {}", quote(field)))
        })?;
        if self.missing == Some(number) {
            return Ok(None);
        }
        let [factor, term] = self.scales.get(column).copied().unwrap_or([1.0, 0.0]);
        Ok(Some(number * factor + term))
    }

    /// A number that has to be there.
    pub fn value(&self, row: &Row, column: usize) -> Result<f64, SeasonError> {
        self.number(row, column)?.ok_or_else(|| {
            let message = match row.fields[column].as_str() {
                "" => "expected a number, found nothing".to_owned(),
                found => format!("expected a number, found {found}, which means a missing one"),
            };
            self.wrong(row, column, message)
        })
    }

    /// A point in time.
    pub fn time(&self, row: &Row, column: usize) -> Result<PrimitiveDateTime, SeasonError> {
        let field = row.fields[column].as_str();
        let text = field.replacen(' ', "T", 1);
        PrimitiveDateTime::parse(&text, &Iso8601::PARSING).map_err(|_| {
            let found = quote(field);
            let message = format!("expected a time such as 2005-10-01T00:00, found {found}");
            self.wrong(row, column, message)
        })
    }

    /// A day.
    pub fn date(&self, row: &Row, column: usize) -> Result<Date, SeasonError> {
        let field = row.fields[column].as_str();
        Date::parse(field, &Iso8601::PARSING).map_err(|_| {
            let found = quote(field);
            self.wrong(row, column, format!("expected a day such as 2005-10-01, found {found}"))
        })
    }

    /// What is wrong with a field.
    pub fn wrong(&self, row: &Row, column: usize, message: String) -> SeasonError {
        SeasonError::Field {
            path: self.path.clone(),
            line: row.line,
            column: self.names[column].clone(),
            message,
        }
    }
}
