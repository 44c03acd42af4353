//! What the equilibrium of a column foretells is where a real object comes to rest.

use firn_snow::{
    CELL, Column, Cover, Footprint, GRAVITY, Grid, HardnessLaw, LoadDistribution, MASS_QUANTA,
    Material, Position, Pressing, Shape, Snowpack, SurfaceLoad, Turn,
};
use proptest::prelude::*;

const LAWS: [HardnessLaw; 3] =
    [HardnessLaw::Calibrated, HardnessLaw::Regression, HardnessLaw::Gold];
const SPREADS: [LoadDistribution; 3] =
    [LoadDistribution::TwoToOne, LoadDistribution::Uniform, LoadDistribution::Surface];
/// Lengths of a cycle \[s\], from the shortest usual one to the longest there is.
const CYCLES: [f64; 3] = [1.0 / 60.0, 0.05, 0.25];

/// Largest difference \[m\] that is taken for none: where loads sink centimetres to metres, the
/// promise is 1 % or 3 mm.
const SLACK: f64 = 1e-4;

fn grid(cell_size: f64) -> Grid {
    Grid { width: 2, depth: 2, height: 40, cell_size }
}

/// A layer of snow: depth in cells, how dense it is between 20 kg/m³ and the densest, temperature.
type Layer = (f64, f64, f32);

/// Level snow in its layers.
fn snowpack(grid: Grid, material: Material, layers: &[Layer]) -> Snowpack {
    let mut snowpack = Snowpack::new(grid, material, &[], false).unwrap();
    for &(depth, dense, temperature) in layers {
        let density = 20.0 * (material.max_density / 20.0).powf(dense);
        let mass = (depth * grid.cell_size * density * MASS_QUANTA).round() as u32;
        let depth = (depth * f64::from(CELL)).round() as u32;
        snowpack.deposit(grid.all(), depth, mass, temperature);
    }
    snowpack
}

/// Runs until nothing moves.
fn settle(snowpack: &mut Snowpack, dt: f64) {
    while snowpack.run(10_000, dt) == 10_000 {}
}

fn height(column: &Column, grid: &Grid) -> f64 {
    grid.metres(u64::from(column.height()))
}

fn sink(column: &Column, grid: &Grid, material: &Material, load: SurfaceLoad, dt: f64) -> f64 {
    let rest = column.equilibrium(grid, material, load, false, dt as f32);
    height(column, grid) - height(&rest, grid)
}

fn material() -> impl Strategy<Value = Material> {
    (0..3_usize, 0..3_usize, 3.0..4.2, 100.0..550.0, 0.2..2.0).prop_map(
        |(law, spread, stiffness_exponent, max_density, grain_size_mm)| Material {
            hardness_law: LAWS[law],
            load_distribution: SPREADS[spread],
            stiffness_exponent,
            max_density,
            grain_size_mm,
            ..Material::default()
        },
    )
}

fn layers() -> impl Strategy<Value = Vec<Layer>> {
    prop::collection::vec((0.2..6.0, 0.0..0.9, -40.0..0.0_f32), 1..6)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn an_object_on_level_snow_sinks_as_foretold(
        material in material(),
        layers in layers(),
        cell_size in prop::sample::select(vec![0.1, 0.2, 0.4]),
        cycle in 0..3_usize,
        settled in any::<bool>(),
        seconds in prop::option::of(0.0..10.0),
        side in 0.1..1.0,
        magnitude in 1.0..5.0_f64,
    ) {
        let (grid, dt) = (grid(cell_size), CYCLES[cycle]);
        let mut snowpack = snowpack(grid, material, &layers);
        snowpack.set_pressing(seconds.map_or(Pressing::Creep, Pressing::Within));
        if settled {
            settle(&mut snowpack, dt);
        }
        // A plate of up to the whole grid, with 10 Pa to 100 kPa under it.
        let side = side * 2.0 * cell_size;
        let mass = 10_f64.powf(magnitude) * side * side / GRAVITY;
        let shape = Shape::Box { width: side, depth: side };
        let position = Position { x: cell_size, z: cell_size };
        let footprint = Footprint::new(&grid, &shape, position, Turn::NONE);
        let (x, z) = footprint.iter().next().expect("it covers a column");

        let pressure = (mass * GRAVITY / footprint.area) as f32;
        let load = SurfaceLoad { pressure, width: footprint.area.sqrt() as f32 };
        let before = snowpack.column(x, z).clone();
        let presses = seconds.is_some();
        let foretold = before.equilibrium(&grid, &material, load, presses, dt as f32);

        snowpack.put_collider("plate".into(), mass, Cover::default(), vec![footprint], true);
        snowpack.evaluate();
        settle(&mut snowpack, dt);
        let after = snowpack.column(x, z);
        let (foretold, reached) = (height(&foretold, &grid), height(after, &grid));
        prop_assert!(
            (foretold - reached).abs() < SLACK,
            "from {} m: {foretold} m foretold, {reached} m reached",
            height(&before, &grid)
        );
    }
}

