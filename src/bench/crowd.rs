//! Thousands of sessions in one world.

use std::sync::Arc;
use std::time::Duration;

use super::case::Case;
use super::host::{Host, spec};
use super::report::{Clock, Measured, Report, pass_bytes};
use super::spread::Spread;
use super::{BenchError, Plan};
use crate::engine::frame::TileCells;
use crate::session::{FrameTime, Session, SessionSpec, SettingsPatch};

/// Frames before the first that counts.
const WARM_UP: usize = 6;

/// Publishing frames that are measured at the most: there are five in a second.
const MOST_PUBLISHED: usize = 50;

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
    let all = |frame: &FrameTime| frame.sessions == count;
    if plan.wants(Case::Crowd) {
        observe("crowd: frames that publish nothing");
        let before = cells(&host, &sessions[0])?;
        let frames = host.watch(Case::Crowd.name(), WARM_UP + samples, |frame| {
            all(frame) && frame.published_tiles == 0
        })?;
        let after = cells(&host, &sessions[0])?;
        let measured = measured(Case::Crowd, count, times(&frames))?;
        let (cells, moving) = moved(&before, &after);
        let (cells, moving) = (cells * u64::from(count), moving * u64::from(count));
        report.cases.push(measured.with_work(cells, moving, 1, pass_bytes(cells, moving)));
    }
    if plan.wants(Case::CrowdPublished) {
        observe("crowd-published: frames that publish everything");
        let tiles = count * sessions[0].spec.grid.tiles();
        let wanted = WARM_UP + samples.min(MOST_PUBLISHED);
        let frames = host.watch(Case::CrowdPublished.name(), wanted, |frame| {
            all(frame) && frame.published_tiles == tiles
        })?;
        report.cases.push(measured(Case::CrowdPublished, count, times(&frames))?);
    }
    if plan.wants(Case::CrowdRest) {
        observe("crowd-rest: letting the snow settle");
        let fast = SettingsPatch { time_scale: Some(1000.0), ..SettingsPatch::default() };
        host.set_all(&sessions, fast)?;
        let name = Case::CrowdRest.name();
        let settled = || sessions.iter().all(|session| session.mirror().settled);
        host.wait_until(name, "the snow comes to rest", settled)?;
        observe("crowd-rest: frames in which nothing moves");
        let frames = host.watch(name, WARM_UP + samples, |frame| frame.sessions == 0)?;
        report.cases.push(measured(Case::CrowdRest, count, times(&frames))?);
    }
    Ok(())
}

fn times(frames: &[FrameTime]) -> Vec<Duration> {
    frames[WARM_UP..].iter().map(|frame| frame.took).collect()
}

fn measured(case: Case, count: u32, times: Vec<Duration>) -> Result<Measured, BenchError> {
    let nothing = || BenchError::Stuck { case: case.name(), what: "nothing was timed".into() };
    let time = Spread::of(times).ok_or_else(nothing)?;
    Ok(Measured::new(case, count, GRID, Clock::Wall, time))
}

/// All cells of a session.
fn cells(host: &Host, session: &Arc<Session>) -> Result<Vec<TileCells>, BenchError> {
    let tiles = (0..session.spec.grid.tiles()).collect();
    Ok(host.runtime.block_on(session.cells(tiles))?)
}

/// Cells with snow, and those of them that are thinner than they were.
fn moved(before: &[TileCells], after: &[TileCells]) -> (u64, u64) {
    let (mut cells, mut moving) = (0, 0);
    for (before, after) in before.iter().zip(after) {
        cells += after.mass.iter().filter(|&&mass| mass > 0).count() as u64;
        let pairs = before.thickness.iter().zip(&after.thickness);
        moving += pairs.filter(|(before, after)| after < before).count() as u64;
    }
    (cells, moving)
}
