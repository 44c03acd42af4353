//! The arena's memory: what is taken is given back, and nothing of one snowpack shows in another.

use firn_engine::frame::{Backend, EngineError, Run, Work};
use firn_engine::gpu::GpuBackend;
use firn_snow::{Grid, Material, Shape};

use crate::support::*;

#[test]
fn snowpacks_of_all_sizes_come_and_go_and_leave_the_arena_empty() {
    let Some(mut gpu) = gpu(false) else { return };
    let mut dice = Dice::new(7);
    let mut alive: Vec<(u32, Grid)> = Vec::new();
    let empty = gpu.memory();
    for slot in 0..50 {
        let grid = Grid {
            width: if slot == 0 { 1 } else { 1 + dice.below(130) },
            depth: if slot == 0 { 1 } else { 1 + dice.below(70) },
            height: 1 + dice.below(60),
            cell_size: 0.2,
        };
        gpu.create(slot, &level(grid, Material::default())).unwrap();
        let depth = 0.2 * f64::from(grid.height) * 0.8;
        let edits = vec![snow(&grid, grid.all(), depth, 20.0, -3.0)];
        let run = Run { cycles: 20, dt: 0.1 };
        work(&mut gpu, Work { slot, edits, run, wake: true, publish: true, ..Work::default() });
        alive.push((slot, grid));
        if dice.unit() < 0.5 {
            let victim = alive.swap_remove(dice.below(alive.len() as u32) as usize);
            gpu.release(victim.0);
        }
    }
    // All that are left are stepped together, in one frame.
    let run = Run { cycles: 5, dt: 0.1 };
    let together =
        alive.iter().map(|&(slot, _)| Work { slot, run, tally: true, ..Work::default() }).collect();
    let outcome = carry_out(&mut gpu, together);
    for (work, (slot, grid)) in outcome.work.iter().zip(&alive) {
        let depth = 0.2 * f64::from(grid.height) * 0.8;
        let mass = (depth * 20.0 * firn_snow::MASS_QUANTA).round() as u64;
        assert_eq!((work.slot, work.mass), (*slot, mass * grid.columns()));
    }
    while !alive.is_empty() {
        let victim = alive.swap_remove(dice.below(alive.len() as u32) as usize);
        gpu.release(victim.0);
    }
    assert_eq!(gpu.memory(), empty);
}

#[test]
fn a_snowpack_never_sees_what_lay_in_its_memory_before() {
    let (Some(mut clean), Some(mut poisoned)) = (gpu(false), gpu(false)) else { return };
    let grid = Grid { width: 21, depth: 19, height: 14, cell_size: 0.2 };
    let mut states = Vec::new();
    for (gpu, poison) in [(&mut clean as &mut GpuBackend, false), (&mut poisoned, true)] {
        // The first keeps the page alive; the second one's place is used again.
        for slot in [0, 1] {
            gpu.create(slot, &level(grid, Material::default())).unwrap();
            edit(gpu, slot, vec![snow(&grid, grid.all(), 2.7, 90.0, -30.0)]);
            let shape = Shape::Disk { radius: 0.7 };
            edit(gpu, slot, vec![put(&grid, "a", 500.0, shape, 2.0, 2.0)]);
            run(gpu, slot, 50, 0.25);
        }
        gpu.release(1);
        if poison {
            gpu.poison();
        }
        gpu.create(1, &level(grid, Material::default())).unwrap();
        let empty = cells(gpu, 1, &grid);
        assert!(empty.iter().all(|tile| tile.mass.iter().all(|&mass| mass == 0)));
        edit(gpu, 1, vec![snow(&grid, grid.all(), 1.1, 20.0, -3.0)]);
        edit(gpu, 1, vec![put(&grid, "b", 80.0, Shape::Disk { radius: 0.5 }, 2.0, 2.0)]);
        let contacts = run(gpu, 1, 100, 0.25).contacts;
        states.push((cells(gpu, 1, &grid), contacts));
    }
    assert!(states[0] == states[1]);
}

#[test]
fn what_does_not_fit_is_refused_and_the_rest_lives_on() {
    if gpu(false).is_none() {
        return;
    }
    let budget = 64 << 20;
    let mut gpu = GpuBackend::new(Some(budget), false).unwrap();
    let small = Grid { width: 16, depth: 16, height: 10, cell_size: 0.2 };
    let large = Grid { width: 512, depth: 512, height: 50, cell_size: 0.2 };
    gpu.create(0, &level(small, Material::default())).unwrap();
    let held = gpu.memory();
    for slot in 1..4 {
        let refused = gpu.create(slot, &level(large, Material::default()));
        assert!(matches!(refused, Err(EngineError::OutOfMemory(_))), "{refused:?}");
        assert_eq!(gpu.memory(), held);
    }
    edit(&mut gpu, 0, vec![snow(&small, small.all(), 1.0, 20.0, -3.0)]);
    assert!((heights(&cells(&mut gpu, 0, &small), &small)[77] - 1.0).abs() < 1e-6);
}

#[test]
fn a_snowpack_larger_than_a_page_spans_several() {
    let Some(mut gpu) = gpu(false) else { return };
    // Every fourth tile is given back, so that the next snowpack is scattered over the gaps.
    let piece = Grid { width: 8, depth: 8, height: 200, cell_size: 0.1 };
    for slot in 0..40 {
        gpu.create(slot, &level(piece, Material::default())).unwrap();
    }
    for slot in (0..40).step_by(4) {
        gpu.release(slot);
    }
    let grid = Grid { width: 96, depth: 96, height: 100, cell_size: 0.1 };
    let mut cpu = cpu();
    for backend in [&mut gpu as &mut dyn Backend, &mut cpu] {
        backend.create(40, &level(grid, Material::default())).unwrap();
        edit(backend, 40, vec![snow(&grid, grid.all(), 6.0, 20.0, -3.0)]);
        let plate = Shape::Box { width: 6.0, depth: 6.0 };
        edit(backend, 40, vec![put(&grid, "plate", 4000.0, plate, 4.5, 4.5)]);
        run(backend, 40, 20, 0.1);
    }
    let (ours, theirs) = (cells(&mut gpu, 40, &grid), cells(&mut cpu, 40, &grid));
    let apart = heights(&ours, &grid)
        .into_iter()
        .zip(heights(&theirs, &grid))
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    assert!(apart < 1e-4, "{apart} m apart");
}
