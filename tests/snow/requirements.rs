//! The thesis's requirements 1 to 7 (table 3.1), for every hardness law, over random columns; and
//! that without snowfall heights never rise and densities never fall.

use firn_snow::{
    CELL, Cell, Column, Cover, Footprint, GRAVITY, Grid, HardnessLaw, LoadDistribution,
    MASS_QUANTA, Material, Position, Shape, Snowpack, SurfaceLoad, Turn,
};
use proptest::prelude::*;

/// Length of a cycle at which no cell leaps past its rest.
const DT: f32 = 1.0 / 60.0;

/// What roundings in f32 may add up to, in thickness quanta: a ten-thousandth of a cell.
const SLACK: u32 = CELL / 10_000;

const LAWS: [HardnessLaw; 3] =
    [HardnessLaw::Calibrated, HardnessLaw::Regression, HardnessLaw::Gold];
const SPREADS: [LoadDistribution; 3] =
    [LoadDistribution::TwoToOne, LoadDistribution::Uniform, LoadDistribution::Surface];

fn material() -> impl Strategy<Value = Material> {
    (prop::sample::select(&LAWS[..]), prop::sample::select(&SPREADS[..])).prop_map(
        |(hardness_law, load_distribution)| Material {
            hardness_law,
            load_distribution,
            ..Material::default()
        },
    )
}

/// Layers of snow: depth in cells, density, temperature.
type Layers = Vec<(f64, f64, f32)>;

/// Depths are whole sixteenths, so that no cell is so thin that its roundings matter.
fn layers() -> impl Strategy<Value = Layers> {
    let depth = (3..130_u32).prop_map(|sixteenths| f64::from(sixteenths) / 16.0);
    prop::collection::vec((depth, 15.0..60.0, -25.0..0.0_f32), 1..6)
}

fn column(layers: &Layers) -> Column {
    let grid = Grid::default();
    let mut column = Column::default();
    for &(depth, density, temperature) in layers {
        let mass = (depth * grid.cell_size * density * MASS_QUANTA).round() as u32;
        let depth = (depth * f64::from(CELL)).round() as u32;
        let refused = column.deposit(grid.height, mass, depth, temperature);
        assert_eq!(refused, 0);
    }
    column
}

fn density(cell: &Cell) -> f32 {
    cell.mass as f32 / cell.thickness as f32 * (64.0 / Grid::default().cell_size) as f32
}

/// Stresses a column and compacts it, cycle by cycle, as under an object.
fn press(column: &mut Column, material: &Material, load: Option<SurfaceLoad>, cycles: u32) {
    let loads: Vec<SurfaceLoad> = load.into_iter().collect();
    for _ in 0..cycles {
        column.stress(&Grid::default(), material, &loads);
        column.compact(&Grid::default(), material, 1, DT);
    }
}

/// Snow of one density under a stress that is the same whatever it weighs itself.
fn lone_cell(density: f64, temperature: f32, stress: f32) -> Column {
    let mass = (0.2 * density * MASS_QUANTA).round() as u32;
    Column { cells: vec![Cell { mass, thickness: CELL, temperature, stress }] }
}

