//! An object that travels: it leaves a track, and the snow carries its weight at every tick.

use firn_engine::frame::{Backend, Edit, Run, Work};
use firn_snow::{Elevation, Footprint, GRAVITY, Grid, Material, Position, Shape, Turn, share};

use crate::support::*;

const MASS: f64 = 80.0;
const MOVES: u32 = 500;

/// Where the object is after a number of moves: once across the grid and back along a curve.
fn place(step: u32) -> (f64, f64) {
    let t = f64::from(step) / f64::from(MOVES);
    (0.8 + 6.0 * t, 2.0 + 0.9 * (9.0 * t).sin())
}

fn travel(backend: &mut dyn Backend) {
    let grid = Grid { width: 40, depth: 20, height: 20, cell_size: 0.2 };
    let shape = Shape::Box { width: 0.7, depth: 0.5 };
    backend.create(0, &level(grid, Material::default())).unwrap();
    edit(backend, 0, vec![snow(&grid, grid.all(), 2.0, 20.0, -3.0)]);
    run(backend, 0, 2000, 0.1);
    let before = heights(&cells(backend, 0, &grid), &grid);

    let mut last: Vec<u32> = Vec::new();
    for step in 0..MOVES {
        let (x, z) = place(step);
        let edits = vec![put(&grid, "cart", MASS, shape.clone(), x, z)];
        // A paused frame, so that contact is evaluated on heights that can be read.
        let outcome = work(backend, Work { slot: 0, edits, publish: true, ..Work::default() });
        let contact = outcome.contacts[0].1;
        let footprint = Footprint::new(&grid, &shape, Position { x, z }, Turn::NONE);
        let tiles = cells(backend, 0, &grid);
        let carried: f64 = footprint
            .iter()
            .map(|(x, z)| {
                let (tile, column) = grid.locate(x, z);
                let height = tiles[tile as usize].column(column).map(|cell| cell.thickness).sum();
                f64::from(
                    contact.pressure * share(contact.bottom, Elevation::default().under(height)),
                )
            })
            .sum::<f64>()
            * footprint.area
            / f64::from(footprint.columns);
        let weight = MASS * GRAVITY;
        assert!((carried / weight - 1.0).abs() < 1e-5, "step {step}: {carried} N of {weight} N");

        let run = Run { cycles: 1, dt: 0.05 };
        work(backend, Work { slot: 0, run, wake: true, ..Work::default() });
        let now: Vec<u32> = cells(backend, 0, &grid)
            .iter()
            .flat_map(|tile| (0..64).map(|c| tile.column(c).map(|cell| cell.thickness).sum()))
            .collect();
        assert!(last.iter().zip(&now).all(|(before, now)| now <= before), "snow rose");
        last = now;
    }
    edit(backend, 0, vec![Edit::RemoveCollider { id: "cart".into() }]);
    let after = heights(&cells(backend, 0, &grid), &grid);
    let sunk = |x: f64, z: f64| {
        let i = (z / 0.2) as usize * grid.width as usize + (x / 0.2) as usize;
        before[i] - after[i]
    };
    for step in (0..MOVES).step_by(50) {
        let (x, z) = place(step);
        assert!(sunk(x, z) > 0.03, "no track at step {step}: {} m", sunk(x, z));
    }
    assert!(
        sunk(0.1, 0.1).abs() < 1e-3 && sunk(7.9, 3.9).abs() < 1e-3,
        "snow beside the track fell"
    );
}

#[test]
fn on_the_gpu() {
    if let Some(mut gpu) = gpu(false) {
        travel(&mut gpu);
    }
}

#[test]
fn on_the_reference() {
    travel(&mut cpu());
}
