//! Prints that loads press at once: the kernel beside its twin.

use firn_engine::frame::Backend;
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
