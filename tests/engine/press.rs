//! Snow that objects press: the kernel beside its twin, and objects beside what is foretold of them.

use firn_engine::frame::{Backend, Edit, Run, Work, WorkOutcome};
use firn_snow::{
    Column, GRAVITY, Grid, LoadDistribution, Material, Preset, Pressing, Shape, SurfaceLoad,
};

use crate::kernels::LAWS;
use crate::support::*;

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

/// Carries out the same on all cases, each in a slot of its own.
fn all(
    backend: &mut dyn Backend,
    cases: &[Case],
    work: impl Fn(&Case) -> Work,
) -> Vec<WorkOutcome> {
    let work = (0..).zip(cases).map(|(slot, case)| Work { slot, ..work(case) }).collect();
    carry_out(backend, work).work
}

/// The columns in the middle of all cases.
fn columns(backend: &mut dyn Backend, cases: &[Case]) -> Vec<Column> {
    let read = |_: &Case| Work { gather: vec![0], ..Work::default() };
    let outcomes = all(backend, cases, read);
    let middle = |outcome: &WorkOutcome| outcome.gathered[0].column(2 * 8 + 2).collect();
    outcomes.iter().map(|outcome| Column { cells: middle(outcome) }).collect()
}

/// Runs each case until nothing moves in it. Snow that no load reaches goes on creeping for long.
fn settle(backend: &mut dyn Backend, cases: &[Case]) {
    let mut moving: Vec<(u32, &Case)> = (0..).zip(cases).collect();
    while !moving.is_empty() {
        let work = |&(slot, case): &(u32, &Case)| Work {
            slot,
            run: cycles(200),
            pressing: case.pressing,
            ..Work::default()
        };
        let outcomes = carry_out(backend, moving.iter().map(work).collect()).work;
        let still_moves = outcomes.iter().map(|outcome| outcome.last_change == 200);
        let mut still_moves = still_moves.collect::<Vec<_>>().into_iter();
        moving.retain(|_| still_moves.next() == Some(true));
    }
}

/// Has objects do what is foretold of them. Returns by how much the two differ at the most \[m\].
fn compare_cases(backend: &mut dyn Backend, cases: &[Case]) -> f64 {
    for (slot, case) in (0..).zip(cases) {
        backend.create(slot, &level(GRID, case.material)).unwrap();
    }
    let edit = |edit: &Edit| Work { edits: vec![edit.clone()], ..Work::default() };
    all(backend, cases, |case| edit(&case.edits[0]));
    let before = columns(backend, cases);
    all(backend, cases, |case| edit(&case.edits[1]));
    let run = |backend: &mut dyn Backend, count, wake| {
        let work = |case: &Case| {
            let (run, pressing) = (cycles(count), case.pressing);
            Work { run, pressing, wake, publish: true, ..Work::default() }
        };
        all(backend, cases, work)
    };
    let mut largest = 0.0_f64;
    let mut compare = |backend: &mut dyn Backend, foretold: &dyn Fn(&Case, &Column) -> Column| {
        let after = columns(backend, cases);
        for ((case, before), after) in cases.iter().zip(&before).zip(&after) {
            let difference = sunk(before, after) - sunk(before, &foretold(case, before));
            let Case { material, pressing, load, .. } = case;
            assert!(
                difference.abs() < SLACK,
                "{pressing:?}, {:?}: {difference} m, {load:?} on {material:?}",
                backend.device()
            );
            largest = largest.max(difference.abs());
        }
    };
    let mut done = 0;
    for seconds in [0.1, 0.4, 2.0] {
        let count = (seconds / DT).round() as u32;
        run(backend, count - done, done == 0);
        done = count;
        compare(backend, &|case, before| {
            let step = case.pressing.step(DT);
            before.after(&GRID, &case.material, case.load, step, DT as f32, count)
        });
    }
    if cases[0].pressing != Pressing::Creep {
        settle(backend, cases);
        for outcome in run(backend, 10, false) {
            assert_eq!((outcome.last_change, outcome.active_tiles), (0, 0), "it rests");
        }
        compare(backend, &|case, before| {
            before.equilibrium(&GRID, &case.material, case.load, true, DT as f32)
        });
    }
    (0..cases.len() as u32).for_each(|slot| backend.release(slot));
    largest
}

#[test]
fn objects_do_what_is_foretold_of_them_in_every_mode() {
    let (mut gpu, mut cpu) = (gpu(false), cpu());
    let mut dice = Dice::new(32);
    for pressing in MODES {
        let cases: Vec<Case> = (0..200).map(|_| case(&mut dice, pressing)).collect();
        let backends = [Some(&mut cpu as &mut dyn Backend), gpu.as_mut().map(|gpu| gpu as _)];
        for backend in backends.into_iter().flatten() {
            let largest = compare_cases(backend, &cases);
            println!(
                "{pressing:?}, {:?}: up to {largest} m from what is foretold",
                backend.device()
            );
        }
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
