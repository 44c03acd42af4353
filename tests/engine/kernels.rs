//! Every kernel beside its twin, on random inputs.

use std::sync::Arc;

use firn_engine::frame::{Backend, ColumnRead, Contents, Edit, Outcome, Run, SampleBox, Work};
use firn_engine::published::TileColumns;
use firn_snow::{
    Body, CELL, Cell, Column, Elevation, Floor, Grid, HardnessLaw, LoadDistribution, Material,
    Position, Shape,
};

use crate::support::*;

pub const LAWS: [HardnessLaw; 3] =
    [HardnessLaw::Calibrated, HardnessLaw::Regression, HardnessLaw::Gold];

fn grids() -> [Grid; 3] {
    [
        Grid { width: 13, depth: 9, height: 12, cell_size: 0.2 },
        Grid { width: 8, depth: 8, height: 50, cell_size: 0.1 },
        Grid { width: 1, depth: 17, height: 3, cell_size: 0.5 },
    ]
}

#[test]
fn snow_falls_and_is_cleared_as_in_the_reference() {
    let Some(mut gpu) = gpu(false) else { return };
    let mut cpu = cpu();
    let mut dice = Dice::new(1);
    for (slot, grid) in (0..).zip(grids()) {
        let material = Material::default();
        gpu.create(slot, &level(grid, material)).unwrap();
        cpu.create(slot, &level(grid, material)).unwrap();
        for round in 0..30 {
            let edits: Vec<Edit> =
                (0..1 + dice.below(3)).map(|_| dice.weather(&grid, &material)).collect();
            let ours = edit(&mut gpu, slot, edits.clone());
            let theirs = edit(&mut cpu, slot, edits.clone());
            let (a, b) = (cells(&mut gpu, slot, &grid), cells(&mut cpu, slot, &grid));
            let difference = compare(&a, &b);
            // Densities within a cell are cut in floating point: a re-cut may differ by as much as
            // a product of 32-bit integers rounded to 24 bits, and so may what finds no room.
            assert!(difference.mass <= 64, "round {round}: {difference:?}\n{edits:?}");
            assert_eq!(difference.thickness, 0, "round {round}: {difference:?}\n{edits:?}");
            assert!(difference.temperature < 1e-4, "round {round}: {difference:?}\n{edits:?}");
            assert!(difference.stress < 1e-5, "round {round}: {difference:?}\n{edits:?}");
            let close = ours.edits.iter().zip(&theirs.edits).all(|(a, b)| a.abs_diff(*b) <= 4096);
            assert!(close, "round {round}: {:?} {:?}", ours.edits, theirs.edits);
        }
    }
}

#[test]
fn columns_are_read_as_in_the_reference() {
    let Some(mut gpu) = gpu(false) else { return };
    let mut cpu = cpu();
    let mut dice = Dice::new(12);
    for (slot, grid) in (0..).zip(grids()) {
        let edits: Vec<Edit> = (0..9)
            .map(|_| {
                let depth = grid.cell_size * dice.range(0.5, 0.1 * f64::from(grid.height) + 1.0);
                snow(&grid, dice.rect(&grid), depth, dice.range(15.0, 60.0), -5.0)
            })
            .collect();
        let count = grid.tiles() * 64;
        let all = ColumnRead { columns: (0..count).collect(), cells: grid.height };
        let some = |dice: &mut Dice| (0..37).map(|_| dice.below(count)).collect::<Vec<u32>>();
        let tops = ColumnRead { columns: some(&mut dice), cells: 1 };
        let upper = ColumnRead { columns: some(&mut dice), cells: 2.min(grid.height) };
        let reads = vec![tops, all, upper];
        let mut told: Vec<Vec<Vec<Column>>> = Vec::new();
        for backend in [&mut gpu as &mut dyn Backend, &mut cpu] {
            backend.create(slot, &level(grid, Material::default())).unwrap();
            let wanted = Work { slot, columns: reads.clone(), ..Work::default() };
            let outcome = work(backend, Work { edits: edits.clone(), ..wanted.clone() });
            let tiles = cells(backend, slot, &grid);
            for (read, columns) in reads.iter().zip(&outcome.columns) {
                assert_eq!(read.columns.len(), columns.len());
                for (&index, column) in read.columns.iter().zip(columns) {
                    let whole: Vec<Cell> = tiles[index as usize / 64].column(index % 64).collect();
                    let first = whole.len().saturating_sub(read.cells as usize);
                    assert_eq!(column.cells, whole[first..], "column {index}");
                }
            }
            assert_eq!(work(backend, wanted).columns, outcome.columns, "nothing has changed");
            told.push(outcome.columns);
        }
        let snow = |columns: &[Vec<Column>]| -> Vec<(u32, u32)> {
            let cells = columns.iter().flatten().flat_map(|column| &column.cells);
            cells.map(|cell| (cell.mass, cell.thickness)).collect()
        };
        assert!(told[0].iter().flatten().any(|column| column.cells.len() > 1));
        assert_eq!(snow(&told[0]), snow(&told[1]), "{grid:?}");
    }
}

