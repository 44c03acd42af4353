//! Sleep makes no difference to a single bit.

use std::collections::HashMap;

use firn::engine::frame::{Backend, Edit, Run, TileCells, Work};
use firn::snow::{Contact, Grid, Material, Shape};

use crate::support::*;

/// What a snowpack is, bit for bit, and how objects touched it after each run.
type State = (Vec<TileCells>, Vec<Contact>);

/// Where objects stand.
type Standing = HashMap<&'static str, (Shape, f64, f64)>;

fn any_edit(dice: &mut Dice, grid: &Grid, standing: &mut Standing) -> Edit {
    let columns = dice.rect(grid);
    let id = ["a", "b"][dice.below(2) as usize];
    match dice.below(16) {
        0..4 => snow(grid, columns, dice.range(0.01, 0.5), 25.0, -8.0),
        4 | 5 => Edit::Clear { columns, depth: grid.thickness_quanta(dice.range(1.5, 2.5)) as u32 },
        6 => Edit::SetMaterial(Material {
            stiffness_exponent: dice.range(3.2, 3.6),
            ..Material::default()
        }),
        7 | 8 => {
            standing.remove(id);
            Edit::RemoveCollider { id: id.into() }
        }
        kind => {
            let shape = Shape::Box { width: dice.range(0.2, 1.8), depth: dice.range(0.2, 1.8) };
            let place = (shape, dice.range(1.0, 7.4), dice.range(1.0, 5.0));
            // Or another mass is put where it stands.
            let stays = standing.get(id).copied().filter(|_| kind < 12);
            let (shape, x, z) = stays.unwrap_or(place);
            standing.insert(id, (shape, x, z));
            let mut put = put(grid, id, dice.range(10.0, 200.0), shape, x, z);
            if let Edit::PutCollider { placed, .. } = &mut put {
                *placed = stays.is_none();
            }
            put
        }
    }
}

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
    let (mut last_dt, mut standing) = (0.0, Standing::new());
    for _ in 0..14 {
        let mut edits: Vec<Edit> =
            (0..dice.below(6)).map(|_| any_edit(&mut dice, &grid, &mut standing)).collect();
        let dt = if dice.unit() < 0.7 { 0.25 } else { dice.range(0.02, 0.25) };
        // How contacts were found before is told best by runs of few cycles.
        let most = if dice.unit() < 0.5 { 3 } else { 250 };
        let cycles = 1 + dice.below(most);
        let wake = dt != last_dt || edits.iter().any(|edit| matches!(edit, Edit::SetMaterial(_)));
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
        same_wherever_frames_are_cut(&mut cpu(), &mut cpu(), seed);
        let (Some(mut whole), Some(mut cut)) = (gpu(false), gpu(false)) else { return };
        same_wherever_frames_are_cut(&mut whole, &mut cut, seed);
    }
}

fn same_wherever_frames_are_cut(whole: &mut dyn Backend, cut: &mut dyn Backend, seed: u64) {
    let ((cells, contacts), _) = live_through(whole, seed, false);
    let ((cells_cut, contacts_cut), _) = live_through(cut, seed, true);
    let device = whole.device();
    for (i, (whole, cut)) in contacts.iter().zip(&contacts_cut).enumerate() {
        assert_eq!(whole, cut, "{device:?}, seed {seed}, contact {i}");
    }
    assert!(cells == cells_cut, "{device:?}, seed {seed}: the cells differ");
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
