//! Sleep makes no difference to a single bit.

use firn_engine::frame::{Backend, Work};
use firn_snow::{Grid, Material, Shape};

use crate::story::{Frames, Plot, live_through};
use crate::support::*;

#[test]
fn the_whole_state_is_the_same_with_sleep_and_without() {
    for seed in 0..3 {
        let (Some(mut sleeping), Some(mut awake)) = (gpu(false), gpu(true)) else { return };
        let plot = Plot { seed, restores: false };
        let ours = live_through(&mut sleeping, plot, Frames::Whole);
        let theirs = live_through(&mut awake, plot, Frames::Whole);
        assert!(ours.slept > 0, "no tile ever slept: the test shows nothing");
        assert!(ours.cells == theirs.cells, "seed {seed}: the cells differ");
        assert!(ours.contacts().eq(theirs.contacts()), "seed {seed}: the contacts differ");
    }
}

#[test]
fn the_whole_state_is_the_same_wherever_frames_are_cut() {
    for seed in 0..6 {
        same_wherever_frames_are_cut(&mut cpu(), &mut cpu(), seed);
        let (Some(mut whole), Some(mut cut)) = (gpu(false), gpu(false)) else { return };
        same_wherever_frames_are_cut(&mut whole, &mut cut, seed);
    }
}

fn same_wherever_frames_are_cut(whole: &mut dyn Backend, cut: &mut dyn Backend, seed: u64) {
    let plot = Plot { seed, restores: false };
    let ours = live_through(cut, plot, Frames::Cut);
    let theirs = live_through(whole, plot, Frames::Whole);
    let device = whole.device();
    for (i, (cut, whole)) in ours.contacts().zip(theirs.contacts()).enumerate() {
        assert_eq!(cut, whole, "{device:?}, seed {seed}, contact {i}");
    }
    assert!(ours.cells == theirs.cells, "{device:?}, seed {seed}: the cells differ");
}

#[test]
fn cycles_give_the_same_bits_in_one_dispatch_and_in_many() {
    let (Some(mut at_once), Some(mut one_by_one)) = (gpu(false), gpu(false)) else { return };
    let grid = Grid { width: 20, depth: 20, height: 20, cell_size: 0.2 };
    let mut states = Vec::new();
    for (gpu, portions) in [(&mut at_once, 1), (&mut one_by_one, 300)] {
        gpu.create(0, &level(grid, Material::default())).unwrap();
        edit(gpu, 0, vec![snow(&grid, grid.all(), 3.5, 20.0, -3.0)]);
        for _ in 0..portions {
            run(gpu, 0, 300 / portions, 0.125);
        }
        states.push(cells(gpu, 0, &grid));
    }
    assert!(states[0] == states[1]);
}

#[test]
fn cycles_under_an_object_give_the_same_bits_in_one_frame_and_in_many() {
    // Few tiles are listed by the host, many by the device.
    for side in [20, 200] {
        let grid = Grid { width: side, depth: side, height: 12, cell_size: 0.2 };
        let mut states = Vec::new();
        for (one_by_one, portions) in [(false, 1), (true, 1), (false, 40)] {
            let Some(mut gpu) = gpu(false) else { return };
            gpu.run_one_by_one(one_by_one);
            gpu.create(0, &level(grid, Material::default())).unwrap();
            let shape = Shape::Disk { radius: 0.7 };
            let object = put(&grid, "a", 150.0, shape, 1.9, 1.7);
            edit(&mut gpu, 0, vec![snow(&grid, grid.all(), 2.0, 20.0, -3.0), object]);
            for _ in 0..portions {
                run(&mut gpu, 0, 40 / portions, 0.125);
            }
            let outcome = work(&mut gpu, Work { slot: 0, publish: true, ..Work::default() });
            states.push((cells(&mut gpu, 0, &grid), outcome.contacts));
        }
        assert!(states[0] == states[1], "{side}: cycles of their own");
        assert!(states[0] == states[2], "{side}: frames of their own");
    }
}