#[test]
fn deposits_without_a_recut_are_equal_to_the_quantum() {
    let Some(mut gpu) = gpu(false) else { return };
    let mut cpu = cpu();
    let grid = Grid { width: 20, depth: 11, height: 40, cell_size: 0.2 };
    let material = Material::default();
    gpu.create(0, &level(grid, material)).unwrap();
    cpu.create(0, &level(grid, material)).unwrap();
    let mut dice = Dice::new(2);
    for _ in 0..40 {
        let depth = dice.range(0.001, 0.3);
        let density = dice.range(19.0, 21.0);
        let edits = vec![snow(&grid, dice.rect(&grid), depth, density, dice.range(-3.3, -3.0))];
        let ours = edit(&mut gpu, 0, edits.clone());
        let theirs = edit(&mut cpu, 0, edits);
        assert_eq!(ours.edits, theirs.edits);
    }
    let difference = compare(&cells(&mut gpu, 0, &grid), &cells(&mut cpu, 0, &grid));
    assert_eq!((difference.mass, difference.thickness), (0, 0));
    assert!(difference.temperature < 1e-5 && difference.stress < 1e-5, "{difference:?}");
}

#[test]
fn cells_compact_as_in_the_reference() {
    let Some(mut gpu) = gpu(false) else { return };
    let mut cpu = cpu();
    let mut dice = Dice::new(3);
    let mut slot = 0;
    for grid in grids() {
        for hardness_law in LAWS {
            let material = Material {
                hardness_law,
                max_density: dice.range(60.0, 500.0),
                stiffness_exponent: dice.range(3.0, 4.0),
                grain_size_mm: dice.range(0.2, 2.0),
                ..Material::default()
            };
            gpu.create(slot, &level(grid, material)).unwrap();
            cpu.create(slot, &level(grid, material)).unwrap();
            let edits: Vec<Edit> = (0..8)
                .map(|_| {
                    let depth =
                        grid.cell_size * dice.range(1.0, 0.2 * f64::from(grid.height) + 1.0);
                    let density = dice.range(10.0, 60.0);
                    snow(&grid, dice.rect(&grid), depth, density, dice.range(-30.0, 0.0))
                })
                .collect();
            edit(&mut gpu, slot, edits.clone());
            edit(&mut cpu, slot, edits);
            for _ in 0..5 {
                let cycles = 1 + dice.below(40);
                let dt = dice.range(1.0 / 60.0, 0.25);
                let before = cells(&mut cpu, slot, &grid);
                run(&mut gpu, slot, cycles, dt);
                run(&mut cpu, slot, cycles, dt);
                let (a, b) = (cells(&mut gpu, slot, &grid), cells(&mut cpu, slot, &grid));
                // In parts of what the cells were compacted by, since the products that hardness
                // is a sum of cancel each other, and powers are only so exact.
                for ((a, b), before) in a.iter().zip(&b).zip(&before) {
                    for i in 0..a.mass.len() {
                        let indent = before.thickness[i] - b.thickness[i];
                        let apart = a.thickness[i].abs_diff(b.thickness[i]);
                        assert!(
                            apart <= 200 + indent / 2000,
                            "{hardness_law:?}: {apart} quanta apart after an indent of {indent}"
                        );
                    }
                }
                assert_eq!(compare(&a, &b).mass, 0);
            }
            slot += 1;
        }
    }
}

