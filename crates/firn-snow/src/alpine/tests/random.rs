//! Forty columns in weather as wild as it may be told.

use super::*;
use crate::{Coverage, HardnessLaw, Material, SurfaceLoad};

/// Steps of each.
const STEPS: u32 = 3000;

/// Weather that changes all at once now and then.
struct Wild {
    dice: Dice,
    now: Felt,
    left: u32,
}

impl Wild {
    fn next(&mut self) -> &Felt {
        let Wild { dice, now, left } = self;
        *left = left.saturating_sub(1);
        if *left == 0 {
            *left = dice.range(1.0, 200.0) as u32;
            now.air_temperature = dice.range(-40.0, 25.0);
            now.longwave = dice.range(100.0, 450.0);
            now.shortwave = if dice.once_in(2.0) { 0.0 } else { dice.range(0.0, 1200.0) };
            now.relative_humidity = dice.range(0.0, 100.0);
            now.wind_speed = if dice.once_in(4.0) { 0.0 } else { dice.range(0.0, 30.0) };
            now.pressure = dice.range(300.0, 1100.0);
            let precipitation = match dice.range(0.0, 4.0) {
                kind if kind < 2.0 => 0.0,
                kind if kind < 3.0 => dice.range(0.0, 3.0),
                _ => dice.range(0.0, 80.0),
            };
            let rains =
                if dice.once_in(20.0) { dice.once_in(2.0) } else { now.air_temperature > 1.2 };
            let (snow, rain) = if rains { (0.0, precipitation) } else { (precipitation, 0.0) };
            (now.snowfall, now.rainfall) = (snow / 3600.0, rain / 3600.0);
        }
        now
    }
}

fn check(trial: &Trial, stepped: &Stepped, when: &str) {
    assert_eq!(i128::from(trial.column.mass()), trial.ledger, "{when}");
    assert!(trial.column.cells.len() <= trial.grid.height as usize, "{when}");
    for cell in &trial.column.cells {
        assert!(is_sound(cell, &trial.grid), "{when}: {cell:?}");
    }
    let Surface { albedo, skin, soil, .. } = trial.surface;
    assert!((0.5..=0.9).contains(&albedo) && (0.0..=1.0).contains(&stepped.albedo), "{when}");
    assert!((-75.0..150.0).contains(&skin), "{when}: {skin}");
    assert!(soil.iter().all(|celsius| (-75.0..150.0).contains(celsius)), "{when}: {soil:?}");
    assert!(stepped.heat.is_finite() && stepped.brought.is_finite(), "{when}");
}

/// Whether a cell is one: cold or wet, no thicker than a cell and no denser than what is in it.
fn is_sound(cell: &Cell, grid: &Grid) -> bool {
    let word = cell.temperature;
    let is_cold_or_wet = (-75.0..=0.0).contains(&word) || word.is_finite() && word >= 2.0;
    let metres = grid.cell_size / f64::from(CELL);
    let kilograms = |quanta: u32| f64::from(quanta) / crate::MASS_QUANTA;
    let solid = kilograms(cell.ice()) / 917.0 + kilograms(cell.water()) / 1000.0;
    let thickness = f64::from(cell.thickness) * metres;
    is_cold_or_wet
        && cell.mass > 0
        && cell.water() <= cell.mass
        && (1..=CELL).contains(&cell.thickness)
        && solid <= thickness * (1.0 + 1e-5) + 3.0 * metres
}

/// Presses snow, takes some off and lays some, now and then.
fn interfere(trial: &mut Trial, dice: &mut Dice) {
    let height = trial.column.height();
    let mass = |column: &Column| i128::from(column.mass());
    if dice.once_in(100.0) {
        let law = HardnessLaw::Alpine;
        let material = Material { hardness_law: law, ..Material::default() };
        let pressure = 10_f64.powf(dice.range(2.0, 6.0)) as f32;
        let load = SurfaceLoad { pressure, width: dice.range(0.05, 2.0) as f32 };
        trial.column.stamp(&trial.grid, &material, load, Coverage::WHOLE);
    }
    if dice.once_in(100.0) {
        let before = mass(&trial.column);
        let cleared = trial.column.clear((f64::from(height) * dice.unit()) as u32);
        trial.ledger -= i128::from(cleared);
        assert_eq!(mass(&trial.column) + i128::from(cleared), before);
    }
    if dice.once_in(100.0) {
        let depth = dice.range(0.0, 3.0 * f64::from(CELL)) as u32;
        let metres = f64::from(depth) / f64::from(CELL) * trial.grid.cell_size;
        let mass = (dice.range(20.0, 500.0) * metres * crate::MASS_QUANTA) as u32;
        let celsius = dice.range(-30.0, 0.0) as f32;
        let refused = trial.column.deposit_alpine(trial.grid.height, mass, depth, celsius);
        trial.ledger += i128::from(mass) - i128::from(refused);
    }
}

/// Runs a column of its own through wild weather; returns how much of the heat is missing \[J/m²\] for each step, and how much
/// at the most in one.
fn run(seed: u64) -> (f64, f64) {
    let mut dice = Dice(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let cell_size = 0.02 * 25_f64.powf(dice.unit());
    let height = dice.range(8.0, (16.0 / cell_size).min(255.0)) as u32;
    let grid = Grid { width: 1, depth: 1, height, cell_size };
    let seconds = (60.0 * 60_f64.powf(dice.unit())).round();
    let soil = [(); 4].map(|()| dice.range(-5.0, 15.0) as f32);
    let mut trial = Trial::new(grid, seconds, soil, 0.0);
    let mut wild = Wild { dice: Dice(seed), now: felt(0.0), left: 1 };
    let mut most = 0.0_f64;
    for step in 0..STEPS {
        interfere(&mut trial, &mut dice);
        let before = trial.missing();
        let stepped = trial.step(wild.next());
        check(&trial, &stepped, &format!("run {seed} step {step}"));
        most = most.max((trial.missing() - before).abs());
    }
    (trial.missing() / f64::from(STEPS), most)
}

#[test]
fn no_weather_breaks_a_column() {
    for seed in 0..40 {
        let (mean, most) = run(seed);
        println!("run {seed}: {mean:.1} J/m² are missing after a step, at most {most:.0}");
        // Soil that freezes takes in 10 J/m² before its f32 changes by a bit.
        assert!(mean.abs() < 15.0 && most < 200.0, "run {seed}");
    }
}

#[test]
fn ice_that_sublimates_gets_no_denser() {
    let grid = Grid { width: 1, depth: 1, height: 50, cell_size: 0.4 };
    let mut trial = Trial::new(grid, 900.0, [0.0; 4], -10.0);
    let ice = |mass: u32| {
        let thickness = f64::from(mass) / crate::MASS_QUANTA / 917.0 / 0.4 * f64::from(CELL);
        Cell { mass, thickness: thickness.ceil() as u32, temperature: -10.0, stress: 0.0 }
    };
    trial.column.cells = vec![ice(50 << 18), ice(1 << 18)];
    let dry = Felt { relative_humidity: 55.0, wind_speed: 0.5, ..felt(-10.0) };
    for step in 0..3000 {
        assert!(trial.step(&dry).exchange.sublimated > 0, "step {step}");
        assert!(trial.column.cells.iter().all(|cell| is_sound(cell, &grid)), "step {step}");
    }
}
