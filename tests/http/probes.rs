//! Probes over HTTP: they foretell what colliders do, and name what can't be answered.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::{Server, numbers};

on_each_backend!(
    probes_foretell_how_deep_colliders_sink,
    a_probe_leaves_other_objects_and_the_snow_alone,
    a_probe_of_a_duration_foretells_what_a_collider_does_in_it,
    where_snow_is_pressed_a_foot_is_down_at_once_and_as_deep_as_foretold,
    snow_carries_up_to_its_hardness,
    bad_probes_are_refused_by_name,
);

/// 4 m × 4 m with a weak layer, in cycles of 0.25 s.
fn layered() -> Value {
    json!({
        "grid": {"width": 20, "depth": 20, "height": 30, "cell_size": 0.2},
        "paused": true,
        "time_scale": 15,
        "initial_snow": [
            {"depth": 2.0, "temperature": -3},
            {"depth": 0.6, "temperature": -15, "density": 30},
            {"depth": 1.4, "temperature": -5, "density": 40}
        ]
    })
}

async fn settle(server: &Server, session: &str) {
    let step = json!({"until_settled": true, "max_seconds": 100_000});
    let settled = server.post(&format!("{session}/step"), step).await.expect(200);
    assert_eq!(settled["settled"], true);
}

async fn probe(server: &Server, session: &str, probes: Value) -> Value {
    server.post(&format!("{session}/probes"), json!({ "probes": probes })).await.expect(200)
}

fn sink_depth(view: &Value) -> f64 {
    view["sink_depth"].as_f64().expect("a number")
}

/// Snow depths where the plates stand.
async fn depths(server: &Server, session: &str) -> Vec<f64> {
    let points = PLATES.map(|(x, z, ..)| [x, z]);
    let body = json!({"points": points, "fields": ["depth"]});
    let told = server.post(&format!("{session}/samples"), body).await.expect(200);
    numbers(&told["fields"]["depth"])
}

/// Plates far enough apart to share no column: side and mass.
const PLATES: [(f64, f64, f64, f64); 4] =
    [(0.7, 0.7, 1.2, 1500.0), (3.1, 0.7, 0.4, 30.0), (0.7, 3.1, 0.1, 80.0), (3.1, 3.1, 1.0, 5.0)];

async fn probes_foretell_how_deep_colliders_sink(backend: BackendChoice) {
    let server = Server::start(backend).await;
    for settled_before in [true, false] {
        let session = server.create(layered()).await;
        if settled_before {
            settle(&server, &session).await;
        }
        let probes = PLATES
            .map(|(x, z, side, mass)| json!({"x": x, "z": z, "mass": mass, "area": side * side}));
        let foretold = probe(&server, &session, json!(probes)).await;
        let put: Vec<Value> = PLATES
            .iter()
            .enumerate()
            .map(|(i, (x, z, side, mass))| {
                json!({"id": i.to_string(), "mass": mass, "position": {"x": x, "z": z},
                       "shape": {"type": "box", "width": side, "depth": side}})
            })
            .collect();
        server.post(&format!("{session}/colliders:batch"), json!({ "put": put })).await.expect(200);
        settle(&server, &session).await;
        for (i, foretold) in foretold["probes"].as_array().expect("a list").iter().enumerate() {
            let collider = server.get(&format!("{session}/colliders/{i}")).await.expect(200);
            let (foretold, reached) = (sink_depth(foretold), sink_depth(&collider));
            // The promise is 1 % or 3 mm.
            assert!((foretold - reached).abs() < 1e-4, "plate {i}: {foretold} is not {reached} m");
            assert!(reached > 0.002, "plate {i} sinks");
        }
    }
    server.stop().await;
}

