//! A large world on which snow falls all the time, at rest but for that.

use std::time::Duration;

use firn_protocol::SessionSpec;

use crate::session::{FRAME_RATE, FrameTime};

use super::case::Case;
use super::host::{Host, spec};
use super::report::{Measured, Report};
use super::spread::Spread;
use super::{BenchError, Plan, frames};

/// Snow at the beginning \[m\]: too little to settle.
const SNOW: f64 = 1.0;

/// Snow that falls \[m/h\].
const RATE: f64 = 1.0;

/// Frames in which every column gets what is deposited at once, h/256: those of one sample.
const PERIOD: usize = 169;

/// Samples at the least.
const LEAST_SAMPLES: usize = 3;

/// Measures what a frame takes on average.
pub(super) fn measure(
    plan: &Plan,
    report: &mut Report,
    observe: &mut dyn FnMut(&str),
) -> Result<(), BenchError> {
    let case = Case::Snowfall;
    if !plan.wants(case) {
        return Ok(());
    }
    observe("snowfall: letting snow fall");
    let host = Host::start(plan, FRAME_RATE)?;
    let spec = SessionSpec { snowfall_rate: RATE, ..spec(plan.side(2048), SNOW) };
    let grid = [spec.grid.width, spec.grid.depth, spec.grid.height];
    let session = host.create(spec)?;
    host.wait_until(case.name(), "the first snow lies everywhere", || {
        session.mirror().summary().min_height > SNOW + session.spec.grid.cell_size / 300.0
    })?;
    let samples = (plan.samples as usize / PERIOD).max(LEAST_SAMPLES);
    let watched = host.watch(case.name(), samples * PERIOD, |_| true)?;
    let average = |frames: &[FrameTime]| {
        frames.iter().map(|frame| frame.took).sum::<Duration>() / frames.len() as u32
    };
    let measured = frames::measured(case, 1, grid, &watched)?;
    let averages = watched.chunks_exact(PERIOD).map(average).collect();
    let time_s = Spread::of(averages).unwrap_or(measured.time_s);
    report.cases.push(Measured { time_s, ..measured });
    Ok(())
}
