//! Stamps over HTTP: prints that loads press at once.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::Server;

on_each_backend!(
    a_print_is_as_deep_as_a_probe_says,
    nothing_stays_but_the_print,
    left_and_right_prints_hold_as_much,
    later_prints_find_what_earlier_left,
    a_print_is_made_once_for_a_key,
    prints_outlive_a_snapshot,
    what_is_no_stamp_is_refused,
);

/// Fresh snow, in which a foot leaves a print of some centimetres; 5 cm a column.
fn fresh() -> Value {
    json!({
        "preset": "game",
        "grid": {"width": 40, "depth": 40, "height": 30, "cell_size": 0.05},
        "paused": true,
        "initial_snow": [{"depth": 0.6, "density": 60, "temperature": -4}]
    })
}

fn foot(x: f64, heading: f64) -> Value {
    json!({"shape": {"type": "box", "width": 0.2, "depth": 0.3}, "mass": 80,
        "position": {"x": x, "z": 1.0}, "heading": heading})
}

async fn stamp(server: &Server, path: &str, stamps: Value) -> Value {
    server.post(&format!("{path}/stamps"), json!({ "stamps": stamps })).await.expect(200)
}

fn depth(reply: &Value, i: usize) -> f64 {
    reply["stamps"][i]["depth"].as_f64().unwrap()
}

async fn a_print_is_as_deep_as_a_probe_says(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(fresh()).await;
    let probe = json!({"probes": [{"x": 1.0, "z": 1.0, "mass": 80, "area": 0.06}]});
    let probe = server.post(&format!("{path}/probes"), probe).await.expect(200);
    let sink = probe["probes"][0]["sink_depth"].as_f64().unwrap();
    assert!(sink > 0.02, "{probe}");
    let before = server.heights(&path).await[20 * 40 + 20];
    let reply = stamp(&server, &path, json!([foot(1.0, 0.0)])).await;
    assert!((depth(&reply, 0) - sink).abs() < 0.005, "{reply} {probe}");
    let after = server.heights(&path).await[20 * 40 + 20];
    assert!((before - after - depth(&reply, 0)).abs() < 1e-6, "the whole column is covered");
    assert!((reply["stamps"][0]["bottom"].as_f64().unwrap() - after).abs() < 1e-6);

    let mut pressed = foot(0.4, 0.0);
    pressed["mass"] = Value::Null;
    pressed["pressure"] = json!(80.0 * 9.81 / 0.06);
    let alike = stamp(&server, &path, json!([pressed])).await;
    assert!((depth(&alike, 0) - depth(&reply, 0)).abs() < 1e-6, "{alike} {reply}");
    server.stop().await;
}

async fn nothing_stays_but_the_print(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(fresh()).await;
    server.step(&path, 600).await;
    let mass = server.get(&format!("{path}/mass")).await.expect(200);
    let before = server.heights(&path).await;
    let reply = stamp(&server, &path, json!([foot(1.0, 0.0), foot(0.4, 45.0)])).await;
    let list = server.get(&format!("{path}/colliders")).await.expect(200);
    assert_eq!(list["items"], json!([]));
    let printed = server.heights(&path).await;
    assert!(before.iter().zip(&printed).filter(|(a, b)| a != b).count() >= 48, "two feet");
    server.step(&path, 600).await;
    let later = server.heights(&path).await;
    let moved = printed.iter().zip(&later).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(moved < 1e-3, "the print rests: {moved} m");
    let after = server.get(&format!("{path}/mass")).await.expect(200);
    assert_eq!(mass["present"], after["present"], "{reply}");
    server.stop().await;
}

async fn left_and_right_prints_hold_as_much(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut volumes = Vec::new();
    for i in 0..6 {
        let path = server.create(fresh()).await;
        let before: f64 = server.heights(&path).await.iter().sum();
        // Columns are a quarter as wide as the foot, which lies on them in any way.
        stamp(&server, &path, json!([foot(1.0 + 0.0083 * f64::from(i), 11.0 * f64::from(i))]))
            .await;
        let after: f64 = server.heights(&path).await.iter().sum();
        volumes.push(before - after);
    }
    let (least, most) = volumes.iter().fold((f64::MAX, 0.0_f64), |(a, b), &v| (a.min(v), b.max(v)));
    assert!(most / least < 1.15, "{volumes:?}");
    server.stop().await;
}

