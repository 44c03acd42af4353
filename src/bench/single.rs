//! One session in the running world: what a frame takes, the host's part included.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use firn_protocol::{ColliderBatch, ColliderSpec, SessionSpec, SettingsPatch, StepSpec};
use firn_snow::{Position, Shape};

use crate::session::{Change, FRAME_RATE, Session};

use super::case::Case;
use super::host::{Host, spec};
use super::report::{Clock, Measured, Report};
use super::spread::Spread;
use super::{BenchError, Plan, frames};

/// Frames before the first that counts.
const WARM_UP: usize = 30;

/// Slots of a column.
const HEIGHT: u32 = 50;

/// Wheels of the vehicle: apart from its middle \[m\].
const WHEELS: [(&str, f64, f64); 4] = [
    ("front-left", 1.3, -0.8),
    ("front-right", 1.3, 0.8),
    ("rear-left", -1.3, -0.8),
    ("rear-right", -1.3, 0.8),
];

/// Load of each wheel \[kg\].
const WHEEL_LOAD: f64 = 400.0;

/// How far the vehicle moves from one frame to the next \[m\]: 40 km/h.
const STRIDE: f64 = 11.1 / FRAME_RATE;

/// Measures the cases of one session.
pub(super) fn measure(
    plan: &Plan,
    report: &mut Report,
    observe: &mut dyn FnMut(&str),
) -> Result<(), BenchError> {
    if plan.wants_any(&[Case::SessionFrame, Case::SessionFrameAwake, Case::Create]) {
        let host = Host::start(plan, FRAME_RATE)?;
        if plan.wants(Case::Create) {
            observe("create: sessions one after another");
            report.cases.push(create(&host, plan.samples)?);
        }
        if plan.wants(Case::SessionFrame) {
            observe("session-frame: a live session");
            report.cases.push(live_session(&host, Case::SessionFrame, plan.samples)?);
        }
        if plan.wants(Case::SessionFrameAwake) {
            observe("session-frame-awake: a live session beside a busy one");
            let live = || live_session(&host, Case::SessionFrameAwake, plan.samples);
            report.cases.push(beside_a_busy_session(&host, live)?);
        }
    }
    if plan.wants_any(&[Case::Vehicle, Case::VehicleAwake]) {
        observe("vehicle: laying the snow and letting it settle");
        vehicle(&Host::start(plan, FRAME_RATE)?, plan, report, observe)?;
    }
    Ok(())
}

/// A session is created, its heights are read, and it is deleted again.
fn create(host: &Host, samples: u32) -> Result<Measured, BenchError> {
    let case = Case::Create;
    let mut times = Vec::new();
    for sample in 0..=samples {
        let begun = Instant::now();
        let session = host.create(SessionSpec { paused: true, ..spec(50, 5.8) })?;
        let summary = session.mirror().summary();
        let time = begun.elapsed();
        if summary.min_height != 5.8 && (summary.min_height - 5.8).abs() > 1e-6 {
            let what = format!("the first heights are {} m", summary.min_height);
            return Err(BenchError::Stuck { case: case.name(), what });
        }
        host.runtime.block_on(host.sessions.delete(&session))?;
        // The first one compiles and allocates.
        if sample > 0 {
            times.push(time);
        }
    }
    let nothing = || BenchError::Stuck { case: case.name(), what: "nothing was timed".into() };
    let time = Spread::of(times).ok_or_else(nothing)?;
    Ok(Measured::new(case, 1, [50, 50, HEIGHT], Clock::Wall, time))
}

/// A session ticks and publishes with every frame.
fn live_session(host: &Host, case: Case, samples: u32) -> Result<Measured, BenchError> {
    let session = host.create(spec(50, 5.8))?;
    let tiles = session.spec.grid.tiles();
    let count = WARM_UP + samples as usize;
    let watched = host.watch(case.name(), count, |frame| frame.published_tiles == tiles)?;
    let timed = &watched[WARM_UP..];
    host.runtime.block_on(host.sessions.delete(&session))?;
    frames::measured(case, 1, [50, 50, HEIGHT], timed)
}