async fn a_probe_of_a_duration_foretells_what_a_collider_does_in_it(backend: BackendChoice) {
    let server = Server::start(backend).await;
    for settled_before in [true, false] {
        for duration in [0.0, 0.5, 4.0] {
            let session = server.create(layered()).await;
            if settled_before {
                settle(&server, &session).await;
            }
            let load = |(x, z, side, mass): (f64, f64, f64, f64)| json!({"x": x, "z": z, "mass": mass, "area": side * side, "duration": duration});
            let foretold = probe(&server, &session, json!(PLATES.map(load))).await;
            let before = depths(&server, &session).await;
            let put = PLATES.map(|(x, z, side, mass)| {
                json!({"mass": mass, "id": format!("{}", x + 10.0 * z).replace('.', "-"),
                       "position": {"x": x, "z": z},
                       "shape": {"type": "box", "width": side, "depth": side}})
            });
            let batch = format!("{session}/colliders:batch");
            server.post(&batch, json!({ "put": put })).await.expect(200);
            if duration > 0.0 {
                // Ticks of 0.25 s.
                server.step(&session, (duration / 0.25) as u64).await;
            }
            let after = depths(&server, &session).await;
            for (i, foretold) in foretold["probes"].as_array().expect("a list").iter().enumerate() {
                let (foretold, reached) = (sink_depth(foretold), before[i] - after[i]);
                assert!((foretold - reached).abs() < 1e-4, "{i}: {foretold} is not {reached} m");
                assert_eq!(reached > 0.0, duration > 0.0, "{i}: {reached} m");
            }
        }
    }
    server.stop().await;
}

async fn where_snow_is_pressed_a_foot_is_down_at_once_and_as_deep_as_foretold(
    backend: BackendChoice,
) {
    let server = Server::start(backend).await;
    let grid = json!({"width": 8, "depth": 8, "height": 20, "cell_size": 0.2});
    let game =
        json!({"preset": "game", "grid": grid, "paused": true, "initial_snow": [{"depth": 1}]});
    let creeping = |mut body: Value| {
        body["pressing"] = json!("creep");
        body
    };
    for (body, patched) in [(game.clone(), false), (creeping(game), true)] {
        // It carries itself from the start.
        let session = server.create(body).await;
        let shape = json!({"type": "box", "width": 0.2, "depth": 0.15});
        let foot = json!({"mass": 80, "position": {"x": 0.7, "z": 0.7}, "shape": shape});
        let at = json!({"x": 0.7, "z": 0.7, "mass": 80, "area": 0.03});
        let depth = async || {
            let body = json!({"points": [[0.7, 0.7]], "fields": ["depth"]});
            let told = server.post(&format!("{session}/samples"), body).await.expect(200);
            numbers(&told["fields"]["depth"])[0]
        };
        if patched {
            // It stands there and creeps, and is pressed from then on.
            server.post(&format!("{session}/colliders"), foot.clone()).await.expect(201);
            server.step(&session, 24).await;
            let crept = probe(&server, &session, json!([at])).await;
            server.patch(&session, json!({"pressing": 0.25})).await.expect(200);
            let pressed = probe(&server, &session, json!([at])).await;
            for foretold in [crept, pressed] {
                assert!(sink_depth(&foretold["probes"][0]) > 0.1, "it has hardly begun");
            }
        }
        let before = depth().await;
        let mut probes = Vec::new();
        for duration in [json!(0.1), json!(0.4), json!(2), json!(null)] {
            let mut probe = at.clone();
            probe["duration"] = duration;
            probes.push(probe);
        }
        let foretold = probe(&server, &session, json!(probes)).await;
        if !patched {
            server.post(&format!("{session}/colliders"), foot).await.expect(201);
        }
        for (i, ticks) in [6, 18, 96, 120].into_iter().enumerate() {
            server.step(&session, ticks).await;
            let (foretold, reached) = (sink_depth(&foretold["probes"][i]), before - depth().await);
            assert!((foretold - reached).abs() < 0.005, "{i}: {foretold} is not {reached} m");
        }
        let view = server.get(&session).await.expect(200);
        assert_eq!((&view["settled"], &view["summary"]["active_tiles"]), (&json!(true), &json!(0)));
        let collider = server.get(&format!("{session}/colliders")).await.expect(200);
        assert_eq!(collider["items"][0]["resting"], true);
    }
    server.stop().await;
}

