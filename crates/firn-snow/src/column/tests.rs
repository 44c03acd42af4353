use super::*;

const SHARE: u32 = 1_048_576;

fn cell(mass: u32, thickness: u32, temperature: f32) -> Cell {
    Cell { mass, thickness, temperature, stress: 0.0 }
}

#[test]
fn a_fall_opens_full_cells_and_a_thinner_one() {
    let mut column = Column::default();
    let depth = 2 * CELL + CELL / 4;
    assert_eq!(column.deposit(50, 2 * SHARE + SHARE / 4, depth, -3.0), 0);
    let expected =
        [cell(SHARE, CELL, -3.0), cell(SHARE, CELL, -3.0), cell(SHARE / 4, CELL / 4, -3.0)];
    assert_eq!(column.cells, expected);
    assert_eq!((column.height(), column.mass()), (depth, 2 * SHARE + SHARE / 4));
}

#[test]
fn like_snow_tops_up_and_unlike_snow_does_not() {
    let thin = Column { cells: vec![cell(SHARE / 2, CELL / 2, -3.0)] };
    let fall = |mass, temperature| {
        let mut column = thin.clone();
        assert_eq!(column.deposit(50, mass, CELL, temperature), 0);
        assert_eq!(column.mass(), SHARE / 2 + mass);
        column.cells
    };
    let like = fall(SHARE, -3.2);
    assert_eq!(like.len(), 2);
    assert_eq!((like[0].mass, like[0].thickness), (SHARE, CELL));
    assert!((like[0].temperature + 3.1).abs() < 1e-6, "mixed by mass");
    assert_eq!((like[1].thickness, like[1].temperature), (CELL / 2, -3.2));
    assert_eq!(fall(SHARE, -3.26)[0], thin.cells[0], "too cold");
    assert_eq!(fall(SHARE + SHARE / 18, -3.0)[0], thin.cells[0], "too dense");
    assert_eq!(fall(SHARE + SHARE / 22, -3.0)[0].thickness, CELL, "within 5 %");
}

#[test]
fn what_finds_no_slot_after_a_recut_is_refused() {
    let mut column = Column { cells: vec![cell(SHARE / 2, CELL / 2, -20.0); 4] };
    assert_eq!(column.deposit(4, 3 * SHARE, 3 * CELL, -3.0), SHARE);
    assert_eq!(column.height(), 4 * CELL);
    assert_eq!(column.mass(), 4 * SHARE);
    assert_eq!(column.cells[3], cell(SHARE, CELL, -3.0));
}

#[test]
fn a_rest_without_mass_takes_a_quantum_from_below() {
    let mut column = Column { cells: vec![cell(SHARE / 2, CELL / 2, -3.0)] };
    let depth = CELL / 2 + 3;
    assert_eq!(column.deposit(50, SHARE / 2, depth, -3.0), 0);
    assert_eq!(column.cells.len(), 2);
    assert_eq!(column.cells[1], cell(1, 3, -3.0));
    assert_eq!(column.mass(), SHARE);
}

#[test]
fn a_fall_without_mass_or_depth_is_refused() {
    let mut column = Column::default();
    assert_eq!(column.deposit(50, 0, CELL, -3.0), 0);
    assert_eq!(column.deposit(50, 7, 0, -3.0), 7);
    assert_eq!(column, Column::default());
}

#[test]
fn clearing_cuts_the_cell_it_meets() {
    let full = Column { cells: vec![cell(1001, CELL, -3.0); 3] };
    let mut column = full.clone();
    assert_eq!(column.clear(CELL + CELL / 2), 501 + 1001);
    assert_eq!(column.cells, [cell(1001, CELL, -3.0), cell(500, CELL / 2, -3.0)]);
    let mut column = full.clone();
    assert_eq!(column.clear(2 * CELL + 1), 1001, "a piece without mass goes too");
    assert_eq!(column.height(), 2 * CELL);
    let mut column = full.clone();
    assert_eq!(column.clear(0), 3003);
    assert!(column.cells.is_empty());
    let mut column = full.clone();
    assert_eq!(column.clear(3 * CELL), 0);
    assert_eq!(column, full);
}

#[test]
fn stress_is_the_weight_above_and_the_load_as_it_spreads() {
    let (grid, mut material) = (Grid::default(), Material::default());
    let mut column = Column { cells: vec![cell(SHARE, CELL, -3.0); 2] };
    let load = [SurfaceLoad { pressure: 1000.0, width: 1.0 }];
    let mut stress = |distribution, loads: &[SurfaceLoad]| {
        material.load_distribution = distribution;
        column.stress(&grid, &material, loads);
        [column.cells[0].stress, column.cells[1].stress]
    };
    let near = |a: [f32; 2], b: [f32; 2]| {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.01), "{a:?} is not {b:?}");
    };
    let weight = stress(LoadDistribution::TwoToOne, &[]);
    near(weight, [78.48, 39.24]);
    let spread = stress(LoadDistribution::TwoToOne, &load);
    near(spread, [78.48 + 1000.0 / 1.69, 39.24 + 1000.0 / 1.21]);
    near(stress(LoadDistribution::Uniform, &load), [1078.48, 1039.24]);
    near(stress(LoadDistribution::Surface, &load), [78.48, 1039.24]);
    let nothing = [SurfaceLoad { pressure: 0.0, width: 1.0 }];
    assert_eq!(stress(LoadDistribution::TwoToOne, &nothing), weight);
    assert!(!column.stress(&grid, &material, &[]), "no bit has changed");
}

#[test]
fn a_cell_compacts_past_its_hardness_until_it_carries() {
    let (grid, material) = (Grid::default(), Material::default());
    let run = |stress, cycles| {
        let snow = Cell { mass: SHARE, thickness: CELL, temperature: -3.0, stress };
        let mut column = Column { cells: vec![snow] };
        let last = column.compact(&grid, &material, cycles, 0.25);
        (last, column.cells[0].thickness)
    };
    assert_eq!(run(367.0, 1000), (0, CELL), "below its hardness of 367.72 Pa");
    let (last, thickness) = run(450.0, 100_000);
    assert!(last > 0 && last < 100_000, "it comes to rest");
    assert!(thickness < CELL && thickness > CELL / 2);
    assert_eq!(run(450.0, last + 1).1, thickness);
    assert_ne!(run(450.0, last - 1).1, thickness);
    assert_eq!(run(1e9, 100_000).1, CELL.div_ceil(5), "not beyond the largest density");
}
