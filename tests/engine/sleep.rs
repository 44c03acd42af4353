//! Sleep makes no difference to a single bit.

use firn::engine::frame::{Backend, Edit, Run, TileCells, Work};
use firn::snow::{Contact, Grid, Material, Shape};

use crate::support::*;

/// What a snowpack is, bit for bit, and how objects touched it after each run.
type State = (Vec<TileCells>, Vec<Contact>);

/// Has a snowpack live through a story of its seed. Where frames are `cut`, there is one for each
/// edit, and two for each run, with another between them that has nothing to do but to evaluate.
/// Returns the state in the end, and how many tiles slept.
fn live_through(backend: &mut dyn Backend, seed: u64, cut: bool) -> (State, u32) {
    let mut dice = Dice::new(seed);
    let grid = Grid { width: 42, depth: 30, height: 30, cell_size: 0.2 };
    let material = Material::default();
    backend.create(0, &level(grid, material)).unwrap();
    edit(backend, 0, vec![snow(&grid, grid.all(), 2.5, 20.0, -3.0)]);
    let (mut slept, mut contacts) = (0, Vec::new());
    let mut last_dt = 0.0;
    for _ in 0..14 {
        let mut edits = Vec::new();
        if dice.unit() < 0.3 {
            edits.push(snow(&grid, dice.rect(&grid), dice.range(0.01, 0.5), 25.0, -8.0));
        }
        if dice.unit() < 0.7 {
            let (x, z) = (dice.range(1.0, 7.4), dice.range(1.0, 5.0));
            let shape = Shape::Box { width: dice.range(0.2, 1.8), depth: dice.range(0.2, 1.8) };
            let id = if dice.unit() < 0.5 { "a" } else { "b" };
            edits.push(put(&grid, id, dice.range(10.0, 200.0), shape, x, z));
        } else {
            edits.push(Edit::RemoveCollider { id: "a".into() });
        }
        let dt = if dice.unit() < 0.7 { 0.25 } else { dice.range(0.02, 0.25) };
        // How contacts were found before is told best by runs of few cycles.
        let most = if dice.unit() < 0.5 { 3 } else { 250 };
        let cycles = 1 + dice.below(most);
        let wake = dt != last_dt;
        last_dt = dt;
        let mut first = 0;
        if cut {
            let idle = || vec![Edit::RemoveCollider { id: "nobody".into() }];
            for one in edits.drain(..) {
                edit(backend, 0, vec![one]);
            }
            first = Dice::new(seed + u64::from(cycles)).below(cycles);
            let run = Run { cycles: first, dt };
            work(backend, Work { slot: 0, edits: idle(), wake, run, ..Work::default() });
            edit(backend, 0, idle());
        }
        let run = Run { cycles: cycles - first, dt };
        let outcome =
            work(backend, Work { slot: 0, edits, wake, run, publish: true, ..Work::default() });
        slept += grid.tiles() - outcome.active_tiles;
        contacts.extend(outcome.contacts.into_iter().map(|(_, contact)| contact));
    }
    ((cells(backend, 0, &grid), contacts), slept)
}

#[test]
fn the_whole_state_is_the_same_with_sleep_and_without() {
    for seed in 0..3 {
        let (Some(mut sleeping), Some(mut awake)) = (gpu(false), gpu(true)) else { return };
        let (ours, slept) = live_through(&mut sleeping, seed, false);
        let (theirs, _) = live_through(&mut awake, seed, false);
        assert!(slept > 0, "no tile ever slept: the test shows nothing");
        assert!(ours == theirs, "seed {seed}: the states differ");
    }
}

#[test]
fn the_whole_state_is_the_same_wherever_frames_are_cut() {
    for seed in 0..6 {
        let (whole, _) = live_through(&mut cpu(), seed, false);
        let (cut, _) = live_through(&mut cpu(), seed, true);
        assert!(whole.1 == cut.1, "seed {seed}, reference: {:#?}, cut {:#?}", whole.1, cut.1);
        assert!(whole.0 == cut.0, "seed {seed}, reference: the cells differ");
        let (Some(mut one), Some(mut another)) = (gpu(false), gpu(false)) else { return };
        let (whole, _) = live_through(&mut one, seed, false);
        let (cut, _) = live_through(&mut another, seed, true);
        assert!(whole.1 == cut.1, "seed {seed}: {:#?}, cut {:#?}", whole.1, cut.1);
        assert!(whole.0 == cut.0, "seed {seed}: the cells differ");
    }
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
