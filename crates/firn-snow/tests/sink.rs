//! How deep objects sink into alpine snow: by the answers of an independent program, and alike by every way there is.

use firn_snow::{
    CELL, Cell, Column, Cover, Coverage, Footprint, GRAVITY, Grid, HardnessLaw, MASS_QUANTA,
    Material, Position, Pressing, Shape, Snowpack, SurfaceLoad, Turn, alpine,
};
use proptest::prelude::*;
use serde_json::Value;

const GOLDEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/golden/alpine/sink.json");

const MATERIAL: Material = Material {
    fresh_density: 20.0,
    max_density: 100.0,
    stiffness_exponent: 3.56,
    hardness_law: HardnessLaw::Alpine,
    grain_size_mm: 0.5,
    load_distribution: firn_snow::LoadDistribution::TwoToOne,
};

/// Largest difference \[m\] from the independent program, which lets no snow get wetter when it is pressed.
const GOLDEN_SLACK: f64 = 0.005;

/// Largest difference \[m\] of an object at rest from what is foretold, and of a stamp: a cell rests where it would
/// lose less than 1/16384 of its thickness.
const SLACK: f64 = 2e-4;

/// Length of a cycle \[s\].
const CYCLE: f64 = 1.0 / 60.0;

/// An object: its name, width and depth \[m\], and its mass \[kg\].
const OBJECTS: [(&str, [f64; 2], f64); 4] = [
    ("boot_80kg", [0.1, 0.25], 80.0),
    ("ski_80kg", [0.1, 1.7], 80.0),
    ("snowshoe_80kg", [0.3, 0.4], 80.0),
    ("tyre_150kPa", [0.2, 0.25], 150e3 * 0.05 / GRAVITY),
];

fn grid(cell_size: f64) -> Grid {
    Grid { width: 8, depth: 40, height: 60, cell_size }
}

/// A cell of mass and water \[kg/m²\], a thickness \[m\] and a temperature \[°C\].
fn cell(grid: &Grid, [mass, water, thickness, celsius]: [f64; 4]) -> Cell {
    let quanta = |kilograms: f64| (kilograms * MASS_QUANTA).round() as u32;
    let thickness = grid.thickness_quanta(thickness) as u32;
    let mut cell = Cell { mass: quanta(mass), thickness, ..Cell::default() };
    cell.set_heat(celsius as f32, quanta(water));
    cell
}

fn height(grid: &Grid, column: &Column) -> f64 {
    grid.metres(column.height().into())
}

fn footprint(grid: &Grid, [width, depth]: [f64; 2]) -> Footprint {
    let middle = |columns: u32| grid.cell_size * f64::from(columns) / 2.0;
    let position = Position { x: middle(grid.width), z: middle(grid.depth) };
    Footprint::new(grid, &Shape::Box { width, depth }, position, Turn::NONE)
}

fn load(footprint: &Footprint, mass: f64) -> SurfaceLoad {
    let pressure = (mass * GRAVITY / footprint.area) as f32;
    SurfaceLoad { pressure, width: footprint.area.sqrt() as f32 }
}

/// Level snow, all of whose columns are like one.
fn level(grid: Grid, column: &Column) -> Snowpack {
    let mut snowpack = Snowpack::new(grid, MATERIAL, &[], false).unwrap();
    let mut column = column.clone();
    column.stress(&grid, &MATERIAL, &[]);
    for tile in 0..grid.tiles() {
        snowpack.restore_tile(tile, std::iter::repeat_n(column.clone(), 64), &[]);
    }
    snowpack.set_pressing(Pressing::Within(0.25));
    snowpack.evaluate();
    snowpack
}

/// Puts an object on level snow, and waits until nothing moves. Returns how deep it is then, and the cycles that took.
fn stand(snowpack: &mut Snowpack, footprint: &Footprint, mass: f64) -> (f64, u32) {
    let grid = *snowpack.grid();
    let (x, z) = footprint.iter().next().unwrap();
    let before = height(&grid, snowpack.column(x, z));
    snowpack.put_collider("it".into(), mass, Cover::default(), vec![footprint.clone()], true);
    let cycles = snowpack.run(10_000, CYCLE);
    assert!(cycles < 2000, "{cycles}");
    assert_eq!((snowpack.run(10, CYCLE), snowpack.active_tiles()), (0, 0), "it is at rest");
    (before - height(&grid, snowpack.column(x, z)), cycles)
}

