//! SMET, the text format of MeteoIO (Bavay 2021, SMET specifications, version 1.2): a header of keys, then numbers.

use std::collections::BTreeMap;
use std::path::Path;

use super::SeasonError;
use super::table::Table;
use crate::quote::quote;

/// How a file begins.
const SIGNATURE: &str = "SMET";

/// A file's numbers, and how high it was measured \[m\].
pub(super) struct Smet {
    pub table: Table,
    pub altitude: Option<f64>,
}

/// Whether a text is SMET, as its first line tells.
pub(super) fn is(text: &str) -> bool {
    first_line(text).first() == Some(&SIGNATURE)
}

fn first_line(text: &str) -> Vec<&str> {
    text.lines().next().unwrap_or_default().split_whitespace().collect()
}

/// Reads it.
pub(super) fn read(path: &Path, text: &str) -> Result<Smet, SeasonError> {
    if first_line(text).get(2).is_none_or(|kind| !kind.eq_ignore_ascii_case("ASCII")) {
        let found = quote(text.lines().next().unwrap_or_default());
        let message = format!("expected 'SMET', a version and 'ASCII', found {found}");
        return Err(SeasonError::line(path, 1, message));
    }
    let mut lines = (1..).zip(text.lines()).skip(1).filter_map(|(line, text)| {
        let content = text.split(['#', ';']).next().unwrap_or_default().trim();
        (!content.is_empty()).then_some((line, content))
    });
    let header = Header::read(path, &mut lines)?;
    let mut table = header.table(path)?;
    for (line, content) in lines {
        table.push(line, content.split_whitespace().map(str::to_owned).collect())?;
    }
    let altitude = header.number(path, "altitude")?.filter(|&metres| table.missing != Some(metres));
    Ok(Smet { table, altitude })
}

/// The keys of a header, each with its line and its value.
struct Header<'a> {
    keys: BTreeMap<String, (u64, &'a str)>,
    /// The line at which the numbers begin.
    end: u64,
}

impl<'a> Header<'a> {
    /// Reads it, up to the line from which on there are numbers.
    fn read(
        path: &Path,
        lines: &mut impl Iterator<Item = (u64, &'a str)>,
    ) -> Result<Header<'a>, SeasonError> {
        let mut keys = BTreeMap::new();
        let mut last = 1;
        for (line, content) in lines {
            last = line;
            if content.eq_ignore_ascii_case("[DATA]") {
                return Ok(Header { keys, end: line });
            }
            if content.eq_ignore_ascii_case("[HEADER]") {
                continue;
            }
            let Some((key, value)) = content.split_once('=') else {
                let message =
                    format!("expected 'key = value' or '[DATA]', found {}", quote(content));
                return Err(SeasonError::line(path, line, message));
            };
            keys.insert(key.trim().to_ascii_lowercase(), (line, value.trim()));
        }
        Err(SeasonError::line(path, last, "expected a section '[DATA]', found the end of the file"))
    }

    /// The table that it begins, without rows.
    fn table(&self, path: &Path) -> Result<Table, SeasonError> {
        let lacks = |key: &str| {
            let message = format!("the header above lacks '{key} = …'");
            SeasonError::line(path, self.end, message)
        };
        let &(names_line, fields) = self.keys.get("fields").ok_or_else(|| lacks("fields"))?;
        let names: Vec<String> = fields.split_whitespace().map(str::to_owned).collect();
        let missing = self.number(path, "nodata")?.ok_or_else(|| lacks("nodata"))?;
        let factors = self.numbers(path, "units_multiplier", names.len(), 1.0)?;
        let terms = self.numbers(path, "units_offset", names.len(), 0.0)?;
        Ok(Table {
            path: path.to_owned(),
            names_line,
            names,
            rows: Vec::new(),
            scales: factors.into_iter().zip(terms).map(|(factor, term)| [factor, term]).collect(),
            missing: Some(missing),
        })
    }

    /// A key's number, where there is that key.
    fn number(&self, path: &Path, key: &str) -> Result<Option<f64>, SeasonError> {
        let Some(&(line, value)) = self.keys.get(key) else { return Ok(None) };
        number(path, line, key, value).map(Some)
    }

    /// A key's numbers, one for each column; where there is no such key, all are alike.
    fn numbers(
        &self,
        path: &Path,
        key: &str,
        columns: usize,
        usual: f64,
    ) -> Result<Vec<f64>, SeasonError> {
        let Some(&(line, value)) = self.keys.get(key) else { return Ok(vec![usual; columns]) };
        let numbers = value.split_whitespace().map(|value| number(path, line, key, value));
        let numbers: Vec<f64> = numbers.collect::<Result<_, _>>()?;
        if numbers.len() != columns {
            let found = numbers.len();
            let message =
                format!("{key}: expected {columns} numbers, one for each field, found {found}");
            return Err(SeasonError::line(path, line, message));
        }
        Ok(numbers)
    }
}

fn number(path: &Path, line: u64, key: &str, value: &str) -> Result<f64, SeasonError> {
    value.parse().ok().filter(|number: &f64| number.is_finite()).ok_or_else(|| {
        let message = format!("{key}: expected a number, found {}", quote(value));
        SeasonError::line(path, line, message)
    })
}
