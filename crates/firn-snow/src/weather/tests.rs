use proptest::option;
use proptest::prelude::*;

use super::*;

/// Weather in which every value is within its range, with or without radiation.
pub(super) fn any_weather() -> impl Strategy<Value = Weather> {
    let air = (-60.0..=50.0, 0.0..=100.0, 0.0..=100.0);
    let more = (option::of(0.0..=360.0), option::of(300.0..=1100.0), option::of(0.0..=1.0));
    let falls = prop_oneof![
        (option::of(0.0..=1000.0), option::of(0.0..=1000.0), Just(None)),
        (Just(None), Just(None), option::of(0.0..=1000.0)),
    ];
    let radiation = (option::of(0.0..=2000.0), option::of(0.0..=1000.0));
    let sun = option::of((0.0..=360.0, -90.0..=90.0))
        .prop_map(|sun| sun.map(|(azimuth, elevation)| SunPosition { azimuth, elevation }));
    (air, more, falls, radiation, sun).prop_map(|(air, more, falls, radiation, sun)| Weather {
        air_temperature: air.0,
        relative_humidity: air.1,
        wind_speed: air.2,
        wind_direction: more.0,
        pressure: more.1,
        cloud_cover: more.2,
        snowfall: falls.0,
        rainfall: falls.1,
        precipitation: falls.2,
        shortwave: radiation.0,
        longwave: radiation.1,
        sun,
    })
}

pub(super) fn any_row() -> impl Strategy<Value = WeatherRow> {
    (0.0..1e9, any_weather()).prop_map(|(at, weather)| WeatherRow { at, weather })
}

/// Col de Porte, from the first of October 2005.
fn porte() -> Site {
    Site {
        latitude: Some(45.3),
        longitude: Some(5.77),
        start: Start::parse("2005-10-01T00:00:00Z"),
        pressure: 870.0,
        ..Site::default()
    }
}

fn refused(check: Result<(), Problem>, field: &str, says: &str) {
    let problem = check.unwrap_err();
    assert_eq!(problem.field, field, "{problem}");
    assert!(problem.message.contains(says), "{problem}");
}

fn row(at: f64, air_temperature: f64) -> WeatherRow {
    let weather = Weather { air_temperature, shortwave: Some(0.0), ..Weather::default() };
    WeatherRow { at, weather }
}

#[test]
fn values_outside_their_ranges_are_refused() {
    let calm = Weather { shortwave: Some(100.0), ..Weather::default() };
    let site = Site::default();
    assert_eq!(calm.check(&site), Ok(()));
    for (weather, field, says) in [
        (
            Weather { air_temperature: -60.1, ..calm },
            "air_temperature",
            "-60 to 50 °C, found -60.1",
        ),
        (Weather { air_temperature: f64::NAN, ..calm }, "air_temperature", "found NaN"),
        (
            Weather { relative_humidity: 101.0, ..calm },
            "relative_humidity",
            "0 to 100 %, found 101",
        ),
        (Weather { wind_speed: -1.0, ..calm }, "wind_speed", "0 to 100 m/s"),
        (Weather { wind_direction: Some(361.0), ..calm }, "wind_direction", "degrees"),
        (Weather { pressure: Some(87_480.0), ..calm }, "pressure", "300 to 1100 hPa"),
        (Weather { snowfall: Some(-0.1), ..calm }, "snowfall", "mm/h"),
        (Weather { rainfall: Some(f64::INFINITY), ..calm }, "rainfall", "found inf"),
        (Weather { precipitation: Some(1001.0), ..calm }, "precipitation", "0 to 1000"),
        (Weather { shortwave: Some(2001.0), ..calm }, "shortwave", "W/m²"),
        (Weather { longwave: Some(-1.0), ..calm }, "longwave", "W/m²"),
        (Weather { cloud_cover: Some(8.0), ..calm }, "cloud_cover", "expected 0 to 1, found 8"),
    ] {
        refused(weather.check(&site), field, says);
    }
    let sun = SunPosition { azimuth: 0.0, elevation: 91.0 };
    let problem = Weather { sun: Some(sun), ..calm }.check(&site).unwrap_err();
    assert_eq!(
        (problem.field.as_str(), problem.pointer().as_str()),
        ("sun.elevation", "/sun/elevation")
    );
}

