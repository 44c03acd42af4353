//! Objects that move in cycles: the device beside the reference, and what they leave behind.

use std::sync::Arc;

use firn_engine::frame::{Backend, Edit, Moves, Placement, Run, Work};
use firn_snow::{Body, Grid, Motion, Position, Preset, Pressing, Shape};

use crate::support::*;

/// Carries out cycles in which objects move, each in a frame of its own.
fn drive(
    backend: &mut dyn Backend,
    grid: &Grid,
    objects: &mut [Body],
    run: Run,
    pressing: Pressing,
) {
    for _ in 0..run.cycles {
        let steps = objects.iter().map(|object| object.steps(grid, run.dt)).max().unwrap();
        let mut moves = Moves::default();
        for left in (1..=steps).rev() {
            let dt = run.dt / f64::from(steps);
            let step = objects.iter_mut().zip(0..).filter_map(|(object, i)| {
                let footprints = object.step(grid, dt, left)?;
                let collider =
                    Arc::new(Placement { mass: object.load(), cover: object.cover(), footprints });
                let id = Arc::from(format!("{i:03}"));
                Some(Edit::PutCollider { id, collider, placed: true })
            });
            moves.steps.push(step.collect());
        }
        let run = Run { cycles: 1, ..run };
        let moves = vec![moves];
        work(backend, Work { run, moves, pressing, publish: true, ..Work::default() });
    }
}

fn object(shape: Shape, mass: f64, x: f64, z: f64, motion: Motion) -> Body {
    let position = Position { x, z };
    Body { mass, shape: Some(shape), position, motion, ..Body::default() }
}

fn along_x(speed: f64) -> Motion {
    Motion { velocity: Position { x: speed, z: 0.0 }, ..Motion::default() }
}

#[test]
fn a_device_moves_objects_as_the_reference_does() {
    let Some(mut gpu) = gpu(false) else { return };
    let grid = Grid { width: 60, depth: 40, height: 24, cell_size: 0.1 };
    let material = Preset::Game.material();
    for (pressing, slack) in [(Pressing::Within(0.25), 1e-4), (Pressing::Creep, 1e-4)] {
        let mut tracks = Vec::new();
        for backend in [&mut gpu as &mut dyn Backend, &mut cpu()] {
            backend.create(0, &level(grid, material)).unwrap();
            let wheel = Shape::Wheel { width: 0.2, radius: 0.4 };
            let ski = Shape::Box { width: 0.1, depth: 1.8 };
            let turning = Motion { turn_rate: 120.0, ..along_x(1.5) };
            let mut objects = [
                object(wheel, 300.0, 1.0, 1.0, along_x(6.0)),
                object(ski, 40.0, 1.5, 2.5, turning),
                object(Shape::Disk { radius: 0.3 }, 100.0, 4.0, 1.0, Motion::default()),
            ];
            let mut edits = vec![snow(&grid, grid.all(), 0.8, 60.0, -4.0)];
            for (i, object) in (0..).zip(&objects) {
                edits.push(put_object(&grid, &format!("{i:03}"), object));
            }
            edit(backend, 0, edits);
            let run = Run { cycles: 12, dt: 0.05 };
            drive(backend, &grid, &mut objects, run, pressing);
            tracks.push(heights(&cells(backend, 0, &grid), &grid));
            backend.release(0);
        }
        let largest = tracks[0].iter().zip(&tracks[1]).map(|(a, b)| (a - b).abs());
        let largest = largest.fold(0.0, f64::max);
        let untouched = tracks[1].last().unwrap() - 0.0005;
        let dented = tracks[1].iter().filter(|height| **height < untouched).count();
        assert!(largest < slack, "{pressing:?}: {largest} m apart");
        assert!(dented > 50, "{pressing:?}: only {dented} columns are dented");
    }
}

#[test]
fn a_track_has_no_gap_and_is_as_deep_at_any_tick_rate() {
    let grid = Grid { width: 120, depth: 16, height: 24, cell_size: 0.1 };
    let ski = Shape::Box { width: 0.1, depth: 1.8 };
    let mut depths: Vec<Vec<f64>> = Vec::new();
    // Cycles of 20 Hz and of 60 Hz: at 240 Hz four ticks make one cycle.
    for (cycles, dt) in [(18, 0.05), (54, 1.0 / 60.0)] {
        let mut backend = cpu();
        backend.create(0, &level(grid, Preset::Game.material())).unwrap();
        let skier = Body { heading: 90.0, ..object(ski.clone(), 80.0, 1.05, 0.8, along_x(10.0)) };
        let mut objects = [skier];
        let edits =
            vec![snow(&grid, grid.all(), 1.0, 60.0, -4.0), put_object(&grid, "000", &objects[0])];
        edit(&mut backend, 0, edits);
        let run = Run { cycles, dt };
        drive(&mut backend, &grid, &mut objects, run, Pressing::Within(0.25));
        let heights = heights(&cells(&mut backend, 0, &grid), &grid);
        let untouched = heights[119];
        depths.push((25..85).map(|x| untouched - heights[8 * 120 + x]).collect());
    }
    let mean = |depths: &[f64]| depths.iter().sum::<f64>() / depths.len() as f64;
    let (slow, fast) = (mean(&depths[0]), mean(&depths[1]));
    assert!(
        slow > 0.03 && (slow / fast - 1.0).abs() < 0.03,
        "{slow} m at 20 Hz, {fast} m at 60 Hz"
    );
    for depths in &depths {
        let shallowest = depths.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(shallowest > 0.9 * mean(depths), "{shallowest} m of {} m", mean(depths));
    }
}
