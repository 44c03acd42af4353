//! Whole frames of a running world: what they took, and what that was made of.

use std::fmt;
use std::time::Duration;

use serde::Serialize;

use crate::session::{FrameParts, FrameTime};

use super::BenchError;
use super::case::Case;
use super::report::{Clock, Measured, time};
use super::spread::Spread;

/// Medians of the parts of frames \[s\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Parts {
    /// Asking sessions what they do.
    pub planning: f64,
    /// Telling the backend.
    pub submitting: f64,
    /// Waiting for the backend, and reading what it found.
    pub waiting: f64,
    /// Publishing and answering.
    pub concluding: f64,
}

/// A case of frames with sessions of one size in them.
pub(super) fn measured(
    case: Case,
    sessions: u32,
    grid: [u32; 3],
    frames: &[FrameTime],
) -> Result<Measured, BenchError> {
    let nothing = || BenchError::Stuck { case: case.name(), what: "nothing was timed".into() };
    let took = Spread::of(frames.iter().map(|frame| frame.took).collect()).ok_or_else(nothing)?;
    let parts = medians(frames.iter().map(|frame| frame.parts).collect());
    let measured = Measured::new(case, sessions, grid, Clock::Wall, took);
    Ok(Measured { parts: Some(parts), ..measured })
}

/// Medians of the parts of frames, or of their sums.
pub(super) fn medians(all: Vec<FrameParts>) -> Parts {
    let part = |of: fn(&FrameParts) -> Duration| {
        let times = all.iter().map(of).collect();
        Spread::of(times).map_or(0.0, |spread| spread.median)
    };
    Parts {
        planning: part(|parts| parts.planning),
        submitting: part(|parts| parts.submitting),
        waiting: part(|parts| parts.waiting),
        concluding: part(|parts| parts.concluding),
    }
}

impl fmt::Display for Parts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "planning {}, submitting {}, waiting {}, concluding {}",
            time(self.planning),
            time(self.submitting),
            time(self.waiting),
            time(self.concluding)
        )
    }
}
