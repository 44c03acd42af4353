//! Whole snowpacks with objects on them: force balance, and sleep that changes nothing.

use std::sync::Arc;

use firn_snow::{
    CELL, Cell, ColumnRect, Contact, Cover, Elevation, Footprint, GRAVITY, Grid, Material,
    Position, Pressing, Shape, Snowpack, Turn, share,
};
use proptest::prelude::*;

/// A small snowpack of six tiles, those at the edges partly covered.
fn grid() -> Grid {
    Grid { width: 20, depth: 11, height: 8, cell_size: 0.2 }
}

/// Ground that rises by up to half a cell.
fn ground() -> Vec<f64> {
    (0..grid().columns()).map(|i| -14_000.0 + 0.001 * (i * 7919 % 100) as f64).collect()
}

fn rect() -> impl Strategy<Value = ColumnRect> {
    (0..20_u32, 0..11_u32, 1..20_u32, 1..11_u32).prop_map(|(x0, z0, width, depth)| ColumnRect {
        x0,
        z0,
        x1: (x0 + width).min(20),
        z1: (z0 + depth).min(11),
    })
}

fn fall() -> impl Strategy<Value = (ColumnRect, f64, f32)> {
    (rect(), 0.01..4.0, -15.0..0.0_f32)
}

/// Shape and position of an object, as parts of the room that there is for it.
fn place() -> impl Strategy<Value = (bool, f64, f64, f64, f64)> {
    (any::<bool>(), 0.05..1.5, 0.05..1.5, 0.0..1.0, 0.0..1.0)
}

fn footprint((disk, width, depth, x, z): (bool, f64, f64, f64, f64)) -> Footprint {
    let shape =
        if disk { Shape::Disk { radius: width / 2.0 } } else { Shape::Box { width, depth } };
    let reach = shape.reach(Turn::NONE);
    let (half_x, half_z) = (reach.x1, reach.z1);
    let within = |half: f64, extent: f64, part: f64| half + part * (extent - 2.0 * half);
    let position = Position { x: within(half_x, 4.0, x), z: within(half_z, 2.2, z) };
    Footprint::new(&grid(), &shape, position, Turn::NONE)
}

/// Snow of 20 kg/m³ and a depth in cells.
fn snow(snowpack: &mut Snowpack, rect: ColumnRect, depth: f64, temperature: f32) -> u64 {
    let mass = (depth * 4.0 * f64::from(1 << 18)).round() as u32;
    snowpack.deposit(rect, (depth * f64::from(CELL)).round() as u32, mass, temperature)
}

/// A snowpack with an object on it that sinks.
fn laden(always_awake: bool) -> Snowpack {
    let mut snowpack = Snowpack::new(grid(), Material::default(), &ground(), always_awake).unwrap();
    snow(&mut snowpack, grid().all(), 6.0, -3.0);
    snowpack.put_collider(
        "sinks".into(),
        200.0,
        Cover::default(),
        vec![footprint((true, 1.0, 1.0, 0.5, 0.5))],
        true,
    );
    snowpack
}

/// What is done to a snowpack.
#[derive(Clone, Debug)]
enum Step {
    Snow((ColumnRect, f64, f32)),
    Clear(ColumnRect, u32),
    Put { id: u8, mass: f64, place: (bool, f64, f64, f64, f64), placed: bool },
    Remove(u8),
    Stiffness(f64),
    Pressing(Pressing),
    Run { cycles: u32, dt: f64 },
}

fn step() -> impl Strategy<Value = Step> {
    let put = (0..4_u8, 1.0..3000.0, place(), any::<bool>())
        .prop_map(|(id, mass, place, placed)| Step::Put { id, mass, place, placed });
    prop_oneof![
        3 => fall().prop_map(Step::Snow),
        1 => (rect(), 0..4 * CELL).prop_map(|(rect, depth)| Step::Clear(rect, depth)),
        3 => put,
        1 => (0..4_u8).prop_map(Step::Remove),
        1 => (3.0..5.0).prop_map(Step::Stiffness),
        1 => (any::<bool>(), 0.0..10.0).prop_map(|(creeps, seconds)| {
            Step::Pressing(if creeps { Pressing::Creep } else { Pressing::Within(seconds) })
        }),
        4 => (1..400_u32, prop::sample::select(vec![1.0 / 60.0, 0.25]))
            .prop_map(|(cycles, dt)| Step::Run { cycles, dt }),
    ]
}

/// Takes a step and returns everything that can be seen of it.
fn take(snowpack: &mut Snowpack, step: &Step) -> (u64, u32, Vec<(Arc<str>, Contact)>) {
    let (mut quanta, mut last) = (0, 0);
    match *step {
        Step::Snow((rect, depth, temperature)) => quanta = snow(snowpack, rect, depth, temperature),
        Step::Clear(rect, depth) => quanta = snowpack.clear(rect, depth),
        Step::Put { id, mass, place, placed } => {
            snowpack.put_collider(
                id.to_string().into(),
                mass,
                Cover::default(),
                vec![footprint(place)],
                placed,
            );
        }
        Step::Remove(id) => snowpack.remove_collider(&id.to_string()),
        Step::Stiffness(stiffness_exponent) => {
            snowpack.set_material(Material { stiffness_exponent, ..Material::default() });
        }
        Step::Pressing(pressing) => snowpack.set_pressing(pressing),
        Step::Run { cycles, dt } => last = snowpack.run(cycles, dt),
    }
    if !matches!(step, Step::Run { .. }) {
        snowpack.evaluate();
    }
    let contacts = snowpack.contacts().map(|(id, contact)| (id.clone(), *contact)).collect();
    (quanta, last, contacts)
}

