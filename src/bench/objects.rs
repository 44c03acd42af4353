//! Objects that move by themselves over a large world, all at a time.

use firn_protocol::{ColliderBatch, ColliderSpec};
use firn_snow::{Position, Shape};

use crate::session::{Change, FRAME_RATE};

use super::case::Case;
use super::host::{Host, game_spec};
use super::report::Report;
use super::{BenchError, Plan, frames};

/// Columns along each side at full scale.
const SIDE: u32 = 1000;

/// Objects, their speed \[m/s\], and how often they cross the world.
const OBJECTS: u32 = 200;
const SPEED: f64 = 10.0;
const CROSSINGS: u32 = 400;

/// Measures frames in which all of them move.
pub(super) fn measure(
    plan: &Plan,
    report: &mut Report,
    observe: &mut dyn FnMut(&str),
) -> Result<(), BenchError> {
    let case = Case::Objects;
    if !plan.wants(case) {
        return Ok(());
    }
    observe("objects: moving objects");
    let host = Host::start(plan, FRAME_RATE)?;
    let session = host.create(game_spec(plan.side(SIDE)))?;
    let grid = session.spec.grid;
    let extent = f64::from(grid.width) * grid.cell_size;
    let batch = ColliderBatch { put: objects(extent), ..ColliderBatch::default() };
    host.runtime.block_on(session.change(Change::Colliders(batch)))?;
    let watched = host.watch(case.name(), plan.samples as usize, |frame| frame.sessions > 0)?;
    let grid = [grid.width, grid.depth, grid.height];
    report.cases.push(frames::measured(case, 1, grid, &watched)?);
    Ok(())
}

/// Objects side by side, which go to and fro.
fn objects(extent: f64) -> Vec<ColliderSpec> {
    let object = |i: u32| {
        let (near, far) = (1.0, extent - 1.0);
        let z = (f64::from(i) + 0.5) / f64::from(OBJECTS) * extent;
        // They begin apart, so that they do not all come to the same tiles at a time.
        let x = near + f64::from(i * 37 % OBJECTS) / f64::from(OBJECTS) * (far - near);
        let ends = [far, near].into_iter().cycle().take(CROSSINGS as usize);
        let over = ((far - x) + f64::from(CROSSINGS - 1) * (far - near)) / SPEED;
        ColliderSpec {
            id: Some(format!("object-{i}")),
            mass: 80.0,
            shape: Some(Shape::Box { width: 0.3, depth: 0.3 }),
            position: Position { x, z },
            path: Some(ends.map(|x| [x, z]).collect()),
            over: Some(over),
            ..ColliderSpec::default()
        }
    };
    (0..OBJECTS).map(object).collect()
}
