//! Prints that loads press at once: the kernel beside its twin.

use firn_engine::frame::{Backend, Edit, Work};
use firn_snow::{CELL, Grid, LoadDistribution, Material};

use crate::kernels::LAWS;
use crate::support::*;

#[test]
fn columns_are_stamped_as_in_the_reference() {
    let Some(mut gpu) = gpu(false) else { return };
    let mut cpu = cpu();
    let mut dice = Dice::new(11);
    let distributions =
        [LoadDistribution::TwoToOne, LoadDistribution::Uniform, LoadDistribution::Surface];
    let cases = LAWS.into_iter().flat_map(|law| distributions.map(|spread| (law, spread)));
    let mut pressed = 0;
    for (slot, (hardness_law, load_distribution)) in (0..).zip(cases) {
        let grid = Grid { width: 30, depth: 21, height: 20, cell_size: 0.1 };
        let material =
            Material { hardness_law, load_distribution, max_density: 300.0, ..Material::default() };
        gpu.create(slot, &level(grid, material)).unwrap();
        cpu.create(slot, &level(grid, material)).unwrap();
        let mut edits = Vec::new();
        for _ in 0..4 {
            let (density, celsius) = (dice.range(20.0, 200.0), dice.range(-15.0, -1.0));
            edits.push(snow(&grid, grid.all(), dice.range(0.05, 0.4), density, celsius));
            edits.extend((0..6).map(|_| any_stamp(&mut dice, &grid)));
        }
        let (ours, theirs) = (edit(&mut gpu, slot, edits.clone()), edit(&mut cpu, slot, edits));
        let millimetre = grid.thickness_quanta(0.001);
        for (a, b) in ours.edits.iter().zip(&theirs.edits) {
            assert!(a.abs_diff(*b) <= millimetre, "{hardness_law:?} {load_distribution:?} {a} {b}");
        }
        pressed += theirs.edits.iter().sum::<u64>();
        let cells_apart = compare(&cells(&mut gpu, slot, &grid), &cells(&mut cpu, slot, &grid));
        assert_eq!(cells_apart.mass, 0);
        assert!(u64::from(cells_apart.thickness) <= millimetre, "{cells_apart:?}");
    }
    assert!(pressed > u64::from(CELL) * 10, "a metre of dents in all");
}

#[test]
fn a_batch_presses_as_its_stamps_do_one_after_another() {
    let backends =
        [Some(Box::new(cpu()) as Box<dyn Backend>), gpu(false).map(|it| Box::new(it) as _)];
    for mut backend in backends.into_iter().flatten() {
        let mut dice = Dice::new(12);
        let grid = Grid { width: 61, depth: 45, height: 20, cell_size: 0.1 };
        let material = Material { max_density: 300.0, ..Material::default() };
        let snow = snow(&grid, grid.all(), 0.73, 40.0, -5.0);
        let stamps: Vec<Edit> = (0..300).map(|_| any_stamp(&mut dice, &grid)).collect();
        (0..3).for_each(|slot| backend.create(slot, &level(grid, material)).unwrap());
        (0..3).for_each(|slot| drop(edit(&mut *backend, slot, vec![snow.clone()])));
        let one = |stamp: &Edit| edit(&mut *backend, 0, vec![stamp.clone()]).edits[0];
        let one_by_one: Vec<u64> = stamps.iter().map(one).collect();
        let at_once = edit(&mut *backend, 1, stamps.clone());
        assert_eq!(at_once.edits, one_by_one);
        let limit = Some(20_000);
        let mut parted =
            work(&mut *backend, Work { slot: 2, edits: stamps, limit, ..Work::default() });
        let mut frames = 1;
        while parted.unfinished {
            parted = work(&mut *backend, Work::resume(2, true, limit));
            frames += 1;
        }
        assert!((5..100).contains(&frames), "{frames}");
        assert_eq!(parted.edits, one_by_one);
        let all = cells(&mut *backend, 0, &grid);
        assert!(all == cells(&mut *backend, 1, &grid), "{:?}", backend.device());
        assert!(all == cells(&mut *backend, 2, &grid), "{:?}", backend.device());
    }
}
