use proptest::prelude::*;
use serde::de::DeserializeOwned;

use super::*;
use crate::weather::tests::{any_row, any_weather};
use crate::weather::{HeightsAbove, Site, SunPosition};

const CALM: &str = r#""air_temperature": -3, "relative_humidity": 80, "wind_speed": 2"#;

/// What is said of a text that is refused, behind the path that the server would name.
fn wrong<T: DeserializeOwned>(json: &str) -> String {
    let mut json = serde_json::Deserializer::from_str(json);
    match serde_path_to_error::deserialize::<_, T>(&mut json) {
        Ok(_) => panic!("it was accepted"),
        Err(error) => error.to_string(),
    }
}

fn read<T: DeserializeOwned>(json: &str) -> T {
    serde_json::from_str(json).unwrap()
}

fn written_and_read<T: Serialize + DeserializeOwned>(value: &T) -> T {
    read(&serde_json::to_string(value).unwrap())
}

#[test]
fn a_weather_is_told_as_it_was_given() {
    let given =
        format!(r#"{{{CALM}, "sun": {{"azimuth": 180, "elevation": 30}}, "shortwave": null}}"#);
    let weather = Weather {
        sun: Some(SunPosition { azimuth: 180.0, elevation: 30.0 }),
        ..Weather::default()
    };
    assert_eq!(read::<Weather>(&given), weather);
    assert_eq!(read::<WeatherInput>(&given), WeatherInput::Steady(weather));
    assert_eq!(
        serde_json::to_string(&WeatherInput::from(Weather::default())).unwrap(),
        r#"{"air_temperature":-3.0,"relative_humidity":80.0,"wind_speed":2.0}"#
    );
}

#[test]
fn a_series_is_known_by_its_field() {
    let rows = format!(r#""series": [{{"at": 0, {CALM}}}, {{{CALM}, "at": 3600}}]"#);
    let series = |interpolate| {
        let row = |at| WeatherRow { at, weather: Weather::default() };
        WeatherSeries { series: vec![row(0.0), row(3600.0)], interpolate }
    };
    for (json, interpolate) in [
        (format!("{{{rows}}}"), false),
        (format!(r#"{{{rows}, "interpolate": true}}"#), true),
        (format!(r#"{{"interpolate": true, {rows}}}"#), true),
    ] {
        assert_eq!(read::<WeatherInput>(&json), WeatherInput::Series(series(interpolate)));
        assert_eq!(read::<WeatherSeries>(&json), series(interpolate));
    }
    assert!(wrong::<WeatherSeries>(&format!("{{{CALM}}}")).contains("missing field `series`"));
}

#[test]
fn errors_name_the_field_that_is_wrong() {
    let row = |row: &str| format!(r#"{{"series": [{{"at": 0, {CALM}}}, {row}]}}"#);
    let calm_and = |more: &str| format!("{{{CALM}, {more}}}");
    let humid = r#""at": 1, "air_temperature": 1, "relative_humidity""#;
    for (json, start) in [
        (row(&format!(r#"{{{humid}: "wet"}}"#)), "series[1].relative_humidity: invalid type"),
        (row(&format!(r#"{{{humid}: 5}}"#)), "series[1]: missing field `wind_speed`"),
        (row(&format!("{{{CALM}}}")), "series[1]: missing field `at`"),
        (row(&calm_and(r#""at": null"#)), "series[1].at: invalid type: null"),
        (row(&calm_and(r#""at": 1, "at": 2"#)), "series[1]: duplicate field `at`"),
        (row(&calm_and(r#""at": 1, "snow": 2"#)), "series[1]: unknown field `snow`"),
        (row(&calm_and(r#""at": 1, "wind_speed": 2"#)), "series[1]: duplicate field `wind_speed`"),
        (row(&calm_and(r#""at": 1, "series": []"#)), "series[1]: unknown field `series`"),
        (row("7"), "series[1]: invalid type: integer `7`, expected an object"),
        (calm_and(r#""at": 1"#), "unknown field `at`"),
        (calm_and(r#""series": []"#), "unknown field `series`"),
        (calm_and(r#""pressure": "low""#), "pressure: invalid type"),
        (calm_and(r#""sun": {"azimuth": 1}"#), "sun: missing field `elevation`"),
        (calm_and(r#""sun": {"azimuth": 1, "elevation": 1, "x": 1}"#), "sun.x: unknown field `x`"),
        (format!(r#"{{"series": [], {CALM}}}"#), "unknown field `air_temperature`"),
        (r#"{"series": [], "series": []}"#.to_owned(), "duplicate field `series`"),
        (r#"{"interpolate": true}"#.to_owned(), "missing field `series`"),
        (r#"{"interpolate": 1}"#.to_owned(), "interpolate: invalid type"),
        ("{}".to_owned(), "missing field `air_temperature`"),
        (r#"{"air_temperature": null}"#.to_owned(), "air_temperature: invalid type: null"),
        ("[]".to_owned(), "invalid type: sequence, expected an object"),
    ] {
        let error = wrong::<WeatherInput>(&json);
        assert!(error.starts_with(start), "{json}\n{error}");
    }
}

#[test]
fn a_site_has_defaults_and_tells_its_start_as_given() {
    assert_eq!(read::<Site>("{}"), Site::default());
    let json = r#"{"latitude":45.3,"longitude":5.77,"start":"2005-10-01T02:00:00+02:00",
        "temperature_height":1.5,"heights_above":"ground","soil":[10,11,11.5,11.5]}"#;
    let site = read::<Site>(json);
    assert_eq!(site.heights_above, HeightsAbove::Ground);
    assert_eq!(site.instant(60.0), Some(1_128_124_860.0));
    assert_eq!(written_and_read(&site), site);
    let text = serde_json::to_string(&site).unwrap();
    assert!(text.contains(r#""start":"2005-10-01T02:00:00+02:00""#), "{text}");
    for (json, start) in [
        (
            r#"{"start": "yesterday"}"#,
            "start: invalid value: string \"yesterday\", expected a time",
        ),
        (r#"{"start": 5}"#, "start: invalid type: integer `5`, expected a string"),
        (r#"{"altitude": 5}"#, "altitude: unknown field"),
        (r#"{"soil": [1, 2, 3]}"#, "soil: invalid length 3"),
        (r#"{"heights_above": "sea"}"#, "heights_above: unknown variant `sea`"),
    ] {
        let error = wrong::<Site>(json);
        assert!(error.starts_with(start), "{json}\n{error}");
    }
}

#[cfg(feature = "schema")]
#[test]
fn a_row_is_a_weather_with_a_time() {
    use utoipa::PartialSchema;

    let fields = |schema: serde_json::Value| {
        let properties = schema["properties"].as_object().unwrap();
        let mut names: Vec<String> = properties.keys().cloned().collect();
        names.sort();
        (names, schema["required"].as_array().unwrap().len())
    };
    let (weather, needed) = fields(serde_json::to_value(Weather::schema()).unwrap());
    let (mut row, needed_of_row) = fields(serde_json::to_value(WeatherRow::schema()).unwrap());
    row.retain(|name| name != "at");
    assert_eq!((row, needed_of_row), (weather, needed + 1));
    assert_eq!(needed, 3);
}

proptest! {
    #[test]
    fn what_is_written_is_read(
        weather in any_weather(),
        rows in prop::collection::vec(any_row(), 1..5),
        interpolate: bool,
    ) {
        let steady = WeatherInput::Steady(weather);
        prop_assert_eq!(&written_and_read(&steady), &steady);
        let series = WeatherInput::Series(WeatherSeries { series: rows, interpolate });
        prop_assert_eq!(&written_and_read(&series), &series);
    }
}
