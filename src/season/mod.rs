//! A season of weather on alpine snow, and how near it comes to what was measured.
//!
//! Weather is read from a file ([`Forcing`]) and lies on reference columns ([`run()`]) of a grid, all of which feel
//! the same. The results of each day ([`Season`]) are compared with measurements ([`Evaluation`], [`Scores`]),
//! written and drawn ([`write()`]). `docs/alpine.md` discusses the results.

mod daily;
mod evaluation;
mod figures;
mod forcing;
mod ledger;
mod report;
mod run;
mod scores;
mod smet;
mod sums;
mod table;

use std::path::{Path, PathBuf};

use crate::diagram::{ChartError, draw};

pub use daily::Day;
pub use evaluation::{Evaluation, Measured};
pub use forcing::{Forcing, Stamps};
pub use ledger::Ledger;
pub use report::Report;
pub use run::{Plan, Season, run};
pub use scores::{MeltOut, Score, Scores};

/// Why a season can't be read, or not be written.
#[derive(Debug, thiserror::Error)]
pub enum SeasonError {
    /// A file can't be read or written.
    #[error("{}: {why}", path.display())]
    File {
        /// The file or directory.
        path: PathBuf,
        /// The system's answer.
        why: std::io::Error,
    },
    /// A line of a file is not as expected.
    #[error("{}, line {line}: {message}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// What was expected and what was found.
        message: String,
    },
    /// A field of a file is not as expected.
    #[error("{}, line {line}, column {column}: {message}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// The name of the column.
        column: String,
        /// What was expected and what was found.
        message: String,
    },
    /// A figure can't be drawn.
    #[error(transparent)]
    Figure(#[from] ChartError),
}

impl SeasonError {
    fn line(path: &Path, line: u64, message: impl Into<String>) -> SeasonError {
        SeasonError::Line { path: path.to_owned(), line, message: message.into() }
    }

    fn file(path: &Path) -> impl FnOnce(std::io::Error) -> SeasonError {
        let path = path.to_owned();
        move |why| SeasonError::File { path, why }
    }
}

/// Makes a directory for figures and numbers, where it is not there.
///
/// # Errors
/// [`SeasonError::File`].
pub fn make_directory(directory: &Path) -> Result<(), SeasonError> {
    std::fs::create_dir_all(directory).map_err(SeasonError::file(directory))
}

/// Writes the daily values and the figures into a directory.
///
/// # Errors
/// [`SeasonError::Figure`] and [`SeasonError::File`].
pub fn write(
    season: &Season,
    evaluation: Option<&Evaluation>,
    directory: &Path,
) -> Result<(), SeasonError> {
    let mut files = vec![("daily.csv".to_owned(), daily::csv(&season.days))];
    for (name, chart) in figures::all(season, evaluation) {
        files.push((format!("{name}.svg"), draw(&[chart])?));
    }
    for (name, content) in files {
        let path = directory.join(name);
        std::fs::write(&path, content).map_err(SeasonError::file(&path))?;
    }
    Ok(())
}

/// The whole text of a file.
fn read_text(path: &Path) -> Result<String, SeasonError> {
    let text = std::fs::read_to_string(path).map_err(SeasonError::file(path))?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}