fn foretold(grid: &Grid, column: &Column, load: SurfaceLoad) -> f64 {
    let rest = column.equilibrium(grid, &MATERIAL, load, true, CYCLE as f32);
    height(grid, column) - height(grid, &rest)
}

#[test]
fn objects_sink_as_deep_as_an_independent_program_has_it() {
    let text = std::fs::read_to_string(GOLDEN).unwrap();
    let profiles: Vec<Value> = serde_json::from_str(&text).unwrap();
    assert_eq!(profiles.len(), 4);
    for profile in profiles {
        let grid = grid(profile["cell_size"].as_f64().unwrap());
        let fields = ["mass", "water", "thickness", "temperature"];
        let layers = profile["layers_bottom_up"].as_array().unwrap().iter();
        let cells = layers.map(|layer| cell(&grid, fields.map(|it| layer[it].as_f64().unwrap())));
        let column = Column { cells: cells.collect() };
        let snowpack = level(grid, &column);
        for (object, sides, mass) in OBJECTS {
            let expected = profile["sink"][object].as_f64().unwrap();
            let footprint = footprint(&grid, sides);
            let promised = foretold(&grid, &column, load(&footprint, mass));
            let (reached, cycles) = stand(&mut snowpack.clone(), &footprint, mass);
            println!(
                "{object}: {expected} m, {promised:.4} m foretold, {reached:.4} m in {cycles} cycles"
            );
            assert!((promised - expected).abs() < GOLDEN_SLACK, "{object} {}", profile["what"]);
            assert!((reached - expected).abs() < GOLDEN_SLACK, "{object} {}", profile["what"]);
        }
    }
}

/// Cells of any density, temperature and water, in a grid of a cell size.
fn column(cell_size: f64) -> impl Strategy<Value = Column> {
    let layer = (0.001..1.0, 2.0..6.5, -30.0..0.0, prop_oneof![Just(0.0), 1e-6..0.4]);
    prop::collection::vec(layer, 1..30).prop_map(move |layers| {
        let cells =
            layers.into_iter().map(|(thickness, density, celsius, water): (f64, f64, _, f64)| {
                let thickness = thickness * cell_size;
                let mass = density.exp() * thickness;
                cell(&grid(cell_size), [mass, water * mass, thickness, celsius])
            });
        Column { cells: cells.collect() }
    })
}

/// A cell size, a column, a side in cells and a pressure \[Pa\] as a power of 10.
fn case() -> impl Strategy<Value = (f64, Column, u32, f64)> {
    prop::sample::select(&[0.02, 0.05, 0.2, 0.5][..])
        .prop_flat_map(|size| (Just(size), column(size), 1..9_u32, 1.0..6.0_f64))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn objects_stamps_and_probes_agree((cell_size, column, side, power) in case()) {
        let grid = grid(cell_size);
        let side = f64::from(side) * cell_size;
        let footprint = footprint(&grid, [side, side]);
        let mass = 10_f64.powf(power) * footprint.area / GRAVITY;
        let load = load(&footprint, mass);
        let promised = foretold(&grid, &column, load);
        let slack = SLACK * height(&grid, &column).max(1.0);
        let (reached, _) = stand(&mut level(grid, &column), &footprint, mass);
        prop_assert!((reached - promised).abs() < slack, "{} m, foretold {} m", reached, promised);
        let mut stamped = column.clone();
        let dent = stamped.stamp(&grid, &MATERIAL, load, Coverage::WHOLE);
        let dent = grid.metres(dent.into());
        prop_assert!((dent - promised).abs() < slack, "{} m stamped, foretold {} m", dent, promised);
        let step = Pressing::Within(0.25).step(CYCLE);
        let after = column.after(&grid, &MATERIAL, load, step, CYCLE as f32, 10_000);
        let after = height(&grid, &column) - height(&grid, &after);
        prop_assert!((after - reached).abs() < slack, "{} m after, {} m reached", after, reached);
        for (before, after) in column.cells.iter().zip(&stamped.cells) {
            prop_assert_eq!(before.mass, after.mass);
            prop_assert_eq!(before.temperature.to_bits(), after.temperature.to_bits());
            let density = 64.0 * f64::from(after.mass) / f64::from(after.thickness) / cell_size;
            let densest = f64::from(alpine::PRESSED_DENSITY) * (1.0 + 1e-5);
            prop_assert!(density <= densest || before.thickness == after.thickness);
        }
    }
}

