//! The experiments of the thesis that Firn's model comes from, repeated with Firn.
//!
//! They run through the same sessions as everybody's, on whatever backend the world has. What is
//! set up, how it is carried out, what the outcome is compared with, and how it is shown are kept
//! apart: `setup`, `recording`, `outcome` and `reference`, then `table`, `csv` and
//! `figures`. `docs/experiments.md` discusses the results.

mod csv;
mod figures;
mod outcome;
mod recording;
mod reference;
mod setup;
mod study;
mod table;

use std::path::{Path, PathBuf};

use crate::diagram::{ChartError, draw};
use crate::session::{SessionError, Sessions};

pub use reference::{Expected, Row};
pub use setup::{Experiment, SIDE};
pub use study::{History, Profile, Study};

/// Why an experiment could not be carried out or shown.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// The sessions refused something or are gone.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// A figure can't be drawn.
    #[error(transparent)]
    Figure(#[from] ChartError),
    /// A file can't be written.
    #[error("{}: {why}", path.display())]
    File {
        /// The file or directory.
        path: PathBuf,
        /// The system's answer.
        why: std::io::Error,
    },
}

/// Carries out an experiment on a grid of `side` × `side` columns; [`SIDE`] is what the thesis
/// has. The prototype always has one column, and the objects need at least 50 × 50.
///
/// `progress` is told how many ticks were taken, [`Experiment::ticks`] in all.
///
/// # Errors
/// [`ExperimentError::Session`] where the sessions can't hold the snowpack.
pub async fn run(
    sessions: &Sessions,
    experiment: Experiment,
    side: u32,
    progress: &dyn Fn(u64),
) -> Result<Vec<Study>, ExperimentError> {
    let mut recordings = Vec::new();
    for setup in experiment.setups(side) {
        recordings.push(recording::carry_out(sessions, &setup, progress).await?);
    }
    Ok(outcome::studies(experiment, &recordings))
}

/// Makes a directory for figures and tables, where it is not there.
///
/// # Errors
/// [`ExperimentError::File`].
pub fn make_directory(directory: &Path) -> Result<(), ExperimentError> {
    std::fs::create_dir_all(directory)
        .map_err(|why| ExperimentError::File { path: directory.to_owned(), why })
}

/// Writes a study's figures and tables of numbers into a directory, which is created where it is
/// not there; returns the files.
///
/// # Errors
/// [`ExperimentError::Figure`] and [`ExperimentError::File`].
pub fn write(study: &Study, directory: &Path) -> Result<Vec<PathBuf>, ExperimentError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |why| ExperimentError::File { path, why }
    };
    make_directory(directory)?;
    let mut files = vec![
        (format!("{}-layers.csv", study.name), csv::layers(study)),
        (format!("{}-heights.csv", study.name), csv::heights(study)),
    ];
    for (kind, chart) in figures::all(study) {
        files.push((format!("{}-{kind}.svg", study.name), draw(&[chart])?));
    }
    let mut written = Vec::new();
    for (name, content) in files {
        let path = directory.join(name);
        std::fs::write(&path, content).map_err(failed(&path))?;
        written.push(path);
    }
    Ok(written)
}