/// The bits of all cells.
fn bits(snowpack: &Snowpack) -> Vec<[u32; 4]> {
    let tiles = (0..grid().tiles()).flat_map(|tile| snowpack.tile(tile).expect("a tile"));
    tiles
        .flat_map(|column| &column.cells)
        .map(|c: &Cell| [c.mass, c.thickness, c.temperature.to_bits(), c.stress.to_bits()])
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn what_stands_on_the_snow_is_carried(
        falls in prop::collection::vec(fall(), 1..8),
        mass in 1.0..5000.0,
        place in place(),
    ) {
        let mut snowpack = Snowpack::new(grid(), Material::default(), &ground(), false).unwrap();
        for (rect, depth, temperature) in falls {
            snow(&mut snowpack, rect, depth, temperature);
        }
        let footprint = footprint(place);
        snowpack.put_collider("a".into(), mass, Cover::default(), vec![footprint.clone()], true);
        snowpack.evaluate();
        let contact = *snowpack.contacts().next().expect("it is there").1;
        let carried: f64 = footprint
            .iter()
            .map(|(x, z)| {
                let ground = ground()[(z * grid().width + x) as usize];
                let surface = Elevation::new(&grid(), ground).under(snowpack.column(x, z).height());
                let stress = contact.pressure * share(contact.bottom, surface);
                f64::from(stress) * footprint.area / f64::from(footprint.columns)
            })
            .sum();
        prop_assert!((carried / (mass * GRAVITY) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn sleep_changes_nothing(steps in prop::collection::vec(step(), 1..14)) {
        let (mut sleepy, mut awake) = (laden(false), laden(true));
        for step in &steps {
            prop_assert_eq!(take(&mut sleepy, step), take(&mut awake, step));
            prop_assert_eq!(bits(&sleepy), bits(&awake));
            prop_assert_eq!(sleepy.active_tiles(), awake.active_tiles());
            prop_assert!(sleepy.take_dirty().eq(awake.take_dirty()));
        }
    }

    #[test]
    fn runs_may_be_split_anywhere(
        steps in prop::collection::vec(step(), 1..8),
        at in 1..400_u32,
    ) {
        let mut whole = laden(false);
        let mut parts = whole.clone();
        for step in &steps {
            let seen = take(&mut whole, step);
            if let Step::Run { cycles, dt } = *step {
                let first = at.min(cycles - 1);
                for part in [first, cycles - 1 - first, 1] {
                    // As after edits that changed nothing: it may be done at any time.
                    parts.evaluate();
                    parts.run(part, dt);
                }
            } else {
                take(&mut parts, step);
            }
            let contacts: Vec<_> = parts.contacts().map(|(id, c)| (id.clone(), *c)).collect();
            prop_assert_eq!(seen.2, contacts);
            prop_assert_eq!(bits(&whole), bits(&parts));
            prop_assert_eq!(whole.active_tiles(), parts.active_tiles());
        }
    }
}

#[test]
fn a_snowpack_falls_asleep_and_wakes_where_it_is_touched() {
    let mut snowpack = Snowpack::new(grid(), Material::default(), &[], false).unwrap();
    snow(&mut snowpack, grid().all(), 8.0, -3.0);
    assert_eq!(snowpack.active_tiles(), 6);
    let place = |x| vec![footprint((false, 0.6, 0.6, x, 0.0))];
    snowpack.put_collider("a".into(), 50.0, Cover::default(), place(0.0), true);
    assert!(snowpack.run(100, 0.25) == 100, "the plate sinks");
    assert_eq!(snowpack.active_tiles(), 1);
    let last = (0..200).map(|_| snowpack.run(1000, 0.25)).find(|&last| last < 1000);
    assert!(last.is_some_and(|last| last > 0), "it comes to rest in the course of a run");
    assert_eq!(snowpack.active_tiles(), 0);
    assert_eq!(snowpack.run(1000, 0.25), 0);
    assert!(snowpack.contacts().all(|(_, contact)| contact.resting));

    snowpack.put_collider("a".into(), 50.0, Cover::default(), place(1.0), true);
    snowpack.evaluate();
    assert_eq!(snowpack.active_tiles(), 2, "the tile that it left and the one it came to");
    snowpack.remove_collider("a");
    snowpack.run(1, 0.25);
    assert_eq!(snowpack.active_tiles(), 0, "unloaded snow does not spring back");
    assert!(snowpack.contacts().next().is_none());
}

#[test]
fn what_rests_in_short_cycles_is_woken_for_longer_ones() {
    let mut snowpack = Snowpack::new(grid(), Material::default(), &[], false).unwrap();
    snow(&mut snowpack, grid().all(), 8.0, 0.0);
    assert_eq!(snowpack.run(10, 1e-9), 0, "an indent below a quantum is none");
    assert_eq!(snowpack.active_tiles(), 0);
    assert_eq!(snowpack.run(10, 0.25), 10);
    let last = snowpack.run(100_000, 0.25);
    assert!(last < 100_000, "it comes to rest in the course of a run");
    assert_eq!(snowpack.active_tiles(), 0);
}