#[test]
fn objects_touch_and_load_the_snow_as_in_the_reference() {
    let Some(mut gpu) = gpu(false) else { return };
    let mut cpu = cpu();
    let mut dice = Dice::new(4);
    let distributions =
        [LoadDistribution::TwoToOne, LoadDistribution::Uniform, LoadDistribution::Surface];
    for (slot, load_distribution) in (0..).zip(distributions) {
        let grid = Grid { width: 30, depth: 21, height: 30, cell_size: 0.2 };
        let material = Material { load_distribution, ..Material::default() };
        let mut layout = level(grid, material);
        // Gentle terrain, so that objects are carried by some of their columns, on both sides of a whole cell;
        // and a few chasms and towers.
        let gentle = Elevation::of_cells(-3, CELL - (1 << 16));
        let ground = |dice: &mut Dice| match dice.below(300) {
            0 => 19_000.0,
            1..10 => -19_000.0,
            _ => gentle.under(dice.below(1 << 17)).metres(&grid),
        };
        layout.ground = (0..grid.columns()).map(|_| ground(&mut dice)).collect();
        gpu.create(slot, &layout).unwrap();
        cpu.create(slot, &layout).unwrap();
        let all = vec![snow(&grid, grid.all(), 2.0, 20.0, -3.0)];
        edit(&mut gpu, slot, all.clone());
        edit(&mut cpu, slot, all);
        for round in 0..12 {
            let mut edits = Vec::new();
            for _ in 0..1 + dice.below(4) {
                let id = format!("o{}", dice.below(9));
                // Some of them hang over the edge.
                let position = Position { x: dice.range(0.0, 6.0), z: dice.range(0.0, 4.2) };
                let object = any_object(&mut dice, position);
                if dice.unit() < 0.2 {
                    edits.push(Edit::RemoveCollider { id: id.into() });
                } else {
                    edits.push(put_object(&grid, &id, &object));
                }
            }
            let ours = edit(&mut gpu, slot, edits.clone());
            let theirs = edit(&mut cpu, slot, edits.clone());
            assert_eq!(ours.contacts.len(), theirs.contacts.len());
            let cells_apart = compare(&cells(&mut gpu, slot, &grid), &cells(&mut cpu, slot, &grid));
            // The snow itself may be a few quanta apart by now; share and stress follow it.
            assert!(cells_apart.stress < 2e-3, "round {round}: {cells_apart:?}\n{edits:?}");
            for ((id, a), (other, b)) in ours.contacts.iter().zip(&theirs.contacts) {
                assert_eq!(id, other);
                if round == 0 {
                    assert_eq!((a.bottom, a.support), (b.bottom, b.support), "{id}");
                }
                assert!((a.bottom - b.bottom).abs() <= 4000, "{id}: {a:?} {b:?}");
                assert!((a.reference - b.reference).abs() <= 4000, "{id}: {a:?} {b:?}");
                assert!((a.area - b.area).abs() <= 2e-3 * b.area + 1e-6, "{id}: {a:?} {b:?}");
                assert!((a.pressure - b.pressure).abs() <= 1e-2 * b.pressure, "{id}: {a:?} {b:?}");
            }
            let cycles = 1 + dice.below(5);
            let moved = (
                run(&mut gpu, slot, cycles, 1.0 / 60.0).last_change,
                run(&mut cpu, slot, cycles, 1.0 / 60.0).last_change,
            );
            assert_eq!(moved.0, moved.1);
        }
        let difference = compare(&cells(&mut gpu, slot, &grid), &cells(&mut cpu, slot, &grid));
        assert_eq!(difference.mass, 0);
    }
}

