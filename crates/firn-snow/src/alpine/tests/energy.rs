//! Heat is kept: what goes into snow and soil is what is there, to rounding.

use super::*;

/// Sunny days and clear nights, storms every few days, and spring at the end: hour by hour, so many days.
pub(super) fn winter(days: u32, seed: u64) -> Vec<Felt> {
    let mut dice = Dice(seed);
    let (mut storm, mut hours) = (0.0, Vec::new());
    for hour in 0..24 * days {
        let day = f64::from(hour) / 24.0;
        let height = ((day - 0.25) * std::f64::consts::TAU).sin();
        let spring = day / f64::from(days);
        if dice.once_in(100.0) {
            storm = dice.range(4.0, 40.0);
        }
        storm -= 1.0;
        let air = -9.0 + 20.0 * spring * spring + 4.0 * height + dice.range(-2.0, 2.0);
        let rate = if storm > 0.0 { dice.range(0.0, 3.0) / 3600.0 } else { 0.0 };
        let (snowfall, rainfall) = if air <= 1.2 { (rate, 0.0) } else { (0.0, rate) };
        let clear = if storm > 0.0 { 0.2 } else { 1.0 };
        hours.push(Felt {
            relative_humidity: dice.range(40.0, 100.0),
            wind_speed: dice.range(0.0, 8.0),
            snowfall,
            rainfall,
            shortwave: (400.0 + 500.0 * spring) * height.max(0.0) * clear,
            longwave: 225.0 + 60.0 * (1.0 - clear) + 3.0 * air,
            ..felt(air)
        });
    }
    hours
}

/// Takes the weather of each hour in steps, and checks what is missing of the heat in the end, beside the short wave that was taken
/// in. Most of it is what f32 drops of the soil's temperatures, a little in every step.
pub(super) fn assert_kept(trial: &mut Trial, hours: &[Felt]) {
    let steps = (3600.0 / trial.seconds) as u32;
    for felt in hours {
        for _ in 0..steps {
            trial.step(felt);
        }
    }
    let part = trial.missing() / trial.absorbed;
    let (size, seconds) = (trial.grid.cell_size, trial.seconds);
    println!("{size} m, {seconds} s: {part:.1e} of the short wave is missing");
    assert!(part.abs() < 0.06 / seconds, "{part:.1e} for {size} m, {seconds} s");
    assert!(trial.surface.runoff as f64 > 100.0 * crate::MASS_QUANTA, "it has melted");
    assert_eq!(i128::from(trial.column.mass()), trial.ledger);
}

#[test]
fn heat_is_kept_through_a_winter() {
    for (seed, cell_size, seconds) in
        [(1, 0.05, 900.0), (2, 0.02, 3600.0), (3, 0.1, 300.0), (4, 0.5, 900.0), (5, 0.2, 60.0)]
    {
        let height = (16.0_f64 / cell_size).min(255.0) as u32;
        let grid = Grid { width: 1, depth: 1, height, cell_size };
        let mut trial = Trial::new(grid, seconds, [2.0, 4.0, 6.0, 7.0], -5.0);
        assert_kept(&mut trial, &winter(150, seed));
    }
}

/// A cell of a mass \[kg/m²\], a thickness in quanta and a temperature \[°C\].
fn cell(mass: f64, thickness: u32, celsius: f32) -> Cell {
    let mass = ((mass * crate::MASS_QUANTA) as u32).max(1);
    Cell { mass, thickness, temperature: celsius, ..Cell::default() }
}

#[test]
fn a_sliver_of_snow_makes_no_heat() {
    let grid = Grid { width: 1, depth: 1, height: 50, cell_size: 0.05 };
    for sliver in [1, 3, 10, 100, 1000] {
        for celsius in [-31.7_f32, -12.3, -4.1] {
            let mut trial = Trial::new(grid, 900.0, [1.0; 4], -10.0);
            trial.column.cells = vec![cell(10.0, CELL, celsius), cell(0.0, sliver, celsius)];
            trial.step(&felt(f64::from(celsius)));
            let missing = trial.missing();
            assert!(missing.abs() < 30.0, "{sliver} quanta of {celsius} °C: {missing} J/m²");
        }
    }
}

#[test]
fn energy_beyond_the_last_snow_warms_ground_up_to_what_it_was_or_the_air_is() {
    let grid = Grid { width: 1, depth: 1, height: 50, cell_size: 0.05 };
    let sleet = Felt { snowfall: 0.5 / 3600.0, shortwave: 1000.0, ..felt(1.0) };
    for (before, expected) in [(50.0, 50.0), (0.5, 1.0)] {
        let mut trial = Trial::new(grid, 900.0, [before; 4], 1.0);
        // There is far more sun than melting it takes.
        trial.column.cells = vec![cell(0.3, CELL / 20, 0.0)];
        let stepped = trial.step(&sleet);
        assert!(stepped.exchange.runoff > 0 && trial.column.cells.is_empty());
        assert!((trial.surface.soil[0] - expected).abs() < 1e-3, "{:?}", trial.surface);
        assert!(trial.missing().abs() < 30.0, "{}", trial.missing());
    }
}