proptest! {
    #[test]
    fn requirement_1_snow_compresses_under_pressure(
        material in material(),
        layers in layers(),
        excess in 50.0..20_000.0_f32,
    ) {
        let mut column = column(&layers);
        let before = column.clone();
        let top = before.cells[before.cells.len() - 1];
        // A hundredth more, as a load spreads a little on its way to the middle of the cell.
        let pressure = 1.01 * material.hardness(density(&top), top.temperature) + excess;
        press(&mut column, &material, Some(SurfaceLoad { pressure, width: 50.0 }), 30);
        prop_assert!(column.height() < before.height());
        prop_assert!(column.cells[column.cells.len() - 1].thickness < top.thickness);
    }

    #[test]
    fn requirement_2_snow_compresses_only_past_a_threshold(
        material in material(),
        layers in layers(),
        pressure in 0.0..2_000.0_f32,
        cycles in 1..600_u32,
    ) {
        let mut column = column(&layers);
        let grid = Grid::default();
        column.stress(&grid, &material, &[SurfaceLoad { pressure, width: 1.0 }]);
        let before = column.clone();
        column.compact(&grid, &material, cycles, DT);
        for (cell, was) in column.cells.iter().zip(&before.cells) {
            let threshold = material.hardness(density(was), was.temperature);
            if was.stress <= threshold {
                prop_assert_eq!(cell, was);
            } else if was.stress > threshold + 50.0 {
                prop_assert!(cell.thickness < was.thickness);
            }
        }
    }

    #[test]
    fn requirement_3_snow_does_not_compress_indefinitely(
        material in material(),
        layers in layers(),
        pressure in 0.0..1e8_f32,
    ) {
        let mut column = column(&layers);
        let grid = Grid::default();
        let load = SurfaceLoad { pressure, width: 50.0 };
        let rests = (0..200).any(|_| {
            column.stress(&grid, &material, &[load]);
            column.compact(&grid, &material, 100_000, 0.25) == 0
        });
        prop_assert!(rests);
        let densest = grid.cell_size * material.max_density * MASS_QUANTA / f64::from(CELL);
        for cell in &column.cells {
            prop_assert!(f64::from(cell.mass) <= f64::from(cell.thickness) * densest * (1.0 + 1e-6));
        }
    }

    #[test]
    fn requirement_4_denser_snow_compresses_less(
        material in material(),
        density in 15.0..95.0_f64,
        denser in 0.0..60.0_f64,
        temperature in -40.0..0.0_f32,
        stress in 0.0..5_000.0_f32,
        cycles in 1..900_u32,
    ) {
        let denser = (density + denser).min(100.0);
        let [mut light, mut dense] =
            [density, denser].map(|density| lone_cell(density, temperature, stress));
        for column in [&mut light, &mut dense] {
            column.compact(&Grid::default(), &material, cycles, DT);
        }
        prop_assert!(dense.height() + SLACK >= light.height());
    }

    #[test]
    fn requirement_5_warmer_snow_compresses_more(
        material in material(),
        layers in layers(),
        warmer in 0.0..25.0_f32,
        cycles in 1..900_u32,
    ) {
        let mut cold = column(&layers);
        let mut warm = cold.clone();
        for cell in &mut warm.cells {
            cell.temperature = (cell.temperature + warmer).min(0.0);
        }
        for column in [&mut cold, &mut warm] {
            column.stress(&Grid::default(), &material, &[]);
            column.compact(&Grid::default(), &material, cycles, DT);
        }
        for (cold, warm) in cold.cells.iter().zip(&warm.cells) {
            prop_assert!(warm.thickness <= cold.thickness + SLACK);
        }
    }

    #[test]
    fn requirement_7_mass_changes_only_by_snowfall_or_removal(
        material in material(),
        layers in layers(),
        pressure in 0.0..20_000.0_f32,
        cycles in 1..300_u32,
        part in 0.0..1.0_f64,
        more in layers(),
    ) {
        let load = Some(SurfaceLoad { pressure, width: 1.0 });
        let mut column = column(&layers);
        let mass = |depth: f64, density: f64| (depth * 0.2 * density * MASS_QUANTA).round() as u32;
        let mut ledger: u32 = layers.iter().map(|&(depth, density, _)| mass(depth, density)).sum();
        prop_assert_eq!(column.mass(), ledger);
        press(&mut column, &material, load, cycles);
        prop_assert_eq!(column.mass(), ledger, "pressed");
        ledger -= column.clear((f64::from(column.height()) * part) as u32);
        prop_assert_eq!(column.mass(), ledger, "cleared");
        for (depth, density, temperature) in more {
            let fallen = mass(depth, density);
            // Few slots, so that stacks are re-cut and some snow is refused.
            let depth = (depth * f64::from(CELL)).round() as u32;
            ledger += fallen - column.deposit(30, fallen, depth, temperature);
            prop_assert_eq!(column.mass(), ledger, "snowed on");
        }
        press(&mut column, &material, load, cycles);
        prop_assert_eq!(column.mass(), ledger, "pressed again");
    }
}

/// Ground of 1 m × 1 m, and a square plate in its middle.
const PATCH: Grid = Grid { width: 5, depth: 5, height: 50, cell_size: 0.2 };

fn plate(side: f64) -> Vec<Footprint> {
    let shape = Shape::Box { width: side, depth: side };
    vec![Footprint::new(&PATCH, &shape, Position { x: 0.5, z: 0.5 }, Turn::NONE)]
}

fn patch(material: Material, layers: &Layers) -> Snowpack {
    let mut snowpack = Snowpack::new(PATCH, material, &[], false).unwrap();
    for &(depth, density, temperature) in layers {
        let mass = (depth * PATCH.cell_size * density * MASS_QUANTA).round() as u32;
        let depth = (depth * f64::from(CELL)).round() as u32;
        snowpack.deposit(PATCH.all(), depth, mass, temperature);
    }
    snowpack
}