#[test]
fn settled_snow_stays_and_fresh_snow_settles_by_itself() {
    let (grid, material) = (grid(0.2), Material::default());
    let mut snowpack = snowpack(grid, material, &[(29.0, 0.0, -3.0)]);
    let nothing = SurfaceLoad { pressure: 0.0, width: 1.0 };
    let settling = sink(snowpack.column(0, 0), &grid, &material, nothing, 0.25);
    let fresh = height(snowpack.column(0, 0), &grid);
    settle(&mut snowpack, 0.25);
    let column = snowpack.column(0, 0);
    assert!((fresh - height(column, &grid) - settling).abs() < SLACK && settling > 1.0);
    assert_eq!(
        column.equilibrium(&grid, &material, nothing, false, 0.25).height(),
        column.height()
    );
    let small = SurfaceLoad { pressure: 1.0, width: 1.0 };
    assert!(sink(column, &grid, &material, small, 0.25) > 0.0, "it only just carries itself");
}

#[test]
fn heavier_and_narrower_loads_sink_deeper_up_to_the_densest_snow() {
    let (grid, material) = (grid(0.2), Material::default());
    let mut snowpack = snowpack(grid, material, &[(29.0, 0.0, -3.0)]);
    settle(&mut snowpack, 0.25);
    let column = snowpack.column(0, 0);
    // The thesis's 100 kg on 16, 1 and 0.1 m².
    let depths = [16.0, 1.0, 0.1].map(|area: f64| {
        let load = SurfaceLoad { pressure: (981.0 / area) as f32, width: area.sqrt() as f32 };
        sink(column, &grid, &material, load, 1.0 / 60.0)
    });
    // After 120 s the model page has 0.05, 0.57 and 1.62 m; the last is still sinking then.
    assert!((depths[0] - 0.05).abs() < 0.01 && (depths[1] - 0.57).abs() < 0.01, "{depths:?}");
    assert!((1.62..1.8).contains(&depths[2]), "{depths:?}");
    let crush = SurfaceLoad { pressure: 1e15, width: 1e3 };
    let left = height(column, &grid) - sink(column, &grid, &material, crush, 0.25);
    let least = 5.8 * 20.0 / 100.0;
    assert!((least..least + 1e-6).contains(&left), "{left} m of {least} m are left");
}

#[test]
fn the_length_of_a_cycle_counts_where_one_presses_snow_past_its_equilibrium() {
    // Light, stiff snow under 17 kPa: one long cycle goes further than short ones ever would.
    let material = Material {
        hardness_law: HardnessLaw::Regression,
        load_distribution: LoadDistribution::Uniform,
        stiffness_exponent: 3.2,
        max_density: 300.0,
        ..Material::default()
    };
    let grid = grid(0.2);
    let column = snowpack(grid, material, &[(20.0, 0.0, -3.0)]).column(0, 0).clone();
    let load = SurfaceLoad { pressure: 17_000.0, width: 1.0 };
    let sunk = |dt| sink(&column, &grid, &material, load, dt);
    assert!(sunk(0.25) > 1.1 * sunk(0.05), "{} {}", sunk(0.25), sunk(0.05));
    assert!((sunk(0.05) - sunk(1.0 / 60.0)).abs() < 0.01 * sunk(0.05));
}

#[test]
fn snow_too_stiff_to_move_a_quantum_rests_above_its_hardness() {
    let stiff = Material { stiffness_exponent: 6.0, ..Material::default() };
    let grid = grid(0.2);
    let mut snowpack = snowpack(grid, stiff, &[(20.0, 0.9, -3.0)]);
    let column = snowpack.column(0, 0).clone();
    let load = SurfaceLoad { pressure: 20_000.0, width: 10.0 };
    assert!(load.pressure > 2.0 * column.surface_hardness(&grid, &stiff).expect("there is snow"));
    assert_eq!(
        column.equilibrium(&grid, &stiff, load, false, 1.0 / 60.0).height(),
        column.height()
    );
    snowpack.put_collider(
        "plate".into(),
        20_000.0 * 0.16 / GRAVITY,
        Cover::default(),
        vec![Footprint::new(
            &grid,
            &Shape::Box { width: 0.4, depth: 0.4 },
            Position { x: 0.2, z: 0.2 },
            Turn::NONE,
        )],
        true,
    );
    assert_eq!(snowpack.run(1000, 1.0 / 60.0), 0, "a real plate moves nothing either");
}

#[test]
fn no_snow_has_no_hardness_and_nowhere_to_sink() {
    let (grid, material) = (grid(0.2), Material::default());
    let load = SurfaceLoad { pressure: 1000.0, width: 1.0 };
    let empty = Column::default();
    assert_eq!(empty.equilibrium(&grid, &material, load, false, 0.25), empty);
    assert_eq!(empty.surface_hardness(&grid, &material), None);
}
