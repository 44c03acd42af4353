//! The thesis's requirements 1 to 6; the seventh, that mass is kept, holds in all the other tests.

use firn::snow::{CELL, Column, GRAVITY, Grid, Material, SurfaceLoad};

/// Height in metres of 5.8 m of snow after 60 s under a load.
fn settled(density: f64, temperature: f32, load: Option<SurfaceLoad>) -> f64 {
    let (grid, material) = (Grid::default(), Material::default());
    let mut column = Column::default();
    let mass = (5.8 * density * f64::from(1 << 18)).round() as u32;
    column.deposit(50, mass, 29 * CELL, temperature);
    let loads: Vec<SurfaceLoad> = load.into_iter().collect();
    for _ in 0..240 {
        column.stress(&grid, &material, &loads);
        column.compact(&grid, &material, 1, 0.25);
    }
    grid.metres(u64::from(column.height()))
}

#[test]
fn the_thesis_requirements_hold() {
    let plate = |mass: f32, area: f32| {
        Some(SurfaceLoad { pressure: mass * GRAVITY as f32 / area, width: area.sqrt() })
    };
    let alone = settled(20.0, -3.0, None);
    assert!(settled(20.0, -3.0, plate(100.0, 1.0)) < alone - 0.1, "1: pressure compresses");
    assert!((settled(90.0, -3.0, None) - 5.8).abs() < 1e-9, "2: not below the threshold");
    let least = 5.8 * 20.0 / 100.0;
    let crushed = settled(20.0, -3.0, plate(1e6, 1.0));
    assert!(crushed >= least && crushed < least + 1e-3, "3: not indefinitely, {crushed}");
    assert!(settled(25.0, -3.0, plate(100.0, 1.0)) > settled(20.0, -3.0, plate(100.0, 1.0)), "4");
    assert!(settled(20.0, -1.0, None) < alone && alone < settled(20.0, -10.0, None), "5");
    let depths: Vec<f64> =
        [16.0, 1.0, 0.1].iter().map(|&area| settled(20.0, -3.0, plate(100.0, area))).collect();
    assert!(depths[0] > depths[1] && depths[1] > depths[2], "6: smaller area, {depths:?}");
    assert!(settled(20.0, -3.0, plate(300.0, 1.0)) < depths[1], "6: larger mass");
}