/// Height of the column under a plate that has stood on snow for a time.
fn under(material: Material, layers: &Layers, mass: f64, side: f64, cycles: u32) -> u32 {
    let mut snowpack = patch(material, layers);
    snowpack.put_collider("plate".into(), mass, Cover::default(), plate(side), true);
    snowpack.run(cycles, f64::from(DT));
    snowpack.column(2, 2).height()
}

/// What is done with the objects on a snowpack; it does not snow.
#[derive(Clone, Debug)]
enum Step {
    Put { id: u8, pressure: f64, side: f64 },
    Remove(u8),
    Stiffness(f64),
    Run { cycles: u32, dt: f64 },
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        2 => (0..3_u8, 10.0..20_000.0, 0.05..1.0)
            .prop_map(|(id, pressure, side)| Step::Put { id, pressure, side }),
        1 => (0..3_u8).prop_map(Step::Remove),
        1 => (3.0..6.0).prop_map(Step::Stiffness),
        4 => (1..100_u32, 0.001..0.25).prop_map(|(cycles, dt)| Step::Run { cycles, dt }),
    ]
}

fn take(snowpack: &mut Snowpack, material: Material, step: &Step) {
    match *step {
        Step::Put { id, pressure, side } => {
            let mass = pressure * side * side / GRAVITY;
            snowpack.put_collider(id.to_string().into(), mass, Cover::default(), plate(side), true);
        }
        Step::Remove(id) => snowpack.remove_collider(&id.to_string()),
        Step::Stiffness(stiffness_exponent) => {
            snowpack.set_material(Material { stiffness_exponent, ..material });
        }
        Step::Run { cycles, dt } => {
            snowpack.run(cycles, dt);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn requirement_6_smaller_contact_area_or_larger_mass_sinks_deeper(
        material in material(),
        layers in layers(),
        pressure in 50.0..5_000.0_f64,
        side in 0.1..1.0_f64,
        smaller in 0.6..1.0_f64,
        heavier in 1.0..3.0_f64,
        cycles in 1..600_u32,
    ) {
        let mass = pressure * side * side / GRAVITY;
        let it = under(material, &layers, mass, side, cycles);
        prop_assert!(under(material, &layers, mass, side * smaller, cycles) <= it + SLACK);
        prop_assert!(under(material, &layers, mass * heavier, side, cycles) <= it + SLACK);
    }

    #[test]
    fn without_snowfall_heights_never_rise_and_densities_never_fall(
        material in material(),
        layers in layers(),
        steps in prop::collection::vec(step(), 1..12),
    ) {
        let mut snowpack = patch(material, &layers);
        let columns = |snowpack: &Snowpack| -> Vec<Column> {
            (0..25).map(|i| snowpack.column(i % 5, i / 5).clone()).collect()
        };
        let mut before = columns(&snowpack);
        for step in &steps {
            take(&mut snowpack, material, step);
            let now = columns(&snowpack);
            for (now, was) in now.iter().zip(&before) {
                prop_assert!(now.height() <= was.height());
                prop_assert_eq!(now.cells.len(), was.cells.len());
                for (now, was) in now.cells.iter().zip(&was.cells) {
                    let density = |cell: &Cell| f64::from(cell.mass) / f64::from(cell.thickness);
                    prop_assert!(density(now) >= density(was));
                }
            }
            before = now;
        }
    }
}

/// Height in metres of 5.8 m of the thesis's snow after 60 s under 100 kg on an area, if any.
fn settled(temperature: f32, area: Option<f32>) -> f64 {
    let mut column = column(&vec![(29.0, 20.0, temperature)]);
    let load = area
        .map(|area| SurfaceLoad { pressure: 100.0 * GRAVITY as f32 / area, width: area.sqrt() });
    press(&mut column, &Material::default(), load, 3600);
    Grid::default().metres(u64::from(column.height()))
}

#[test]
fn the_thesis_columns_differ_by_much() {
    let alone = settled(-3.0, None);
    assert!(settled(-1.0, None) < alone - 0.3, "5: warmer");
    assert!(settled(-10.0, None) > alone + 0.3, "5: colder");
    let depths = [16.0, 1.0, 0.1].map(|area| settled(-3.0, Some(area)));
    assert!(depths[0] < alone - 0.02, "1: {depths:?}, {alone} m alone");
    assert!(depths[1] < depths[0] - 0.3 && depths[2] < depths[1] - 0.3, "6: {depths:?}");
}