#[test]
fn publications_hold_exactly_the_tiles_that_changed() {
    let Some(mut gpu) = gpu(false) else { return };
    let mut cpu = cpu();
    let grid = Grid { width: 70, depth: 50, height: 10, cell_size: 0.2 };
    let material = Material::default();
    let mut dice = Dice::new(5);
    for backend in [&mut gpu as &mut dyn Backend, &mut cpu] {
        backend.create(3, &level(grid, material)).unwrap();
        let first = carry_out(backend, vec![Work { slot: 3, publish: true, ..Work::default() }]);
        assert_eq!(first.published.count(), grid.tiles(), "all tiles of a new snowpack");
    }
    for _ in 0..10 {
        let edits = vec![snow(&grid, dice.rect(&grid), 0.7, 40.0, -9.0)];
        let work = vec![Work { slot: 3, edits, publish: true, tally: true, ..Work::default() }];
        let ours = carry_out(&mut gpu, work.clone());
        let theirs = carry_out(&mut cpu, work);
        let changed = |outcome: &Outcome| -> Vec<(u32, TileColumns)> {
            let tiles = outcome.work[0].tiles.clone();
            outcome.published.tiles(tiles).map(|(tile, heights)| (tile, *heights)).collect()
        };
        assert!(!changed(&ours).is_empty());
        assert_eq!(changed(&ours), changed(&theirs));
        assert_eq!(ours.work[0].mass, theirs.work[0].mass);
        assert_eq!(ours.work[0].active_tiles, theirs.work[0].active_tiles);
    }
    let nothing = carry_out(&mut gpu, vec![Work { slot: 3, publish: true, ..Work::default() }]);
    assert_eq!(nothing.published.count(), 0);
}

#[test]
fn snow_after_an_object_in_one_frame_does_not_count_as_sinking() {
    let Some(mut gpu) = gpu(false) else { return };
    let mut cpu = cpu();
    let grid = Grid { width: 16, depth: 16, height: 30, cell_size: 0.2 };
    // Snow falls through it.
    let fence = Body {
        mass: 10.0,
        shape: Some(Shape::Box { width: 1.0, depth: 1.0 }),
        position: Position { x: 1.5, z: 1.5 },
        shelters: false,
        ..Body::default()
    };
    for backend in [&mut gpu as &mut dyn Backend, &mut cpu] {
        backend.create(0, &level(grid, Material::default())).unwrap();
        let edits = vec![
            snow(&grid, grid.all(), 1.0, 20.0, -3.0),
            put_object(&grid, "a", &fence),
            snow(&grid, grid.all(), 0.5, 20.0, -3.0),
        ];
        let outcome = edit(backend, 0, edits);
        let contact = outcome.contacts[0].1;
        assert_eq!(contact.reference.metres(&grid), 1.0);
        assert_eq!(contact.bottom.metres(&grid), 1.5);
    }
}