#[test]
fn snow_without_loads_stays_as_it_is() {
    let grid = grid(0.2);
    // A hundred times as much weight as the lowest cell is hard.
    let layers = [[5.0, 0.0, 0.2, -1.0], [80.0, 0.0, 0.2, -1.0]];
    let mut cells = vec![cell(&grid, layers[0])];
    cells.extend([cell(&grid, layers[1]); 20]);
    let mut snowpack = level(grid, &Column { cells });
    let before = snowpack.column(0, 0).clone();
    for pressing in [Pressing::Within(0.0), Pressing::Creep] {
        snowpack.set_pressing(pressing);
        snowpack.wake();
        assert_eq!((snowpack.run(100, CYCLE), snowpack.active_tiles()), (0, 0));
    }
    assert_eq!(snowpack.column(0, 0), &before);
    assert!(before.cells[0].stress > 10e3);
    // A load is carried as far as it goes, and no weight with it: by half a metre of snow as by ten.
    let hardness = before.cells[0].hardness(&grid, &MATERIAL);
    let under = |part: f32| {
        let load = SurfaceLoad { pressure: part * hardness, width: 1e6 };
        before.equilibrium(&grid, &MATERIAL, load, false, CYCLE as f32).cells[0].thickness
    };
    assert_eq!(under(0.99), CELL);
    assert!(under(1.05) < CELL && under(1.05) > CELL / 50 * 49);
}

#[test]
fn snow_that_creeps_is_pressed_at_once() {
    let grid = grid(0.05);
    let column = Column { cells: vec![cell(&grid, [5.0, 0.0, 0.05, -2.0]); 8] };
    let footprint = footprint(&grid, [0.1, 0.25]);
    let mut snowpack = level(grid, &column);
    snowpack.set_pressing(Pressing::Creep);
    let (deep, cycles) = stand(&mut snowpack, &footprint, 80.0);
    let promised = foretold(&grid, &column, load(&footprint, 80.0));
    assert!((deep - promised).abs() < SLACK && deep > 0.05, "{deep} {promised}");
    assert!(cycles < 20, "{cycles}");
}

#[test]
fn snow_that_is_laid_neither_tops_up_wet_cells_nor_cuts_any() {
    let grid = Grid { height: 3, ..grid(0.05) };
    let half = |celsius, water| cell(&grid, [2.5, water, 0.025, celsius]);
    let lay = |cells: Vec<Cell>| {
        let mut snowpack = level(grid, &Column { cells });
        let mass = (10.0 * MASS_QUANTA) as u32;
        let refused = snowpack.deposit(grid.all(), 2 * CELL, mass, -0.1);
        let mut column = snowpack.column(0, 0).clone();
        column.cells.iter_mut().for_each(|cell| cell.stress = 0.0);
        (refused / grid.columns(), column)
    };
    let (wet, dry) = (half(0.0, 0.1), half(0.0, 0.0));
    let (refused, column) = lay(vec![wet]);
    assert_eq!((refused, column.cells.len()), (0, 3));
    assert_eq!(column.cells[0], wet);
    let (refused, column) = lay(vec![dry]);
    assert_eq!((refused, column.cells[0].thickness), (0, CELL), "dry snow is topped up");
    let full = vec![wet, dry, wet];
    let (refused, column) = lay(full.clone());
    assert_eq!((refused, &column.cells), ((10.0 * MASS_QUANTA) as u64, &full));
    let mut column = Column { cells: full };
    let mass = column.mass();
    let cleared = column.clear(CELL / 4 * 5);
    assert_eq!(cleared + column.mass(), mass);
    let top = column.cells[2];
    assert_eq!((top.water(), top.mass, top.celsius()), (wet.water() / 2, wet.mass / 2, 0.0));
}
