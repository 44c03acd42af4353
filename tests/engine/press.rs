//! Snow that objects press: the kernel beside its twin, and objects beside what is foretold of them.

use firn_engine::frame::{Backend, Edit, Run, Work, WorkOutcome};
use firn_snow::{
    Column, GRAVITY, Grid, HardnessLaw, LoadDistribution, Material, Preset, Pressing, Shape,
    SurfaceLoad,
};

use crate::support::*;

const LAWS: [HardnessLaw; 3] =
    [HardnessLaw::Calibrated, HardnessLaw::Regression, HardnessLaw::Gold];
const SPREADS: [LoadDistribution; 3] =
    [LoadDistribution::TwoToOne, LoadDistribution::Uniform, LoadDistribution::Surface];
const MODES: [Pressing; 4] =
    [Pressing::Creep, Pressing::Within(0.0), Pressing::Within(0.25), Pressing::Within(3.0)];
const DT: f64 = 1.0 / 60.0;
/// Largest difference between what is foretold and what an object does \[m\].
const SLACK: f64 = 0.005;

fn material(dice: &mut Dice) -> Material {
    let max_density = dice.range(100.0, 600.0);
    Material {
        fresh_density: dice.range(20.0, 0.9 * max_density),
        max_density,
        hardness_law: LAWS[dice.below(3) as usize],
        load_distribution: SPREADS[dice.below(3) as usize],
        stiffness_exponent: dice.range(3.0, 4.0),
        grain_size_mm: dice.range(0.2, 10.0),
    }
}

/// Runs cycles in which objects press.
fn press(backend: &mut dyn Backend, pressing: Pressing, run: Run, wake: bool) -> WorkOutcome {
    work(backend, Work { run, pressing, wake, publish: true, ..Work::default() })
}

fn cycles(cycles: u32) -> Run {
    Run { cycles, dt: DT }
}

#[test]
fn cells_are_pressed_as_in_the_reference() {
    let Some(mut gpu) = gpu(false) else { return };
    let (mut cpu, mut dice) = (cpu(), Dice::new(31));
    let (mut largest, mut sunk) = (0.0_f64, 0.0_f64);
    for case in 0..60 {
        let cell_size = [0.05, 0.2, 0.5][dice.below(3) as usize];
        let grid = Grid { width: 13, depth: 9, height: 24, cell_size };
        let (material, pressing) = (material(&mut dice), MODES[1 + dice.below(3) as usize]);
        let mut edits: Vec<Edit> = (0..1 + dice.below(5))
            .map(|_| {
                let depth = cell_size * dice.range(0.3, 4.0);
                let density = dice.range(15.0, 0.9 * material.max_density);
                snow(&grid, grid.all(), depth, density, dice.range(-30.0, 0.0))
            })
            .collect();
        for id in ["a", "b", "c"] {
            let side = cell_size * dice.range(0.3, 5.0);
            let mass = 10_f64.powf(dice.range(1.0, 5.0)) * side * side / GRAVITY;
            let (x, z) = (dice.range(2.6, 10.0) * cell_size, dice.range(2.6, 6.0) * cell_size);
            edits.push(put(&grid, id, mass, Shape::Box { width: side, depth: side }, x, z));
        }
        let mut ends = Vec::new();
        for backend in [&mut gpu as &mut dyn Backend, &mut cpu] {
            backend.create(0, &level(grid, material)).unwrap();
            edit(backend, 0, edits.clone());
            let before = heights(&cells(backend, 0, &grid), &grid);
            press(backend, pressing, cycles(1 + case), true);
            let after = heights(&cells(backend, 0, &grid), &grid);
            backend.release(0);
            ends.push((before, after));
        }
        let (theirs, ours) = (&ends[0], &ends[1]);
        for ((a, b), before) in theirs.1.iter().zip(&ours.1).zip(&ours.0) {
            largest = largest.max((a - b).abs());
            sunk = sunk.max(before - b);
        }
    }
    println!("GPU and CPU differ by up to {largest} m where they sink by up to {sunk} m");
    assert!(largest < 0.001, "{largest} m");
    assert!(sunk > 0.5, "{sunk} m: nothing was pressed");
}

/// A plate on level, uniform snow.
struct Case {
    material: Material,
    pressing: Pressing,
    load: SurfaceLoad,
    edits: [Edit; 2],
}

const GRID: Grid = Grid { width: 5, depth: 5, height: 16, cell_size: 0.2 };

fn case(dice: &mut Dice, pressing: Pressing) -> Case {
    let material = material(dice);
    let depth = dice.range(0.3, 3.0);
    let snow = snow(&GRID, GRID.all(), depth, material.fresh_density, dice.range(-30.0, 0.0));
    let side = dice.range(0.1, 0.95);
    let mass = 10_f64.powf(dice.range(1.5, 5.0)) * side * side / GRAVITY;
    let plate = put(&GRID, "plate", mass, Shape::Box { width: side, depth: side }, 0.5, 0.5);
    let pressure = (mass * GRAVITY / (side * side)) as f32;
    let load = SurfaceLoad { pressure, width: side as f32 };
    Case { material, pressing, load, edits: [snow, plate] }
}

/// The column in the middle.
fn column(backend: &mut dyn Backend) -> Column {
    Column { cells: cells(backend, 0, &GRID)[0].column(2 * 8 + 2).collect() }
}

/// How far a column has given way \[m\].
fn sunk(before: &Column, after: &Column) -> f64 {
    GRID.metres(u64::from(before.height() - after.height()))
}

