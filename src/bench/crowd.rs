//! Thousands of sessions in one world.

use std::sync::Arc;

use firn_protocol::{SessionSpec, SettingsPatch};
use firn_snow::Column;

use crate::session::Session;

use super::case::Case;
use super::host::{Host, spec};
use super::report::{Measured, Report, pass_bytes};
use super::{BenchError, Plan, frames};

/// Frames before the first that counts.
const WARM_UP: usize = 6;

/// Frames that are measured at the most, one in four of which publishes: those of two seconds. A
/// driver may turn the clocks of a device down after a while in which it has mostly nothing to do.
const MOST_FRAMES: usize = 40;

/// Frames that are measured at the least: some of them publish.
const LEAST_FRAMES: usize = 12;

/// Columns along each side of a session, and slots.
const GRID: [u32; 3] = [50, 50, 50];

/// Measures the cases of a crowd.
pub(super) fn measure(
    plan: &Plan,
    report: &mut Report,
    observe: &mut dyn FnMut(&str),
) -> Result<(), BenchError> {
    if !plan.wants_any(&[Case::Crowd, Case::CrowdPublished, Case::CrowdRest]) {
        return Ok(());
    }
    let host = Host::start(plan, 5.0)?;
    let count = plan.count(10_000);
    let specs = (0..count).map(|_| SessionSpec { paused: true, tick_rate: 20.0, ..spec(50, 5.8) });
    let sessions = host.create_many(specs, |done| {
        if done % 100 == 0 {
            observe(&format!("crowd: {done} of {count} sessions are there"));
        }
    })?;
    let run = SettingsPatch { paused: Some(false), ..SettingsPatch::default() };
    host.set_all(&sessions, run)?;

    let samples = plan.samples as usize;
    if plan.wants_any(&[Case::Crowd, Case::CrowdPublished]) {
        observe("crowd: frames in which all sessions tick");
        report.cases.extend(live(
            plan,
            &host,
            &sessions,
            samples.clamp(LEAST_FRAMES, MOST_FRAMES),
        )?);
    }
    if plan.wants(Case::CrowdRest) {
        observe("crowd-rest: letting the snow settle");
        let fast = SettingsPatch { time_scale: Some(1000.0), ..SettingsPatch::default() };
        host.set_all(&sessions, fast)?;
        let name = Case::CrowdRest.name();
        let settled = || sessions.iter().all(|session| session.mirror().settled);
        host.wait_until(name, "the snow comes to rest", settled)?;
        observe("crowd-rest: frames in which nothing moves");
        let timed = host.watch(name, WARM_UP + samples, |frame| frame.sessions == 0)?;
        let timed = &timed[WARM_UP..];
        report.cases.push(frames::measured(Case::CrowdRest, count, GRID, timed)?);
    }
    Ok(())
}

/// Watches frames in which all sessions tick, those that publish apart from those that don't.
fn live(
    plan: &Plan,
    host: &Host,
    sessions: &[Arc<Session>],
    samples: usize,
) -> Result<Vec<Measured>, BenchError> {
    let count = sessions.len() as u32;
    let tiles = count * sessions[0].spec.grid.tiles();
    let before = columns(host, &sessions[0])?;
    let watched = host.watch(Case::Crowd.name(), WARM_UP + samples, |frame| {
        frame.sessions == count && (frame.published_tiles == 0 || frame.published_tiles == tiles)
    })?;
    let after = columns(host, &sessions[0])?;
    let (published, unpublished): (Vec<_>, Vec<_>) =
        watched[WARM_UP..].iter().partition(|frame| frame.published_tiles > 0);
    let mut cases = Vec::new();
    for (case, timed) in [(Case::Crowd, unpublished), (Case::CrowdPublished, published)] {
        if plan.wants(case) {
            let (cells, moving) = moved(&before, &after);
            let (cells, moving) = (cells * u64::from(count), moving * u64::from(count));
            let measured = frames::measured(case, count, GRID, &timed)?;
            cases.push(measured.with_work(cells, moving, 1, pass_bytes(cells, moving)));
        }
    }
    Ok(cases)
}

/// All columns of a session.
fn columns(host: &Host, session: &Session) -> Result<Vec<Column>, BenchError> {
    Ok(host.runtime.block_on(session.columns())?)
}

/// Cells with snow, and those of them that are thinner than they were.
fn moved(before: &[Column], after: &[Column]) -> (u64, u64) {
    let (mut cells, mut moving) = (0, 0);
    for (before, after) in before.iter().zip(after) {
        cells += after.cells.len() as u64;
        let pairs = before.cells.iter().zip(&after.cells);
        moving += pairs.filter(|(before, after)| after.thickness < before.thickness).count() as u64;
    }
    (cells, moving)
}
