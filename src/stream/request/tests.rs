use firn_protocol::stream::Command;
use firn_protocol::{
    ColumnRegion, EventKind, Events, Probe, Resume, SampleField, Weather, WeatherRow, WeatherSeries,
};
use firn_snow::{Position, Shape};

use super::*;

fn refused(text: &str) -> (Option<i64>, u16, String) {
    let Err(refusal) = Request::parse(text) else { panic!("{text} was accepted") };
    let pointer = refusal.problem.errors.first().map(|error| error.pointer.clone());
    (refusal.id, refusal.problem.status, pointer.unwrap_or_default())
}

fn at(id: Option<i64>, status: u16, pointer: &str) -> (Option<i64>, u16, String) {
    (id, status, pointer.to_owned())
}

#[test]
fn a_subscription_has_defaults() {
    let request = Request::parse(r#"{"op":"subscribe","id":3}"#);
    let expected = Subscribe { max_rate: 20.0, quantum: 0.001, ..Subscribe::default() };
    assert_eq!(request, Ok(Request::Control(Control::Subscribe(3, expected))));
}

#[test]
fn a_subscription_takes_every_field() {
    let request = Request::parse(
        r#"{"op":"subscribe","id":-1,"stride":4,"max_rate":0.5,"quantum":0.01,
            "region":{"column_x":-8,"column_z":16,"width":9,"depth":1},"colliders":true,
            "terrain":true,"events":["clearing","settled"],"watch":[{"id":"a","above":0.5},{"id":"b",
            "region":{"column_x":-8,"column_z":16,"width":9,"depth":1},"below":0}],
            "resume":{"epoch":"e","seq":7}}"#,
    );
    let region = Some(ColumnRegion { column_x: -8, column_z: 16, width: 9, depth: 1 });
    let expected = Subscribe {
        region,
        stride: 4,
        max_rate: 0.5,
        quantum: 0.01,
        colliders: true,
        terrain: true,
        events: Some(Events::from_iter([EventKind::Settled, EventKind::Clearing])),
        watch: vec![
            DepthWatch { id: "a".to_owned(), above: Some(0.5), ..DepthWatch::default() },
            DepthWatch { id: "b".to_owned(), region, below: Some(0.0), ..DepthWatch::default() },
        ],
        resume: Some(Resume { epoch: "e".to_owned(), seq: 7 }),
    };
    assert_eq!(request, Ok(Request::Control(Control::Subscribe(-1, expected))));
}