#[test]
fn the_fixed_grid_is_sampled_as_in_the_reference() {
    let Some(mut gpu) = gpu(false) else { return };
    let mut cpu = cpu();
    let mut dice = Dice::new(6);
    for (slot, hardness_law) in (0..).zip(LAWS) {
        let grid = Grid { width: 19, depth: 13, height: 14, cell_size: 0.2 };
        let material = Material { hardness_law, ..Material::default() };
        let mut layout = level(grid, material);
        let lowest = Elevation::of_cells(-9, 7 << 20);
        layout.ground =
            (0..grid.columns()).map(|_| lowest.under(dice.below(1 << 26)).metres(&grid)).collect();
        let edits: Vec<Edit> = (0..7).map(|_| dice.weather(&grid, &material)).collect();
        let plate = put(&grid, "a", 90.0, Shape::Disk { radius: 0.8 }, 1.5, 1.2);
        let floor = Floor::Level(lowest);
        let boxes = vec![
            SampleBox { columns: grid.all(), floor, y0: 0, height: 30, dt: 0.1 },
            SampleBox { columns: dice.rect(&grid), floor, y0: 3, height: 4, dt: 0.1 },
            SampleBox { columns: grid.all(), floor: Floor::Ground, y0: 0, height: 14, dt: 0.1 },
        ];
        let mut samples = Vec::new();
        for backend in [&mut gpu as &mut dyn Backend, &mut cpu] {
            backend.create(slot, &layout).unwrap();
            edit(backend, slot, edits.clone());
            edit(backend, slot, vec![plate.clone()]);
            run(backend, slot, 3, 0.1);
            let wanted = Work { slot, samples: boxes.clone(), ..Work::default() };
            samples.push(work(backend, wanted).samples);
        }
        for (ours, theirs) in samples[0].iter().flatten().zip(samples[1].iter().flatten()) {
            assert_eq!(ours.content, theirs.content);
            let close = |a: f32, b: f32, least: f32| (a - b).abs() <= 2e-3 * b.abs() + least;
            assert!(close(ours.fill, theirs.fill, 1e-5), "{ours:?} {theirs:?}");
            assert!(close(ours.mass, theirs.mass, 1e-3), "{ours:?} {theirs:?}");
            assert!(close(ours.density, theirs.density, 0.1), "{ours:?} {theirs:?}");
            assert!(close(ours.temperature, theirs.temperature, 1e-2), "{ours:?} {theirs:?}");
            assert!(close(ours.hardness, theirs.hardness, 2.0), "{ours:?} {theirs:?}");
            assert!(close(ours.stiffness, theirs.stiffness, 10.0), "{ours:?} {theirs:?}");
            assert!(close(ours.stress, theirs.stress, 0.5), "{ours:?} {theirs:?}");
            assert!(
                close(ours.external_stress, theirs.external_stress, 0.5),
                "{ours:?} {theirs:?}"
            );
            assert!(close(ours.indent, theirs.indent, 1e-4), "{ours:?} {theirs:?}");
        }
        let present: u64 = cells(&mut gpu, slot, &grid)
            .iter()
            .flat_map(|tile| tile.mass.iter().map(|&mass| u64::from(mass)))
            .sum();
        let sampled: f64 = samples[0][0].iter().map(|sample| f64::from(sample.mass)).sum();
        assert!((sampled * firn_snow::MASS_QUANTA / present as f64 - 1.0).abs() < 1e-5);
    }
}

#[test]
fn what_is_restored_goes_on_as_it_was_saved_also_within_the_frame() {
    let Some(mut gpu) = gpu(false) else { return };
    let grid = Grid { width: 17, depth: 12, height: 20, cell_size: 0.2 };
    let cycle = Run { cycles: 1, dt: 0.1 };
    for backend in [&mut gpu as &mut dyn Backend, &mut cpu()] {
        for slot in 0..3 {
            backend.create(slot, &level(grid, Material::default())).unwrap();
        }
        edit(backend, 0, vec![snow(&grid, grid.all(), 3.0, 20.0, -3.0)]);
        let plate = put(&grid, "a", 90.0, Shape::Disk { radius: 0.6 }, 1.5, 1.2);
        edit(backend, 0, vec![plate.clone()]);
        let contacts = run(backend, 0, 7, 0.1).contacts;
        let Edit::PutCollider { collider, .. } = plate else { unreachable!() };
        let saved = Arc::new(Contents {
            tiles: Arc::new(cells(backend, 0, &grid)),
            colliders: contacts.into_iter().map(|(id, c)| (id, collider.clone(), c)).collect(),
        });
        let restore = || vec![Edit::SetMaterial(Material::default()), Edit::Restore(saved.clone())];
        // In a frame of its own, and in the frame of the next cycle.
        edit(backend, 1, restore());
        assert!(cells(backend, 1, &grid) == cells(backend, 0, &grid));
        let once = Work { slot: 2, edits: restore(), run: cycle, wake: true, ..Work::default() };
        work(backend, once);
        for slot in 0..2 {
            work(backend, Work { slot, run: cycle, wake: true, ..Work::default() });
        }
        for slot in 1..3 {
            assert!(cells(backend, slot, &grid) == cells(backend, 0, &grid), "slot {slot}");
        }
    }
}