#[test]
fn precipitation_beside_its_parts_is_refused() {
    let all = Weather { shortwave: Some(0.0), precipitation: Some(1.0), ..Weather::default() };
    let site = Site::default();
    assert_eq!(all.check(&site), Ok(()));
    refused(Weather { snowfall: Some(0.0), ..all }.check(&site), "precipitation", "`snowfall`");
    refused(Weather { rainfall: Some(1.0), ..all }.check(&site), "precipitation", "`rainfall`");
}

#[test]
fn short_wave_needs_a_sun_where_it_is_not_given() {
    let weather = Weather::default();
    refused(weather.check(&Site::default()), "shortwave", "`latitude`, `longitude`, `start`");
    refused(
        weather.check(&Site { start: None, ..porte() }),
        "shortwave",
        "lacks, which is `start`",
    );
    assert_eq!(weather.check(&porte()), Ok(()));
    let sun = Some(SunPosition { azimuth: 180.0, elevation: 30.0 });
    assert_eq!(Weather { sun, ..weather }.check(&Site::default()), Ok(()));
}

#[test]
fn series_are_refused_by_row() {
    let check = |series| {
        WeatherInput::Series(WeatherSeries { series, interpolate: false }).check(&Site::default())
    };
    assert_eq!(check(vec![row(0.0, 1.0), row(0.5, 1.0)]), Ok(()));
    refused(check(vec![]), "series", "found 0");
    refused(check(vec![row(0.0, 1.0); MOST_ROWS + 1]), "series", "found 20001");
    refused(check(vec![row(5.0, 1.0), row(5.0, 1.0)]), "series[1].at", "more than the 5 s");
    refused(check(vec![row(5.0, 1.0), row(4.0, 1.0)]), "series[1].at", "found 4");
    refused(check(vec![row(-1.0, 1.0)]), "series[0].at", "0 or more");
    refused(check(vec![row(f64::NAN, 1.0)]), "series[0].at", "found NaN");
    refused(check(vec![row(0.0, 1.0), row(1.0, 99.0)]), "series[1].air_temperature", "found 99");
    let bare = WeatherRow { at: 9.0, weather: Weather::default() };
    let problem = check(vec![row(0.0, 1.0), bare]).unwrap_err();
    assert_eq!(problem.pointer(), "/series/1/shortwave");
}

#[test]
fn sites_outside_the_earth_are_refused() {
    assert_eq!((porte().check(), Site::default().check()), (Ok(()), Ok(())));
    let site = Site::default();
    refused(Site { latitude: Some(91.0), ..porte() }.check(), "latitude", "-90 to 90");
    refused(Site { longitude: None, ..porte() }.check(), "longitude", "beside `latitude`");
    refused(Site { pressure: 101_325.0, ..site.clone() }.check(), "pressure", "hPa");
    refused(Site { wind_height: 0.0, ..site.clone() }.check(), "wind_height", "0.5 to 100 m");
    refused(Site { soil: [0.0, 0.0, f64::NAN, 0.0], ..site }.check(), "soil[2]", "found NaN");
}

#[test]
fn rows_hold_from_their_time_on() {
    let series = vec![row(10.0, -5.0), row(20.0, 5.0)];
    let mut series = WeatherSeries { series, interpolate: false };
    let temperatures = |series: &WeatherSeries| {
        [0.0, 10.0, 15.0, 19.9, 20.0, 1e9].map(|time| series.at(time).air_temperature)
    };
    assert_eq!(temperatures(&series), [-5.0, -5.0, -5.0, -5.0, 5.0, 5.0]);
    series.interpolate = true;
    let expected = [-5.0, -5.0, 0.0, 4.9, 5.0, 5.0];
    for (found, expected) in temperatures(&series).into_iter().zip(expected) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
    assert_eq!(WeatherSeries::default().at(1.0), Weather::default());
}

