//! Work that is too much for one frame comes to the same as if it had been done in one.

use firn_engine::frame::{Backend, Layout, Work};
use firn_snow::{Grid, Material};

use crate::story::{Frames, Plot, live_through};
use crate::support::*;

#[test]
fn work_in_parts_is_the_same_to_the_last_bit() {
    for seed in 0..6 {
        same_in_parts(&mut cpu(), &mut cpu(), seed);
        let (Some(mut whole), Some(mut parted)) = (gpu(false), gpu(false)) else { return };
        same_in_parts(&mut whole, &mut parted, seed);
    }
}

fn same_in_parts(whole: &mut dyn Backend, parted: &mut dyn Backend, seed: u64) {
    let plot = Plot { seed, restores: true };
    let ours = live_through(parted, plot, Frames::Parted);
    let theirs = live_through(whole, plot, Frames::Whole);
    let device = whole.device();
    assert!(ours.unfinished > 50, "{device:?}, seed {seed}: nothing was parted");
    for (i, (parted, whole)) in ours.told.iter().zip(&theirs.told).enumerate() {
        assert_eq!(parted.edits, whole.edits, "{device:?}, seed {seed}, run {i}");
        assert_eq!(parted.last_change, whole.last_change, "{device:?}, seed {seed}, run {i}");
        assert_eq!(parted.mass, whole.mass, "{device:?}, seed {seed}, run {i}");
        assert_eq!(parted.contacts, whole.contacts, "{device:?}, seed {seed}, run {i}");
        assert!(parted == whole, "{device:?}, seed {seed}, run {i}: cells or samples differ");
    }
    assert!(ours.cells == theirs.cells, "{device:?}, seed {seed}: the cells differ");
}

/// Memory that others have had, memory that nobody has had, and rubbish in both.
#[test]
fn memory_is_cleared_in_parts_before_anything_else() {
    let Some(mut gpu) = gpu(false) else { return };
    let grid = Grid { width: 156, depth: 160, height: 100, cell_size: 0.2 };
    let small = Grid { width: 8, depth: 8, height: 4, cell_size: 0.2 };
    let layout = |grid: Grid| Layout {
        grid,
        material: Material::default(),
        ground: (0..grid.columns()).map(|i| 0.001 * i as f64).collect(),
        surface: None,
    };
    gpu.create(7, &layout(small)).unwrap();
    edit(&mut gpu, 7, vec![snow(&small, small.all(), 0.5, 20.0, -3.0)]);
    for _ in 0..2 {
        gpu.poison();
        let made = gpu.maker().make(layout(grid)).unwrap();
        let units = gpu.take_in(0, made).unwrap();
        assert!(units > 64 * u64::from(grid.tiles() * grid.height), "{units}");
        let all = Work {
            slot: 0,
            publish: true,
            tally: true,
            gather: (0..grid.tiles()).collect(),
            edits: vec![snow(&grid, grid.all(), 0.3, 20.0, -3.0)],
            ..Work::default()
        };
        let mut frames = 1;
        let mut outcome = work(&mut gpu, Work { limit: Some(units / 20), ..all });
        while outcome.unfinished {
            frames += 1;
            outcome = work(&mut gpu, Work::resume(0, true, Some(units / 20)));
            // Others have their frames in between.
            edit(&mut gpu, 7, vec![snow(&small, small.all(), 0.001, 20.0, -3.0)]);
        }
        assert!(frames > 20, "{frames}");
        let mut reference = cpu();
        reference.create(0, &layout(grid)).unwrap();
        edit(&mut reference, 0, vec![snow(&grid, grid.all(), 0.3, 20.0, -3.0)]);
        assert!(outcome.gathered == cells(&mut reference, 0, &grid));
        gpu.release(0);
    }
}
