//! A season at Col de Porte, as it was measured.

use super::energy::assert_kept;
use super::*;

const FORCING: &str =
    concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/cdp_0506/forcing.csv");

/// Weather of each hour; none where the field data are not at hand.
fn hours() -> Option<Vec<Felt>> {
    let text = std::fs::read_to_string(FORCING).ok()?;
    let hour = |line: &str| {
        let values: Vec<f64> = line.split(',').skip(1).map(|it| it.parse().unwrap()).collect();
        let &[shortwave, longwave, air, humidity, wind, pressure, snow, rain] = &values[..] else {
            panic!("{line}")
        };
        Felt {
            relative_humidity: humidity,
            wind_speed: wind,
            pressure: pressure / 100.0,
            snowfall: snow,
            rainfall: rain,
            shortwave,
            longwave,
            ..felt(air)
        }
    };
    Some(text.lines().skip(1).map(hour).collect())
}

#[test]
fn heat_is_kept_through_a_season_at_col_de_porte() {
    let Some(hours) = hours() else {
        println!("NOT TESTED: {FORCING} is not there");
        return;
    };
    for seconds in [900.0, 3600.0, 60.0] {
        let grid = Grid { width: 1, depth: 1, height: 255, cell_size: 0.05 };
        let air = hours[0].air_temperature;
        let mut trial = Trial::new(grid, seconds, [10.0, 11.0, 11.5, 11.5], air);
        assert_kept(&mut trial, &hours);
    }
}
