use std::cell::Cell as Counter;

use proptest::prelude::*;

use super::*;
use crate::column::press::thickest;
use crate::{HardnessLaw, LoadDistribution};

/// The same by nothing but halvings of each cell.
fn stamp_by_halvings(column: &mut Column, grid: &Grid, material: &Material, load: SurfaceLoad) {
    let law = Compaction::new(grid, material, 0.0);
    let metres = grid.cell_size as f32 / CELL as f32;
    let (mut mass, mut above) = (0_u32, 0_u32);
    for (rank, cell) in column.cells.iter_mut().rev().enumerate() {
        mass += cell.mass;
        let own = if material.hardness_law.is_alpine() { 0.0 } else { weight(mass) };
        let carries = |thickness: u32| {
            let depth = (above as f32 + 0.5 * thickness as f32) * metres;
            let felt =
                load.pressure * spread(material.load_distribution, depth, load.width, rank == 0);
            felt <= 0.0 || law.hardness(&Cell { thickness, ..*cell }) >= own + felt
        };
        if !carries(cell.thickness) {
            let least = law.least(cell).min(cell.thickness);
            cell.thickness = thickest(least, cell.thickness, carries);
        }
        above += cell.thickness;
    }
}

const LAWS: [HardnessLaw; 4] =
    [HardnessLaw::Calibrated, HardnessLaw::Regression, HardnessLaw::Gold, HardnessLaw::Alpine];
const SPREADS: [LoadDistribution; 3] =
    [LoadDistribution::TwoToOne, LoadDistribution::Uniform, LoadDistribution::Surface];

fn material() -> impl Strategy<Value = Material> {
    let selects = (proptest::sample::select(&LAWS[..]), proptest::sample::select(&SPREADS[..]));
    (selects, 60.0..900.0, 0.05..10.0).prop_map(
        |((hardness_law, load_distribution), max_density, grain_size_mm)| Material {
            hardness_law,
            load_distribution,
            max_density,
            grain_size_mm,
            ..Material::default()
        },
    )
}

/// A cell of any thickness and of any density that the material allows, for cells of a size.
fn cell(size: f64, densest: f64) -> impl Strategy<Value = Cell> {
    let thickness = prop_oneof![3 => 1 << 20..=CELL, 1 => 1..CELL, 1 => Just(CELL)];
    (thickness, 10.0..densest, -40.0_f32..=0.0).prop_map(
        move |(thickness, density, temperature)| {
            let kilograms = density * size * f64::from(thickness) / f64::from(CELL);
            let mass = (kilograms * f64::from(1 << 18)).max(1.0) as u32;
            Cell { mass, thickness, temperature, stress: 0.0 }
        },
    )
}

fn case() -> impl Strategy<Value = (Grid, Material, Vec<Column>, SurfaceLoad)> {
    let size = proptest::sample::select(&[0.02, 0.1, 0.5, 2.0][..]);
    (size, material()).prop_flat_map(|(size, material)| {
        let cells = proptest::collection::vec(cell(size, material.max_density), 0..9);
        let alpine = material.hardness_law.is_alpine();
        let water = proptest::sample::select(&[0.0, 0.0, 0.001, 0.02, 0.3][..]);
        let column = (cells, water).prop_map(move |(mut cells, water)| {
            // Every other cell is wet.
            for cell in cells.iter_mut().step_by(2).filter(|_| alpine) {
                cell.set_heat(cell.temperature, (water * f64::from(cell.mass)) as u32);
            }
            Column { cells }
        });
        let columns = proptest::collection::vec(column, 1..4);
        let load = (-2.0_f64..8.0, -2.0_f64..1.0).prop_map(|(pressure, width)| SurfaceLoad {
            pressure: 10_f64.powf(pressure) as f32,
            width: 10_f64.powf(width) as f32,
        });
        let grid = Grid { cell_size: size, ..Grid::default() };
        (Just(grid), Just(material), columns, load)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn cells_come_to_where_halvings_find_that_they_carry(
        (grid, material, columns, load) in case()
    ) {
        // The printer remembers one column while it presses the next, and the second time each as it is.
        let mut printer = Printer::new(&grid, &material);
        for column in columns.iter().chain(&columns) {
            let (mut ours, mut theirs) = (column.clone(), column.clone());
            stamp_by_halvings(&mut theirs, &grid, &material, load);
            let dent = printer.press(&mut ours, load, Coverage::WHOLE);
            prop_assert_eq!(&ours, &theirs);
            prop_assert_eq!(dent, column.height() - ours.height());
            let mut again = column.clone();
            printer.press(&mut again, load, Coverage::WHOLE);
            prop_assert_eq!(&again, &theirs);
        }
    }

    #[test]
    fn any_guess_leads_to_the_same(
        least in 1..1000_u32,
        present in 1000..=CELL,
        power in 1.0..5.0_f64,
        at in -0.2..0.999_f64,
        guess in 0..=CELL,
    ) {
        // It holds up to a part of the way; nowhere where that is below 0.
        let edge = f64::from(least) + at * f64::from(present - least);
        let strength = |d: u32| (edge.max(0.5) / f64::from(d)).powf(power) as f32;
        let expected = thickest(least, present, |d| strength(d) >= 1.0);
        for guess in [None, Some(guess)] {
            let before = strength(present);
            let found = thickest_near(least, present, before, guess, f32::sqrt, strength);
            prop_assert_eq!(found, expected);
        }
    }
}

#[test]
fn few_looks_at_the_hardness_suffice() {
    for power in [2.0_f32, 2.5, 3.92] {
        let root = if power < 3.0 { f32::sqrt } else { |it: f32| it.sqrt().sqrt() };
        let looks = Counter::new(0);
        let strength = |d: u32| {
            looks.set(looks.get() + 1);
            (4e6 / d as f32).powf(power)
        };
        let found = thickest_near(1000, CELL, strength(CELL), None, root, strength);
        assert!(found.abs_diff(4_000_000) <= 2, "{found}");
        assert!(looks.get() <= 13, "{power}: {} looks", looks.get());
    }
}

#[test]
fn another_load_or_another_column_is_not_taken_for_the_last() {
    let (grid, material) =
        (Grid::default(), Material { max_density: 400.0, ..Material::default() });
    let cell = Cell { mass: 12 << 18, thickness: CELL, temperature: -3.0, stress: 0.0 };
    let (column, load) = (vec![cell; 3], SurfaceLoad { pressure: 20_000.0, width: 0.2 });
    let with = |other: Cell| vec![cell, other, cell];
    let others = [
        (column.clone(), SurfaceLoad { pressure: 40_000.0, ..load }),
        (column.clone(), SurfaceLoad { width: 0.4, ..load }),
        (with(Cell { mass: 11 << 18, ..cell }), load),
        (with(Cell { thickness: CELL / 5, ..cell }), load),
        (with(Cell { temperature: -5.0, ..cell }), load),
        (vec![cell; 2], load),
        (vec![cell; 4], load),
    ];
    let mut printer = Printer::new(&grid, &material);
    let mut press = |cells: &[Cell], load: SurfaceLoad| {
        let (mut ours, mut theirs) = (Column { cells: cells.to_vec() }, Column::default());
        theirs.cells.extend(cells);
        stamp_by_halvings(&mut theirs, &grid, &material, load);
        printer.press(&mut ours, load, Coverage::WHOLE);
        assert_eq!(ours, theirs, "{load:?} {cells:?}");
        ours
    };
    let plain = press(&column, load);
    for (cells, other) in others {
        assert_ne!(press(&cells, other), plain, "{other:?} {cells:?}");
        assert_eq!(press(&column, load), plain);
    }
}