/// Does something while another session is asked for its mass all the time, with frames for that in
/// between.
fn beside_a_busy_session<T>(
    host: &Host,
    act: impl FnOnce() -> Result<T, BenchError>,
) -> Result<T, BenchError> {
    let other = host.create(SessionSpec { paused: true, ..spec(8, 1.0) })?;
    let done = AtomicBool::new(false);
    let acted = std::thread::scope(|scope| {
        scope.spawn(|| {
            while !done.load(Ordering::Relaxed) {
                if host.runtime.block_on(other.mass()).is_err() {
                    break;
                }
            }
        });
        let _done = SetOnDrop(&done);
        act()
    });
    host.runtime.block_on(host.sessions.delete(&other))?;
    acted
}

/// Sets a flag when it is dropped, by a panic too.
struct SetOnDrop<'a>(&'a AtomicBool);

impl Drop for SetOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A vehicle drives through a large world at rest.
fn vehicle(
    host: &Host,
    plan: &Plan,
    report: &mut Report,
    observe: &mut dyn FnMut(&str),
) -> Result<(), BenchError> {
    let side = plan.side(2048);
    // A quarter of a second is the longest cycle there is: it settles fastest.
    let spec = SessionSpec { paused: true, time_scale: 15.0, ..spec(side, 5.8) };
    let session = host.create(spec)?;
    let settle =
        StepSpec { until_settled: Some(true), max_seconds: Some(100_000.0), ..StepSpec::default() };
    host.runtime.block_on(session.step(settle))?;
    let live =
        SettingsPatch { paused: Some(false), time_scale: Some(1.0), ..SettingsPatch::default() };
    host.runtime.block_on(session.change(Change::Settings(live)))?;
    let name = Case::Vehicle.name();
    host.wait_until(name, "the snow comes to rest", || session.mirror().settled)?;
    if plan.wants(Case::Vehicle) {
        observe("vehicle: driving");
        report.cases.push(drive(host, &session, Case::Vehicle, plan.samples)?);
    }
    if plan.wants(Case::VehicleAwake) {
        observe("vehicle-awake: driving beside a busy session");
        let drive = || drive(host, &session, Case::VehicleAwake, plan.samples);
        report.cases.push(beside_a_busy_session(host, drive)?);
    }
    Ok(())
}

/// Moves the vehicle with every beat.
fn drive(host: &Host, session: &Session, case: Case, samples: u32) -> Result<Measured, BenchError> {
    let grid = session.spec.grid;
    let extent = f64::from(grid.width) * grid.cell_size;
    let mut seen = host.newest_frame();
    let mut driven = Vec::new();
    let way = extent - 4.0;
    for step in 0..WARM_UP as u32 + samples {
        let x = 2.0 + (f64::from(step) * STRIDE) % way.max(0.1);
        let put = wheels(x.min(extent), extent / 2.0);
        let batch = ColliderBatch { put, ..ColliderBatch::default() };
        host.runtime.block_on(session.change(Change::Colliders(batch)))?;
        host.sleep(Duration::from_secs_f64(1.0 / FRAME_RATE));
        driven.extend(host.frames_since(&mut seen).filter(|frame| frame.published_tiles > 0));
    }
    let timed = driven.get(WARM_UP..).unwrap_or_default();
    frames::measured(case, 1, [grid.width, grid.depth, grid.height], timed)
}

fn wheels(x: f64, z: f64) -> Vec<ColliderSpec> {
    let wheel = |&(id, dx, dz): &(&str, f64, f64)| ColliderSpec {
        id: Some(id.to_owned()),
        mass: WHEEL_LOAD,
        shape: Some(Shape::Box { width: 0.4, depth: 0.4 }),
        position: Position { x: (x + dx).max(0.0), z: (z + dz).max(0.0) },
        ..ColliderSpec::default()
    };
    WHEELS.iter().map(wheel).collect()
}
