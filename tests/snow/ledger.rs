//! The mass ledger holds to the quantum, whatever happens and however often.

use firn_snow::{
    ColumnRect, Cover, Footprint, Grid, MASS_QUANTA, Material, Position, Shape, Snowpack, Turn,
};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

/// Operations in all.
const OPERATIONS: u32 = 1_000_000;

#[test]
fn fallen_less_refused_less_cleared_is_present_after_a_million_operations() {
    let mut dice = SmallRng::seed_from_u64(1);
    let grid = Grid { width: 3, depth: 2, height: 9, cell_size: 0.2 };
    let material = Material::default();
    let mut snowpack = Snowpack::new(grid, material, &[], false).unwrap();
    let (mut fallen, mut refused, mut cleared) = (0_u64, 0_u64, 0_u64);
    for operation in 0..OPERATIONS {
        let (x0, z0) = (dice.random_range(0..3), dice.random_range(0..2));
        let (x1, z1) = (dice.random_range(x0 + 1..=3), dice.random_range(z0 + 1..=2));
        let rect = ColumnRect { x0, z0, x1, z1 };
        match dice.random_range(0..100) {
            0..60 => {
                let depth: f64 = 0.2 * dice.random_range(0.004..1.5_f64).powi(3).max(0.004);
                let density = dice.random_range(10.0..100.0);
                let celsius = dice.random_range(-40.0..0.0_f32);
                let mass = (depth * density * MASS_QUANTA).round() as u32;
                let quanta = grid.thickness_quanta(depth) as u32;
                fallen += u64::from(mass) * rect.columns();
                refused += snowpack.deposit(rect, quanta, mass, celsius);
            }
            60..85 => {
                let depth = dice.random_range(0..9_u32 << 24);
                cleared += snowpack.clear(rect, depth);
            }
            85..95 => {
                snowpack.run(dice.random_range(1..4), dice.random_range(0.01..0.25));
            }
            95..98 => {
                let shape = Shape::Box { width: 0.3, depth: 0.2 };
                let position = Position { x: dice.random_range(0.15..0.45), z: 0.2 };
                let footprint = Footprint::new(&grid, &shape, position, Turn::NONE);
                snowpack.put_collider(
                    "a".into(),
                    dice.random_range(0.1..50.0),
                    Cover::default(),
                    vec![footprint],
                    true,
                );
                snowpack.evaluate();
            }
            _ => snowpack.remove_collider("a"),
        }
        if operation % 997 == 0 || operation + 1 == OPERATIONS {
            assert_eq!(snowpack.mass(), fallen - refused - cleared, "operation {operation}");
        }
    }
    assert!(refused > 0 && cleared > 0, "the test shows nothing");
}
