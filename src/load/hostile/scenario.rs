//! What a hostile client does, and the session that it does it to. All of it is allowed.

use clap::ValueEnum;
use firn_protocol::{ColliderSpec, SessionSpec, SnowLayer, Terrain};
use firn_snow::{Grid, Position, Shape};
use serde::Serialize;

use crate::load::{CELL_SIZE, LoadError};

use super::Run;

/// Radius of an object \[m\].
const RADIUS: f64 = 0.5;

/// Snow whose height has many digits: 512 × 512 of them take 5 MB as JSON \[m\].
const LONG: f64 = 2.3;

/// Objects.
const OBJECTS: usize = 4000;

/// Columns along a side of a session, at the least.
const LEAST_SIDE: u32 = 8;

/// What a hostile client does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Scenario {
    /// A session of 256 × 256 × 100 cells at 1000 times real time and 240 Hz, in which snow falls.
    Ticks,
    /// 4000 objects on a live session that runs as fast.
    Objects,
    /// 4000 objects on a paused session that is stepped until it has settled, over and over.
    Settling,
    /// 16 pictures of 4096 × 2048 pixels at a time.
    Pictures,
    /// 200 connections that ask for the heights of 512 × 512 columns and never read them.
    Unread,
    /// 200 downloads of a snapshot of 512 × 512 × 20 cells at a time.
    Snapshots,
    /// 60 bodies of 15 MB of which the last byte never comes.
    Bodies,
}

impl Scenario {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Scenario::Ticks => "ticks",
            Scenario::Objects => "objects",
            Scenario::Settling => "settling",
            Scenario::Pictures => "pictures",
            Scenario::Unread => "unread",
            Scenario::Snapshots => "snapshots",
            Scenario::Bodies => "bodies",
        }
    }
}

/// Creates the session of a scenario. It is paused.
pub(super) async fn prepare(run: &Run<'_>, what: Scenario, id: &str) -> Result<(), LoadError> {
    let spec = match what {
        // Snow that falls keeps it from coming to rest.
        Scenario::Ticks => fast(session(run, id, 256, 100, 15.0)),
        Scenario::Objects => fast(session(run, id, 128, 40, 5.0)),
        Scenario::Settling => session(run, id, 128, 40, 5.0),
        Scenario::Pictures => session(run, id, 64, 40, 5.0),
        Scenario::Unread | Scenario::Snapshots => uneven(session(run, id, 512, 20, LONG)),
        Scenario::Bodies => session(run, id, LEAST_SIDE, 4, 0.4),
    };
    let length = f64::from(spec.grid.width) * CELL_SIZE;
    run.api.create_from(&spec).await?;
    if matches!(what, Scenario::Objects | Scenario::Settling) {
        run.api.put(id, objects(run.count(OBJECTS), length)).await?;
    }
    Ok(())
}

/// A paused square session with snow.
fn session(run: &Run<'_>, id: &str, side: u32, height: u32, snow: f64) -> SessionSpec {
    let side = run.side(side, LEAST_SIDE);
    SessionSpec {
        id: Some(id.to_owned()),
        grid: Grid { width: side, depth: side, height, cell_size: CELL_SIZE },
        paused: true,
        initial_snow: vec![SnowLayer::new(snow)],
        ..SessionSpec::default()
    }
}

/// The same with more cycles in a second than any device carries out.
fn fast(session: SessionSpec) -> SessionSpec {
    SessionSpec { time_scale: 1000.0, tick_rate: 240.0, snowfall_rate: 5.0, ..session }
}

/// The same on ground whose heights don't compress well.
fn uneven(session: SessionSpec) -> SessionSpec {
    let heights = (0..session.grid.columns()).map(|i| (i * 7919 % 9973) as f64 / 9973.0).collect();
    SessionSpec { terrain: Some(Terrain { heights }), ..session }
}

/// Objects in even rows all over a square of some length \[m\].
fn objects(count: usize, length: f64) -> Vec<ColliderSpec> {
    let row = (count as f64).sqrt().ceil() as usize;
    let along = |place: usize| {
        // A hair inside, whatever the rounding.
        let first = RADIUS + CELL_SIZE / 100.0;
        first + (length - 2.0 * first) * (place as f64 + 0.5) / row as f64
    };
    let object = |i: usize| ColliderSpec {
        id: Some(format!("object-{i}")),
        mass: (100 + i) as f64,
        shape: Some(Shape::Disk { radius: RADIUS }),
        position: Position { x: along(i % row), z: along(i / row) },
        ..ColliderSpec::default()
    };
    (0..count).map(object).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_lie_inside_and_each_in_its_place() {
        for (count, length) in [(1, 1.6), (80, 3.6), (4000, 25.6)] {
            let objects = objects(count, length);
            let mut places: Vec<String> = Vec::new();
            for object in &objects {
                let Position { x, z } = object.position;
                for along in [x, z] {
                    assert!((RADIUS..=length - RADIUS).contains(&along));
                }
                places.push(format!("{x} {z}"));
            }
            places.sort();
            places.dedup();
            assert_eq!(places.len(), count);
        }
    }
}