async fn a_probe_leaves_other_objects_and_the_snow_alone(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(layered()).await;
    let load = json!({"x": 2.0, "z": 2.0, "mass": 75, "area": 0.05});
    let alone = probe(&server, &session, json!([load])).await;
    let collider = json!({"mass": 500, "position": {"x": 2.0, "z": 2.0},
                          "shape": {"type": "disk", "radius": 0.5}});
    server.post(&format!("{session}/colliders"), collider).await.expect(201);
    let before = server.heights(&session).await;
    let beside = probe(&server, &session, json!([load, load])).await;
    assert_eq!(beside["probes"], json!([alone["probes"][0], alone["probes"][0]]));
    assert_eq!(server.heights(&session).await, before);
    let shown = server.get(&session).await.expect(200);
    assert_eq!((&beside["tick"], &beside["seq"]), (&shown["tick"], &shown["seq"]));
    server.stop().await;
}

async fn snow_carries_up_to_its_hardness(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(crate::support::small()).await;
    let region = json!({"x": 0, "z": 0, "width": 1.0, "depth": 1.4});
    let bare = json!({"depth": 0, "region": region});
    server.post(&format!("{session}/clearings"), bare).await.expect(200);
    let at = |x: f64, pressure: f64| json!({"x": x, "z": 1.4, "mass": pressure * 2.0 / 9.81, "area": 2.0});
    let loads = json!([at(2.0, 367.0), at(2.0, 368.0), at(0.5, 1.0)]);
    let reply = probe(&server, &session, loads).await;
    let probes = reply["probes"].as_array().expect("a list");
    let hardness = probes[0]["surface_hardness"].as_f64().expect("a number");
    assert!((hardness - 367.72).abs() < 0.01, "the model page's hardness, {hardness}");
    assert!((probes[0]["pressure"].as_f64().expect("a number") - 367.0).abs() < 1e-9);
    assert_eq!((&probes[0]["carries"], &probes[1]["carries"]), (&json!(true), &json!(false)));
    let nothing =
        json!({"sink_depth": 0.0, "surface_hardness": 0.0, "pressure": 1.0, "carries": false});
    assert_eq!(probes[2], nothing, "bare ground");
    server.stop().await;
}

async fn bad_probes_are_refused_by_name(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(crate::support::small()).await;
    let good = json!({"x": 2.0, "z": 1.4, "mass": 1e9, "area": 1e-6});
    let path = format!("{session}/probes");
    let pointers = async |body: Value| server.post(&path, body).await.pointers(422);
    let with = |field: &str, value: Value| {
        let mut bad = good.clone();
        bad[field] = value;
        json!({"probes": [good, good, good, bad]})
    };
    for (field, value) in [
        ("x", json!(2.001)),
        ("x", json!(-0.001)),
        ("z", json!(1.401)),
        ("z", json!(1e300)),
        ("mass", json!(0)),
        ("mass", json!(-1)),
        ("mass", json!(1.1e9)),
        ("area", json!(0)),
        ("area", json!(-2)),
        ("area", json!(1e-9)),
        ("area", json!(1e13)),
        ("area", json!("wide")),
        ("area", json!(null)),
        ("duration", json!(-1)),
        ("duration", json!(3601)),
        ("depth", json!(1)),
    ] {
        assert_eq!(pointers(with(field, value)).await, [format!("/probes/3/{field}")]);
    }
    let worse = json!({"probes": [{"x": -1, "z": 9, "mass": 0, "area": 0}]});
    let all = ["/probes/0/x", "/probes/0/z", "/probes/0/mass", "/probes/0/area"];
    assert_eq!(pointers(worse).await, all);
    assert_eq!(pointers(json!({"probes": [{"x": 1, "z": 1, "mass": 1}]})).await, [all[3]]);
    for count in [0, 1025] {
        assert_eq!(pointers(json!({"probes": vec![&good; count]})).await, ["/probes"]);
    }
    assert_eq!(pointers(json!({})).await, ["/probes"]);
    let most = server.post(&path, json!({"probes": vec![&good; 1024]})).await.expect(200);
    assert_eq!(most["probes"].as_array().map(Vec::len), Some(1024));
    server.post("/v1/sessions/none/probes", json!({"probes": [good]})).await.problem(404);
    server.stop().await;
}