#[test]
fn what_one_row_tells_holds_and_angles_turn_the_short_way() {
    let (mut from, mut to) = (row(0.0, 0.0), row(100.0, 0.0));
    from.weather.wind_direction = Some(350.0);
    to.weather.wind_direction = Some(30.0);
    from.weather.sun = Some(SunPosition { azimuth: 20.0, elevation: 10.0 });
    to.weather.sun = Some(SunPosition { azimuth: 340.0, elevation: 20.0 });
    from.weather.precipitation = Some(2.0);
    to.weather.snowfall = Some(4.0);
    let between = WeatherSeries { series: vec![from, to], interpolate: true }.at(50.0);
    assert_eq!(between.wind_direction, Some(10.0));
    assert_eq!(between.sun, Some(SunPosition { azimuth: 0.0, elevation: 15.0 }));
    assert_eq!((between.precipitation, between.snowfall), (Some(2.0), None));
}

#[test]
fn what_is_given_is_felt_as_it_is() {
    let weather = Weather {
        snowfall: Some(3.6),
        rainfall: Some(7.2),
        pressure: Some(900.0),
        shortwave: Some(150.0),
        longwave: Some(280.0),
        ..Weather::default()
    };
    let felt = weather.felt(&Site::default(), 0.0);
    assert_eq!((felt.snowfall, felt.rainfall, felt.pressure), (0.001, 0.002, 900.0));
    assert_eq!((felt.shortwave, felt.longwave), (150.0, 280.0));
    assert_eq!((felt.diffuse, felt.sun, felt.derived), (1.0, None, Derived::default()));
    let felt = weather.felt(&porte(), 43_200.0);
    assert!(felt.sun.is_some() && (0.8..1.0).contains(&felt.diffuse), "{felt:?}");
}

#[test]
fn what_is_missing_is_worked_out() {
    let clear = Weather::default().felt(&porte(), 43_200.0);
    assert_eq!(clear.derived, Derived { shortwave: true, longwave: true });
    assert_eq!(clear.pressure, 870.0);
    // Noon in October: the sun at 41.5°.
    assert!((640.0..690.0).contains(&clear.shortwave), "{clear:?}");
    assert!(clear.diffuse < 0.3, "{clear:?}");
    let storm = Weather { precipitation: Some(5.0), ..Weather::default() }.felt(&porte(), 43_200.0);
    assert!((storm.shortwave / clear.shortwave - 0.25).abs() < 1e-9, "overcast while it snows");
    assert!(storm.longwave > clear.longwave + 60.0 && storm.diffuse > 0.95, "{storm:?}");
    let night = Weather::default().felt(&porte(), 0.0);
    assert_eq!((night.shortwave, night.diffuse), (0.0, 1.0));
    assert_eq!(night.longwave, clear.longwave);
}

proptest! {
    #[test]
    fn every_weather_that_is_accepted_can_be_felt(weather in any_weather(), time in 0.0..1e10) {
        for site in [porte(), Site::default()] {
            if weather.check(&site).is_err() {
                prop_assert!(weather.shortwave.is_none() && weather.sun.is_none());
                prop_assert_eq!(site, Site::default());
                continue;
            }
            let felt = weather.felt(&site, time);
            prop_assert!((0.0..=2000.0).contains(&felt.shortwave));
            prop_assert!((0.0..=1000.0).contains(&felt.longwave));
            prop_assert!((0.0..=1.0).contains(&felt.diffuse));
            prop_assert!((300.0..=1100.0).contains(&felt.pressure));
            prop_assert!(felt.snowfall >= 0.0 && felt.rainfall >= 0.0);
            prop_assert!(felt.snowfall + felt.rainfall <= 2000.0 / 3600.0);
        }
    }

    #[test]
    fn what_lies_between_rows_is_accepted_as_they_are(
        rows in prop::collection::vec(any_weather(), 1..6),
        interpolate: bool,
        time in -100.0..700.0,
    ) {
        let rows = rows.into_iter().enumerate();
        let series = rows.map(|(i, weather)| WeatherRow { at: 100.0 * i as f64, weather }).collect();
        let input = WeatherInput::Series(WeatherSeries { series, interpolate });
        prop_assert_eq!(input.check(&porte()), Ok(()));
        prop_assert_eq!(input.at(time).check(&porte()), Ok(()));
    }
}