#[test]
fn changes_carry_the_body_of_their_rest_call() {
    let collider = ColliderSpec {
        id: Some("a".to_owned()),
        mass: 100.0,
        shape: Some(Shape::Disk { radius: 0.5 }),
        position: Position { x: 5.0, z: 6.0 },
        ..ColliderSpec::default()
    };
    let object =
        r#"{"id":"a","mass":100,"shape":{"type":"disk","radius":0.5},"position":{"x":5,"z":6}}"#;
    let cases = [
        (
            r#"{"op":"snowfall","id":1,"depth":0.5}"#.to_owned(),
            Change::Snowfall(Snowfall {
                depth: 0.5,
                density: None,
                temperature: None,
                region: None,
            }),
        ),
        (r#"{"op":"clearing","id":1,"depth":0}"#.to_owned(), Change::Clearing(Clearing::default())),
        (
            r#"{"op":"air_temperature","id":1,"celsius":-10}"#.to_owned(),
            Change::AirTemperature(AirTemperature { celsius: -10.0 }),
        ),
        (
            r#"{"op":"set","id":1,"paused":true,"delete_after_s":null}"#.to_owned(),
            Change::Settings(SettingsPatch {
                paused: Some(true),
                delete_after_s: Some(None),
                ..SettingsPatch::default()
            }),
        ),
        (
            format!(r#"{{"op":"collider.put","id":1,"collider":{object}}}"#),
            Change::PutCollider(collider.clone()),
        ),
        (
            r#"{"op":"collider.delete","id":1,"collider":"a"}"#.to_owned(),
            Change::DeleteCollider { id: "a".to_owned() },
        ),
        (
            format!(r#"{{"op":"colliders.batch","id":1,"put":[{object}],"delete":["b"]}}"#),
            Change::Colliders(ColliderBatch {
                put: vec![collider],
                delete: vec!["b".into()],
                ..ColliderBatch::default()
            }),
        ),
    ];
    for (text, expected) in cases {
        let Ok(Request::Change { id: 1, change, .. }) = Request::parse(&text) else {
            panic!("{text} was not read as a change");
        };
        assert_eq!(change, expected);
    }
}

#[test]
fn what_is_wrong_is_named_with_the_id_where_it_can_be_read() {
    assert_eq!(refused("hello"), at(None, 400, ""));
    assert_eq!(refused("[1]").1, 422);
    assert_eq!(refused(r#"{"op":"subscribe"}"#), at(None, 422, "/id"));
    assert_eq!(refused(r#"{"op":"subscribe","id":"a"}"#), at(None, 422, "/id"));
    assert_eq!(refused(r#"{"op":"subscribe","id":1.5}"#), at(None, 422, "/id"));
    assert_eq!(refused(r#"{"id":4}"#), at(Some(4), 422, "/op"));
    assert_eq!(refused(r#"{"op":"melt","id":4}"#), at(Some(4), 422, "/op"));
    assert_eq!(refused(r#"{"op":"ping","id":4,"a":1}"#), at(Some(4), 422, "/a"));
    assert_eq!(refused(r#"{"op":"snowfall","id":4}"#), at(Some(4), 422, "/depth"));
    assert_eq!(refused(r#"{"op":"snowfall","id":4,"depth":1e999}"#).1, 422);
    assert_eq!(
        refused(r#"{"op":"subscribe","id":4,"resume":{"epoch":"e"}}"#),
        at(Some(4), 422, "/resume/seq")
    );
    assert_eq!(
        refused(r#"{"op":"collider.put","id":4,"collider":{"mass":"heavy"}}"#),
        at(Some(4), 422, "/collider/mass")
    );
}

#[test]
fn a_ping_needs_no_id() {
    assert_eq!(Request::parse(r#"{"op":"ping"}"#), Ok(Request::Control(Control::Ping(None))));
}

#[test]
fn every_command_of_a_client_is_read() {
    let collider = ColliderSpec {
        id: Some("sledge".to_owned()),
        mass: 80.0,
        shape: Some(Shape::Disk { radius: 0.5 }),
        position: Position { x: 1.0, z: 2.0 },
        ..ColliderSpec::default()
    };
    let resume = Some(Resume { epoch: "e".to_owned(), seq: 7 });
    let wish =
        Subscribe { stride: 2, colliders: true, terrain: true, resume, ..Subscribe::default() };
    let region = Some(ColumnRegion { column_x: -1, column_z: 0, width: 8, depth: 9 });
    let watch = Some(vec![DepthWatch { id: "a".to_owned(), region, ..DepthWatch::default() }]);
    let update = Update { region, events: Some(Events::none()), watch };
    let snowfall = Snowfall::new(0.5);
    let (clearing, air) =
        (Clearing { depth: 0.1, ..Clearing::default() }, AirTemperature { celsius: -5.0 });
    let weather = Weather { rainfall: Some(1.5), ..Weather::default() };
    let rows = vec![WeatherRow { at: 60.0, weather }];
    let steady = WeatherInput::from(weather);
    let series = WeatherInput::Series(WeatherSeries { series: rows, interpolate: true });
    let settings = SettingsPatch { paused: Some(true), ..SettingsPatch::default() };
    let patch = ColliderPatch {
        position: Some(Position { x: 3.0, z: 2.0 }),
        turn_rate: Some(30.0),
        sweep: true,
        ..ColliderPatch::default()
    };
    let batch = ColliderBatch {
        put: vec![collider.clone()],
        delete: vec!["old".to_owned()],
        ..ColliderBatch::default()
    };
    let change = |change, at| Request::Change { id: 1, change, at };
    let delete = Change::DeleteCollider { id: "sledge".to_owned() };
    let read = |read| Request::Read { id: 1, read };
    let probe = Probe { x: 1.0, z: 2.0, mass: 80.0, area: 0.1, duration: Some(0.4) };
    let probes = ProbeBatch { probes: vec![probe] };
    let fields = vec![SampleField::Depth, SampleField::Sink];
    let samples = SampleBatch { points: vec![[1.0, 2.0]], fields, load: Some(probe.load()) };
    for (command, request) in [
        (
            Command::Subscribe { id: 1, wish: wish.clone() },
            Request::Control(Control::Subscribe(1, wish)),
        ),
        (
            Command::Update { id: 1, update: update.clone() },
            Request::Control(Control::Update(1, update)),
        ),
        (Command::Unsubscribe { id: 1 }, Request::Control(Control::Unsubscribe(1))),
        (Command::Ping { id: None }, Request::Control(Control::Ping(None))),
        (Command::Ping { id: Some(1) }, Request::Control(Control::Ping(Some(1)))),
        (Command::Snowfall { id: 1, snowfall }, change(Change::Snowfall(snowfall), "")),
        (
            Command::Clearing { id: 1, clearing: clearing.clone() },
            change(Change::Clearing(clearing), ""),
        ),
        (Command::AirTemperature { id: 1, air }, change(Change::AirTemperature(air), "")),
        (
            Command::Weather { id: 1, weather: steady.clone() },
            change(Change::Weather(steady.into()), ""),
        ),
        (
            Command::Weather { id: 1, weather: series.clone() },
            change(Change::Weather(series.into()), ""),
        ),
        (Command::Set { id: 1, settings }, change(Change::Settings(settings), "")),
        (
            Command::PutCollider { id: 1, collider: collider.clone() },
            change(Change::PutCollider(collider), "/collider"),
        ),
        (
            Command::PatchCollider { id: 1, collider: "sledge".to_owned(), patch: patch.clone() },
            change(Change::PatchCollider { id: "sledge".to_owned(), patch }, "/patch"),
        ),
        (
            Command::DeleteCollider { id: 1, collider: "sledge".to_owned() },
            change(delete, "/collider"),
        ),
        (Command::Colliders { id: 1, batch: batch.clone() }, change(Change::Colliders(batch), "")),
        (Command::Probes { id: 1, batch: probes.clone() }, read(Read::Probes(probes))),
        (Command::Samples { id: 1, batch: samples.clone() }, read(Read::Samples(samples))),
    ] {
        let text = serde_json::to_string(&command).unwrap();
        assert_eq!(Request::parse(&text), Ok(request), "{text}");
    }
}

#[test]
fn events_are_true_false_or_known_kinds() {
    let detail = |text: &str| match Request::parse(text) {
        Err(Refusal { problem, .. }) => {
            assert_eq!(problem.status, 422);
            (problem.errors[0].pointer.clone(), problem.errors[0].detail.clone())
        }
        Ok(request) => panic!("{request:?}"),
    };
    let (pointer, told) = detail(r#"{"op":"subscribe","id":1,"events":["settled","thaw"]}"#);
    assert_eq!(pointer, "/events/1");
    let kinds = "`snowfall`, `clearing`, `settings`, `weather`, `terrain`, `settled`, `step_progress`, `reset`";
    assert_eq!(told, format!("unknown variant `thaw`; known are {kinds}"));
    let (pointer, told) = detail(r#"{"op":"update","id":1,"events":"settled"}"#);
    assert_eq!(pointer, "/events");
    let expected = "expected true, false or an array of kinds of events";
    assert_eq!(told, format!(r#"{expected}, found the string "settled""#));
}

#[test]
fn a_request_names_at_most_sixteen_watches() {
    let watches = |count: usize| vec![r#"{"id":"a","above":1}"#; count].join(",");
    for op in ["subscribe", "update"] {
        let request = |count| format!(r#"{{"op":"{op}","id":1,"watch":[{}]}}"#, watches(count));
        assert!(Request::parse(&request(MOST_WATCHES)).is_ok());
        assert_eq!(refused(&request(MOST_WATCHES + 1)), at(Some(1), 422, "/watch"));
    }
}
