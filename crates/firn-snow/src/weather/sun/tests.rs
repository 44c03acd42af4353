use proptest::prelude::*;

use super::*;
use crate::weather::Start;

fn instant(text: &str) -> f64 {
    Start::parse(text).unwrap().instant()
}

/// The highest elevation of a day [°], and its instant.
fn noon(latitude: f64, longitude: f64, day: &str) -> (f64, f64) {
    let midnight = instant(&format!("{day}T00:00:00Z"));
    let seconds = (0..8640).map(|i| midnight + 10.0 * f64::from(i));
    let elevations = seconds.map(|at| (sun_position(latitude, longitude, at).elevation, at));
    elevations.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
}

/// When the sun is on the horizon between two instants, by halving.
fn horizon(latitude: f64, longitude: f64, mut from: f64, mut to: f64) -> f64 {
    let above = |at| sun_position(latitude, longitude, at).elevation > 0.0;
    let rising = above(to);
    while to - from > 0.01 {
        let middle = f64::midpoint(from, to);
        if above(middle) == rising { to = middle } else { from = middle }
    }
    to
}

#[test]
fn it_stands_where_the_solar_position_algorithm_has_it() {
    // The worked example of NREL's SPA (Reda and Andreas 2004), before refraction.
    let sun = sun_position(39.742_476, -105.178_6, instant("2003-10-17T12:30:30-07:00"));
    assert!((sun.elevation - 39.872).abs() < 0.01, "{sun:?}");
    assert!((sun.azimuth - 194.340).abs() < 0.01, "{sun:?}");
}

#[test]
fn noons_of_the_solstices_are_as_high_as_the_tropics_say() {
    for (latitude, longitude) in [(45.30, 5.77), (46.83, 9.81), (0.0, 0.0), (-44.0, 170.0)] {
        for (day, tropic) in [("2005-06-21", 23.44), ("2005-12-21", -23.44)] {
            let (highest, _) = noon(latitude, longitude, day);
            let expected = 90.0 - f64::abs(latitude - tropic);
            assert!((highest - expected).abs() < 0.02, "{latitude} {day}: {highest}");
        }
    }
    let (equinox, _) = noon(45.3, 5.77, "2006-03-20");
    assert!((equinox - 44.7).abs() < 0.3, "{equinox}");
}

#[test]
fn sundials_are_ahead_in_november_and_behind_in_february() {
    for (day, minutes) in
        [("2005-11-03", 16.43), ("2006-02-11", -14.24), ("2006-04-15", 0.0), ("2006-09-01", 0.0)]
    {
        let equation = Orbit::at(instant(&format!("{day}T12:00:00Z"))).equation_of_time;
        assert!((equation - minutes).abs() < 0.25, "{day}: {equation}");
        let (_, at) = noon(45.0, 0.0, day);
        let clock = (at.rem_euclid(DAY) - DAY / 2.0) / 60.0;
        assert!((clock + minutes).abs() < 0.4, "{day}: noon {clock} min after 12");
    }
}

#[test]
fn it_rises_as_long_before_noon_as_it_sets_after() {
    for day in ["2005-12-21", "2006-06-21"] {
        let (latitude, longitude) = (45.3, 5.77);
        let (_, noon) = noon(latitude, longitude, day);
        let rise = horizon(latitude, longitude, noon - DAY / 2.0, noon);
        let set = horizon(latitude, longitude, noon, noon + DAY / 2.0);
        assert!((noon - rise - (set - noon)).abs() < 60.0, "{rise} {noon} {set}");
        let east = sun_position(latitude, longitude, rise).azimuth;
        let west = sun_position(latitude, longitude, set).azimuth;
        assert!((east + west - 360.0).abs() < 0.1 && east < 180.0, "{east} {west}");
    }
}

#[test]
fn directions_are_those_of_the_grid() {
    let direction = |azimuth, elevation| SunPosition { azimuth, elevation }.direction();
    for (found, expected) in [
        (direction(0.0, 0.0), [0.0, 0.0, 1.0]),
        (direction(90.0, 0.0), [1.0, 0.0, 0.0]),
        (direction(123.0, 90.0), [0.0, 1.0, 0.0]),
    ] {
        for axis in 0..3 {
            assert!((found[axis] - expected[axis]).abs() < 1e-12, "{found:?} {expected:?}");
        }
    }
    assert_eq!(SunPosition { azimuth: 0.0, elevation: -20.0 }.height(), 0.0);
}

#[test]
fn it_is_nearest_in_january() {
    let january = solar_irradiance(instant("2006-01-04T12:00:00Z"));
    let july = solar_irradiance(instant("2006-07-03T12:00:00Z"));
    assert!((january / SOLAR_CONSTANT - 1.0344).abs() < 5e-4, "{january}");
    assert!((july / SOLAR_CONSTANT - 0.9672).abs() < 5e-4, "{july}");
}

proptest! {
    #[test]
    fn it_is_somewhere_everywhere_and_always(
        latitude in -90.0..=90.0,
        longitude in -180.0..=180.0,
        instant in -6e10..2.5e11,
    ) {
        let sun = sun_position(latitude, longitude, instant);
        prop_assert!((-90.0..=90.0).contains(&sun.elevation));
        prop_assert!((0.0..=360.0).contains(&sun.azimuth));
        let [x, y, z] = sun.direction();
        prop_assert!((x * x + y * y + z * z - 1.0).abs() < 1e-12);
    }
}