async fn later_prints_find_what_earlier_left(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(fresh()).await;
    let twice = stamp(&server, &path, json!([foot(1.0, 0.0), foot(1.0, 0.0)])).await;
    assert!(depth(&twice, 0) > 0.02 && depth(&twice, 1) < 1e-3, "pressed once: {twice}");
    // Snow that falls in between lies in the print.
    let snow = json!({"depth": 0.1, "density": 60});
    server.post(&format!("{path}/snowfalls"), snow).await.expect(200);
    let again = stamp(&server, &path, json!([foot(1.0, 0.0)])).await;
    assert!(depth(&again, 0) > 0.03, "{again}");
    server.stop().await;
}

async fn a_print_is_made_once_for_a_key(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(fresh()).await;
    let body = serde_json::to_vec(&json!({"stamps": [foot(1.0, 0.0)]})).unwrap();
    let headers = [("content-type", "application/json"), ("idempotency-key", "left-foot")];
    let to = format!("{path}/stamps");
    let send = async || {
        let reply = server.send(reqwest::Method::POST, &to, &headers, body.clone()).await;
        reply.expect(200)
    };
    let first = send().await;
    let heights = server.heights(&path).await;
    assert_eq!(send().await, first);
    assert_eq!(server.heights(&path).await, heights);
    server.stop().await;
}

async fn prints_outlive_a_snapshot(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(fresh()).await;
    stamp(&server, &path, json!([foot(1.0, 30.0)])).await;
    let digest = server.get(&format!("{path}/digest")).await.expect(200)["digest"].clone();
    let saved = server.get(&format!("{path}/snapshot")).await.body;
    server.post(&format!("{path}/reset"), json!({})).await.expect(200);
    assert_ne!(server.get(&format!("{path}/digest")).await.expect(200)["digest"], digest);
    let media_type = "application/vnd.firn.snapshot";
    server.post_bytes(&format!("{path}/reset"), media_type, saved).await.expect(200);
    assert_eq!(server.get(&format!("{path}/digest")).await.expect(200)["digest"], digest);
    server.stop().await;
}

async fn what_is_no_stamp_is_refused(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(fresh()).await;
    let with = |field: &str, value: Value| {
        let mut stamp = foot(1.0, 0.0);
        stamp[field] = value;
        json!({ "stamps": [stamp] })
    };
    let wheel = json!({"type": "wheel", "width": 0.1, "radius": 0.3});
    let huge = json!({"shape": {"type": "box", "width": 1e6, "depth": 1e6}, "pressure": 10,
        "position": {"x": 1, "z": 1}});
    for (body, pointer) in [
        (json!({"stamps": []}), "/stamps"),
        (json!({"stamps": vec![foot(1.0, 0.0); 4097]}), "/stamps"),
        (json!({"stamps": vec![huge; 4096]}), "/stamps"),
        (json!({"stamps": [foot(1.0, 0.0)], "more": 1}), "/more"),
        (with("mass", Value::Null), "/stamps/0/mass"),
        (with("mass", json!(-1)), "/stamps/0/mass"),
        (with("pressure", json!(100)), "/stamps/0/pressure"),
        (with("heading", json!(1e6)), "/stamps/0/heading"),
        (with("shape", wheel), "/stamps/0/shape/type"),
        (with("shape", json!({"type": "disk", "radius": 0})), "/stamps/0/shape/radius"),
        (with("position", json!({"x": -9, "z": 0})), "/stamps/0/position"),
        (with("bottom", json!(1)), "/stamps/0/bottom"),
    ] {
        let before = server.get(&path).await.expect(200);
        let reply = server.post(&format!("{path}/stamps"), body.clone()).await;
        assert_eq!(reply.pointers(422), [pointer]);
        assert_eq!(server.get(&path).await.expect(200), before, "nothing changed");
    }
    server.stop().await;
}