/// Has an object do what is foretold of it. Returns by how much the two differ at the most \[m\].
fn compare_case(backend: &mut dyn Backend, case: &Case) -> f64 {
    let Case { material, pressing, load, edits } = case;
    backend.create(0, &level(GRID, *material)).unwrap();
    edit(backend, 0, vec![edits[0].clone()]);
    let before = column(backend);
    edit(backend, 0, vec![edits[1].clone()]);
    let (mut done, mut largest) = (0, 0.0_f64);
    for seconds in [0.1, 0.4, 2.0] {
        let count = (seconds / DT).round() as u32;
        press(backend, *pressing, cycles(count - done), done == 0);
        done = count;
        let step = pressing.step(DT);
        let foretold = before.after(&GRID, material, *load, step, DT as f32, count);
        let difference = sunk(&before, &column(backend)) - sunk(&before, &foretold);
        largest = largest.max(difference.abs());
    }
    if *pressing != Pressing::Creep {
        let rest = before.equilibrium(&GRID, material, *load, true, DT as f32);
        while press(backend, *pressing, cycles(60), false).last_change == 60 {}
        let outcome = press(backend, *pressing, cycles(10), false);
        assert_eq!((outcome.last_change, outcome.active_tiles), (0, 0), "it rests");
        let difference = sunk(&before, &column(backend)) - sunk(&before, &rest);
        largest = largest.max(difference.abs());
    }
    backend.release(0);
    largest
}

#[test]
fn objects_do_what_is_foretold_of_them_in_every_mode() {
    for pressing in MODES {
        let (mut gpu, mut cpu) = (gpu(false), cpu());
        let mut dice = Dice::new(32);
        let mut largest = [0.0_f64; 2];
        for number in 0..200 {
            let case = case(&mut dice, pressing);
            let backends = [Some(&mut cpu as &mut dyn Backend), gpu.as_mut().map(|gpu| gpu as _)];
            for (backend, largest) in backends.into_iter().zip(&mut largest) {
                let Some(backend) = backend else { continue };
                let difference = compare_case(backend, &case);
                let Case { material, load, .. } = &case;
                assert!(
                    difference < SLACK,
                    "case {number}, {pressing:?}, {:?}: {difference} m, {load:?} on {material:?}",
                    backend.device()
                );
                *largest = largest.max(difference);
            }
        }
        println!("{pressing:?}: CPU and GPU differ by up to {largest:?} m from what is foretold");
    }
}

#[test]
fn a_foot_is_down_within_a_second_and_then_rests_exactly() {
    for preset in [Preset::Powder, Preset::Packed, Preset::Wet, Preset::Game] {
        let (mut gpu, mut cpu) = (gpu(false), cpu());
        let backends = [Some(&mut cpu as &mut dyn Backend), gpu.as_mut().map(|gpu| gpu as _)];
        for backend in backends.into_iter().flatten() {
            let (material, pressing) = (preset.material(), preset.pressing());
            backend.create(0, &level(GRID, material)).unwrap();
            let density = material.fresh_density;
            let snow = snow(&GRID, GRID.all(), 1.0, density, preset.air_temperature());
            edit(backend, 0, vec![snow]);
            let fresh = column(backend);
            let load =
                SurfaceLoad { pressure: (80.0 * GRAVITY / 0.03) as f32, width: 0.03_f32.sqrt() };
            let rest = fresh.equilibrium(&GRID, &material, load, true, DT as f32);
            let foot = put(&GRID, "foot", 80.0, Shape::Box { width: 0.2, depth: 0.15 }, 0.5, 0.5);
            edit(backend, 0, vec![foot]);
            press(backend, pressing, cycles(60), true);
            let (reached, expected) = (sunk(&fresh, &column(backend)), sunk(&fresh, &rest));
            assert!((reached - expected).abs() < SLACK, "{preset:?}: {reached} {expected}");
            assert_eq!(expected > 0.05, preset != Preset::Packed, "{preset:?}: {expected}");
            let last = press(backend, pressing, cycles(1000), false).last_change;
            assert!(last < 120, "{preset:?}: it moved for {last} cycles more");
            let before = cells(backend, 0, &GRID);
            let outcome = press(backend, pressing, cycles(10), false);
            assert_eq!((outcome.last_change, outcome.active_tiles), (0, 0));
            assert!(outcome.contacts[0].1.resting);
            assert!(cells(backend, 0, &GRID) == before);
        }
    }
}

#[test]
fn another_way_of_pressing_wakes_what_rests() {
    let (mut gpu, mut cpu) = (gpu(false), cpu());
    let backends = [Some(&mut cpu as &mut dyn Backend), gpu.as_mut().map(|gpu| gpu as _)];
    for backend in backends.into_iter().flatten() {
        // So stiff that it does not creep at all.
        let material =
            Material { stiffness_exponent: 6.0, max_density: 300.0, ..Material::default() };
        backend.create(0, &level(GRID, material)).unwrap();
        edit(backend, 0, vec![snow(&GRID, GRID.all(), 2.0, 150.0, -3.0)]);
        let fresh = column(backend);
        edit(backend, 0, vec![put(&GRID, "a", 4000.0, Shape::Disk { radius: 0.2 }, 0.5, 0.5)]);
        let outcome = press(backend, Pressing::Creep, cycles(100), true);
        assert_eq!((outcome.active_tiles, outcome.last_change), (0, 0), "it creeps by no quantum");
        press(backend, Pressing::Within(0.1), cycles(100), true);
        let sunk = sunk(&fresh, &column(backend));
        assert!(sunk > 0.05, "{sunk}");
    }
}
