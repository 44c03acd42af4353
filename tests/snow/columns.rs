//! Single columns under random changes.

use firn_snow::{CELL, Column, Grid, HardnessLaw, LoadDistribution, Material, SurfaceLoad};
use proptest::prelude::*;

const LAWS: [HardnessLaw; 3] =
    [HardnessLaw::Calibrated, HardnessLaw::Regression, HardnessLaw::Gold];
const SPREADS: [LoadDistribution; 3] =
    [LoadDistribution::TwoToOne, LoadDistribution::Uniform, LoadDistribution::Surface];

/// A material of any law in which a column of 2 m cells could not overflow.
fn material() -> impl Strategy<Value = Material> {
    (0..3_usize, 0..3_usize, 3.0..6.0).prop_map(|(law, spread, exponent)| Material {
        hardness_law: LAWS[law],
        load_distribution: SPREADS[spread],
        stiffness_exponent: exponent,
        max_density: 550.0,
        ..Material::default()
    })
}

/// What is done to a column.
#[derive(Clone, Debug)]
enum Op {
    Deposit { depth: f64, density: f64, temperature: f32 },
    Clear { depth: f64 },
    Compact { cycles: u32, dt: f32, pressure: f32 },
}

/// Depths are in cells.
fn op() -> impl Strategy<Value = Op> {
    let deposit = (0.004..6.0, 10.0..550.0, -40.0..0.0_f32)
        .prop_map(|(depth, density, temperature)| Op::Deposit { depth, density, temperature });
    let like = (0.004..1.5, 20.0..20.9, -3.2..-3.0_f32)
        .prop_map(|(depth, density, temperature)| Op::Deposit { depth, density, temperature });
    let clear = (0.0..12.0).prop_map(|depth| Op::Clear { depth });
    let compact = (1..40_u32, 0.001..0.25_f32, 0.0..20_000.0_f32)
        .prop_map(|(cycles, dt, pressure)| Op::Compact { cycles, dt, pressure });
    prop_oneof![2 => deposit, 2 => like, 1 => clear, 2 => compact]
}

/// Every cell has mass and thickness, and there are no more cells than slots.
fn assert_whole(column: &Column, slots: u32) {
    assert!(column.cells.len() <= slots as usize);
    for cell in &column.cells {
        assert!(cell.mass > 0 && (1..=CELL).contains(&cell.thickness), "{cell:?}");
        assert!((-40.0..=0.0).contains(&cell.temperature), "{cell:?}");
    }
}

proptest! {
    #[test]
    fn mass_is_kept_and_snow_moves_down_only(
        material in material(),
        cell_size in 0.02..2.0,
        ops in prop::collection::vec(op(), 1..40),
    ) {
        let grid = Grid { cell_size, height: 12, ..Grid::default() };
        let mut column = Column::default();
        let mut ledger = 0_i64;
        for op in ops {
            let before = column.clone();
            match op {
                Op::Deposit { depth, density, temperature } => {
                    let mass = (depth * cell_size * density * f64::from(1 << 18)).round() as u32;
                    let depth = (depth * f64::from(CELL)).round() as u32;
                    let refused = column.deposit(grid.height, mass, depth, temperature);
                    ledger += i64::from(mass) - i64::from(refused);
                    if refused == 0 {
                        prop_assert_eq!(column.height(), before.height() + depth);
                    }
                }
                Op::Clear { depth } => {
                    let depth = (depth * f64::from(CELL)) as u32;
                    ledger -= i64::from(column.clear(depth));
                    prop_assert!(column.height() <= depth.min(before.height()));
                    prop_assert!(column.height().abs_diff(depth.min(before.height())) < CELL);
                }
                Op::Compact { cycles, dt, pressure } => {
                    column.stress(&grid, &material, &[SurfaceLoad { pressure, width: 1.0 }]);
                    let last = column.compact(&grid, &material, cycles, dt);
                    prop_assert!(last <= cycles);
                    prop_assert_eq!(last > 0, column.height() < before.height());
                    for (cell, was) in column.cells.iter().zip(&before.cells) {
                        prop_assert_eq!(cell.mass, was.mass);
                        prop_assert!(cell.thickness <= was.thickness);
                    }
                }
            }
            assert_whole(&column, grid.height);
            prop_assert_eq!(i64::from(column.mass()), ledger);
        }
    }

    #[test]
    fn cycles_may_be_run_in_any_portions(
        material in material(),
        density in 10.0..60.0_f64,
        first in 0..50_u32,
        rest in 0..50_u32,
    ) {
        let grid = Grid::default();
        let mass = (density * 2.0 * f64::from(1 << 18)) as u32;
        let mut whole = Column::default();
        whole.deposit(50, mass, 10 * CELL, -3.0);
        whole.stress(&grid, &material, &[SurfaceLoad { pressure: 2000.0, width: 1.0 }]);
        let mut parts = whole.clone();
        let last = whole.compact(&grid, &material, first + rest, 0.02);
        let early = parts.compact(&grid, &material, first, 0.02);
        let late = parts.compact(&grid, &material, rest, 0.02);
        prop_assert_eq!(&whole, &parts);
        prop_assert_eq!(last, if late > 0 { first + late } else { early });
    }

    #[test]
    fn hardness_rises_with_density_and_with_cold(
        law in 0..3_usize,
        density in 10.0..917.0_f32,
        denser in 0.0..300.0_f32,
        temperature in -40.0..0.0_f32,
        colder in 0.0..40.0_f32,
    ) {
        let material = Material { hardness_law: LAWS[law], ..Material::default() };
        let denser = (density + denser).min(917.0);
        let colder = (temperature - colder).max(-40.0);
        let hardness = material.hardness(density, temperature);
        prop_assert!(hardness >= 0.0 && hardness.is_finite());
        // What two roundings of a polynomial of large terms can differ by.
        let slack = 1e-5 * hardness + 1e-3;
        prop_assert!(material.hardness(denser, temperature) >= hardness - slack);
        prop_assert!(material.hardness(density, colder) >= hardness - slack);
        prop_assert!(material.stiffness(denser) >= material.stiffness(density));
    }
}
