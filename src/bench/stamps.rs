//! Many prints in one request, on fresh snow that covers a large world.

use std::time::{Duration, Instant};

use firn_protocol::{Clearing, SessionSpec, Snowfall, StampBatch, StampSpec};
use firn_snow::{Position, Shape};

use crate::session::{Applied, Change, FRAME_RATE, FrameParts, Session};

use super::case::Case;
use super::host::{GAME_SNOW, Host, game_spec};
use super::report::{Clock, Measured, Report};
use super::spread::Spread;
use super::{BenchError, Plan, frames};

/// Columns along each side at full scale.
const SIDE: u32 = 1000;

/// Prints along each side of a batch: 4096 in all.
const PRINTS: u32 = 64;

/// Time after an answer by which its frame has been noted.
const AFTERWARDS: Duration = Duration::from_millis(20);

/// Measures what a batch takes from the request to the answer.
pub(super) fn measure(
    plan: &Plan,
    report: &mut Report,
    observe: &mut dyn FnMut(&str),
) -> Result<(), BenchError> {
    let case = Case::Stamps;
    if !plan.wants(case) {
        return Ok(());
    }
    observe("stamps: pressing prints");
    let host = Host::start(plan, FRAME_RATE)?;
    let session = host.create(SessionSpec { paused: true, ..game_spec(plan.side(SIDE)) })?;
    let grid = session.spec.grid;
    let (mut times, mut parts) = (Vec::new(), Vec::new());
    for sample in 0..=plan.samples {
        renew(&host, &session)?;
        let batch = feet(f64::from(grid.width) * grid.cell_size, sample);
        let mut seen = host.newest_frame();
        let begun = Instant::now();
        let applied = host.runtime.block_on(session.change(Change::Stamps(batch)))?;
        let time = begun.elapsed();
        let has_pressed = |applied: &Applied| match applied {
            Applied::Stamps(reply) => reply.stamps.first().is_some_and(|print| print.depth > 0.0),
            _ => false,
        };
        if !has_pressed(&applied) {
            let what = "a foot has left no print".to_owned();
            return Err(BenchError::Stuck { case: case.name(), what });
        }
        // The first one compiles and allocates.
        if sample > 0 {
            times.push(time);
            // The last frame is noted after it has answered.
            host.sleep(AFTERWARDS);
            let frames = host.frames_since(&mut seen).filter(|frame| frame.sessions > 0);
            parts.push(frames.map(|frame| frame.parts).fold(FrameParts::default(), sum));
        }
    }
    let nothing = || BenchError::Stuck { case: case.name(), what: "nothing was timed".into() };
    let time = Spread::of(times).ok_or_else(nothing)?;
    let grid = [grid.width, grid.depth, grid.height];
    let measured = Measured::new(case, 1, grid, Clock::Wall, time);
    report.cases.push(Measured { parts: Some(frames::medians(parts)), ..measured });
    Ok(())
}

/// What several frames were made of.
fn sum(all: FrameParts, one: FrameParts) -> FrameParts {
    FrameParts {
        planning: all.planning + one.planning,
        submitting: all.submitting + one.submitting,
        waiting: all.waiting + one.waiting,
        concluding: all.concluding + one.concluding,
    }
}

/// Takes all snow away, and has as much fall.
fn renew(host: &Host, session: &Session) -> Result<(), BenchError> {
    let clearing = Clearing::default();
    let snowfall = Snowfall::new(GAME_SNOW);
    for change in [Change::Clearing(clearing), Change::Snowfall(snowfall)] {
        host.runtime.block_on(session.change(change))?;
    }
    Ok(())
}

/// Feet all over a square of so many metres a side, each turned by itself.
fn feet(extent: f64, sample: u32) -> StampBatch {
    let apart = extent / f64::from(PRINTS);
    let along = |place: u32| (f64::from(place) + 0.5) * apart;
    let foot = |i: u32| StampSpec {
        shape: Shape::Box { width: 0.1, depth: 0.3 },
        position: Position { x: along(i % PRINTS), z: along(i / PRINTS) },
        heading: f64::from((i + sample) * 137 % 360),
        mass: Some(80.0),
        pressure: None,
    };
    StampBatch { stamps: (0..PRINTS * PRINTS).map(foot).collect() }
}
