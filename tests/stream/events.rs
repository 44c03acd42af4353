//! Events where they are wanted, and watched depths, over real sockets.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::client::Client;
use crate::on_each_backend;
use crate::support::{Server, small};

on_each_backend!(
    a_binary_viewer_pays_nothing_for_what_happens_elsewhere,
    events_come_once_from_where_they_are_wanted,
    an_object_that_leaves_is_told_as_gone,
    settings_that_nobody_wanted_yet_are_told,
    a_slow_client_misses_no_event,
    a_watch_tells_each_crossing,
    a_watch_tells_after_a_reconnection_how_it_stands,
    what_can_not_be_wanted_is_refused,
);

/// A paused session of 6 × 2 tiles with a metre of snow.
fn street() -> Value {
    json!({
        "grid": {"width": 48, "depth": 16, "height": 20, "cell_size": 0.2},
        "paused": true,
        "initial_snow": [{"depth": 1.0}]
    })
}

/// Columns of one tile.
fn tile(column_x: u32) -> Value {
    json!({"column_x": column_x, "column_z": 0, "width": 8, "depth": 8})
}

/// The same, in metres.
fn area(column_x: u32) -> Value {
    json!({"x": f64::from(column_x) * 0.2, "z": 0, "width": 1.6, "depth": 1.6})
}

/// Clears a tile to a depth; returns the answer.
async fn clear(server: &Server, session: &str, column_x: u32, depth: f64) -> Value {
    let clearing = json!({"depth": depth, "region": area(column_x)});
    server.post(&format!("{session}/clearings"), clearing).await.expect(200)
}

/// Bytes of a varint.
fn varint(number: u64) -> usize {
    (64 - number.leading_zeros()).div_ceil(7).max(1) as usize
}

/// Messages and bytes, but for those of a seq, that a viewer of the first tile gets while a plough works at the far
/// end, and snow falls on the tile at last.
async fn heard(server: &Server, moves: u32, wish: &Value) -> (usize, usize) {
    let session = server.create(street()).await;
    let mut viewer = Client::open_as(server, &session, "firn.v1.bin").await;
    let mut subscribe =
        json!({"op": "subscribe", "id": 1, "region": tile(0), "max_rate": 60, "colliders": true});
    subscribe.as_object_mut().unwrap().extend(wish.as_object().unwrap().clone());
    viewer.send(subscribe).await;
    viewer.heights_of(1).await;
    let before = viewer.heard;
    for step in 0..moves {
        let plough = json!({"mass": 9000, "shape": {"type": "box", "width": 1, "depth": 1},
                            "position": {"x": 5.0 + 0.1 * f64::from(step), "z": 0.8}});
        let put = server.put(&format!("{session}/colliders/plough"), plough).await;
        assert!([200, 201].contains(&put.status), "{}", put.json());
        clear(server, &session, 32, 0.9 - 0.01 * f64::from(step)).await;
    }
    let snowfall = json!({"depth": 0.5, "region": area(0)});
    let fell = server.post(&format!("{session}/snowfalls"), snowfall).await.expect(200);
    while viewer.heights_of(1).await < fell["seq"].as_u64().unwrap() {}
    // Events come after the heights of their turn.
    viewer.send(json!({"op": "ping", "id": 2})).await;
    assert_eq!(viewer.answer().await["op"], "pong");
    (viewer.heard.0 - before.0, viewer.heard.1 - before.1 - varint(viewer.view(1).seq))
}

async fn a_binary_viewer_pays_nothing_for_what_happens_elsewhere(backend: BackendChoice) {
    let server = Server::start(backend).await;
    for wish in [json!({}), json!({"events": ["clearing"]})] {
        let quiet = heard(&server, 0, &wish).await;
        assert_eq!(quiet.0, 2, "the snowfall's heights, and a pong");
        assert_eq!(heard(&server, 20, &wish).await, quiet, "{wish}");
    }
    server.stop().await;
}

async fn events_come_once_from_where_they_are_wanted(backend: BackendChoice) {
    let server = Server::start(backend).await;
    for protocol in ["firn.v1.json", "firn.v1.bin"] {
        let session = server.create(street()).await;
        let mut client = Client::open_as(&server, &session, protocol).await;
        for id in [1, 2] {
            let wish = json!({"op": "subscribe", "id": id, "region": tile(8), "max_rate": 60,
                              "events": ["clearing", "settings"]});
            client.send(wish).await;
            client.heights_of(id).await;
        }
        clear(&server, &session, 0, 0.5).await;
        clear(&server, &session, 40, 0.5).await;
        let near = clear(&server, &session, 8, 0.25).await;
        let event = client.next_event().await;
        assert_eq!(event["cleared_mass"], near["cleared_mass"]);
        let fallen = json!({"depth": 0.1});
        server.post(&format!("{session}/snowfalls"), fallen).await.expect(200);
        server.put(&format!("{session}/air-temperature"), json!({"celsius": -7})).await.expect(200);
        assert_eq!(client.next_event().await["settings"]["air_temperature"], -7.0);

        // Where the view goes, events follow.
        for id in [1, 2] {
            client.send(json!({"op": "update", "id": id, "region": tile(40)})).await;
            assert_eq!(client.answer().await["op"], "ack");
        }
        clear(&server, &session, 8, 0.0).await;
        let far = clear(&server, &session, 40, 0.0).await;
        let event = client.next_event().await;
        assert_eq!(event["cleared_mass"], far["cleared_mass"]);
        client.send(json!({"op": "update", "id": 1, "events": false})).await;
        client.send(json!({"op": "update", "id": 2, "events": false})).await;
        client.answer().await;
        client.answer().await;
        server.put(&format!("{session}/air-temperature"), json!({"celsius": -8})).await.expect(200);
        client.send(json!({"op": "ping", "id": 9})).await;
        client.answer().await;
        assert_eq!(client.pop_event(), None, "each was told once");
    }
    server.stop().await;
}

async fn an_object_that_leaves_is_told_as_gone(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(street()).await;
    let mut client = Client::open_as(&server, &session, "firn.v1.bin").await;
    let wish =
        json!({"op": "subscribe", "id": 1, "region": tile(0), "max_rate": 60, "colliders": true});
    client.send(wish).await;
    client.heights_of(1).await;
    let car = |x: f64| {
        json!({"mass": 1500, "shape": {"type": "box", "width": 0.6, "depth": 0.6},
               "position": {"x": x, "z": 0.8}})
    };
    let path = format!("{session}/colliders/car");
    for round in 0..3 {
        server.put(&path, car(0.8)).await;
        client.until(1, |view| view.colliders[0]["id"] == "car").await;
        match round {
            0 => drop(server.put(&path, car(8.0)).await.expect(200)),
            _ => drop(server.delete(&path).await.expect(204)),
        }
        client.until(1, |view| view.colliders == json!([])).await;
    }
    server.stop().await;
}

async fn settings_that_nobody_wanted_yet_are_told(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(small()).await;
    let mut client = Client::open_as(&server, &session, "firn.v1.bin").await;
    server.put(&format!("{session}/air-temperature"), json!({"celsius": -9})).await.expect(200);
    client.send(json!({"op": "subscribe", "id": 1, "events": ["settings"]})).await;
    assert_eq!(client.event("settings").await["settings"]["air_temperature"], -9.0);
    server.stop().await;
}

async fn a_slow_client_misses_no_event(backend: BackendChoice) {
    const FALLS: usize = 150;
    let server = Server::start(backend).await;
    let session = server
        .create(json!({"grid": {"width": 160, "depth": 160, "height": 8, "cell_size": 0.5}, "paused": true}))
        .await;
    // It reads nothing while snow falls.
    let mut slow = Client::open_narrow(&server, &session).await;
    slow.send(json!({"op": "subscribe", "id": 1, "max_rate": 60})).await;
    let mut busy = Client::open(&server, &session).await;
    let mut fallen = 0.0;
    for id in 0..FALLS {
        busy.send(json!({"op": "snowfall", "id": id, "depth": 0.01})).await;
        fallen += busy.answer().await["fallen_mass"].as_f64().unwrap();
    }
    let mut told = (0, 0.0);
    while told.1 < fallen - 1e-6 {
        let mass = slow.event("snowfall").await["fallen_mass"].as_f64().unwrap();
        told = (told.0 + 1, told.1 + mass);
    }
    assert!((told.1 - fallen).abs() < 1e-6 && told.0 <= FALLS, "{told:?} for {fallen}");
    server.stop().await;
}

/// Whether a watch holds, and the mean depth, by its next event.
async fn standing(client: &mut Client, id: &str) -> (bool, f64) {
    let event = client.event("watch").await;
    assert_eq!((&event["subscription"], &event["id"]), (&json!(1), &json!(id)), "{event}");
    assert!(event["seq"].is_u64() && event["tick"].is_u64(), "{event}");
    (event["holds"].as_bool().unwrap(), event["mean_depth"].as_f64().unwrap())
}

/// Lets snow fall on the tile that is watched.
async fn snow(server: &Server, session: &str, depth: f64) {
    let snowfall = json!({"depth": depth, "region": area(16)});
    server.post(&format!("{session}/snowfalls"), snowfall).await.expect(200);
}

async fn a_watch_tells_each_crossing(backend: BackendChoice) {
    let server = Server::start(backend).await;
    for protocol in ["firn.v1.json", "firn.v1.bin"] {
        let session = server.create(street()).await;
        let mut client = Client::open_as(&server, &session, protocol).await;
        // What is watched lies elsewhere than what is seen.
        let wish = json!({"op": "subscribe", "id": 1, "region": tile(0), "max_rate": 60, "events": false,
            "watch": [{"id": "deep", "region": tile(16), "above": 1.5}]});
        client.send(wish).await;
        assert_eq!(standing(&mut client, "deep").await, (false, 1.0));
        // At 1.5 m it is not above.
        snow(&server, &session, 0.25).await;
        snow(&server, &session, 0.25).await;
        snow(&server, &session, 0.25).await;
        assert_eq!(standing(&mut client, "deep").await, (true, 1.75));
        clear(&server, &session, 0, 0.0).await;
        clear(&server, &session, 16, 1.625).await;
        clear(&server, &session, 16, 0.5).await;
        assert_eq!(standing(&mut client, "deep").await, (false, 0.5));

        let watch =
            json!([{"id": "all", "below": 0.9}, {"id": "bare", "region": tile(0), "below": 0.1}]);
        client.send(json!({"op": "update", "id": 1, "watch": watch})).await;
        let view = server.get(&session).await.expect(200);
        let mean = view["summary"]["mean_height"].as_f64().unwrap();
        assert_eq!(standing(&mut client, "all").await, (mean < 0.9, mean));
        assert_eq!(standing(&mut client, "bare").await, (true, 0.0));
        snow(&server, &session, 4.0).await;
        client.send(json!({"op": "ping", "id": 9})).await;
        while client.answer().await["op"] != "pong" {}
        client.send(json!({"op": "unsubscribe", "id": 1})).await;
        client.answer().await;
        while let Some(event) = client.pop_event() {
            assert_eq!(event["id"], "all", "{event}");
        }
    }
    server.stop().await;
}

async fn a_watch_tells_after_a_reconnection_how_it_stands(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(street()).await;
    let epoch = server.get(&session).await.expect(200)["epoch"].clone();
    let mut wish = json!({"op": "subscribe", "id": 1, "region": tile(0), "max_rate": 60,
        "watch": [{"id": "shallow", "region": tile(16), "below": 1.25}]});
    let mut client = Client::open_as(&server, &session, "firn.v1.bin").await;
    client.send(wish.clone()).await;
    assert_eq!(standing(&mut client, "shallow").await, (true, 1.0));
    let view = client.bequeath(1);
    client.cut();

    snow(&server, &session, 0.5).await;
    wish["resume"] = json!({"epoch": epoch, "seq": view.seq});
    let mut client = Client::open_as(&server, &session, "firn.v1.bin").await;
    client.send(wish).await;
    let told = client.told(1).await;
    assert_eq!((&told["recovered"], &told["tiles"]), (&json!(true), &json!([])));
    assert_eq!(standing(&mut client, "shallow").await, (false, 1.5));
    server.stop().await;
}

async fn what_can_not_be_wanted_is_refused(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(small()).await;
    let mut client = Client::open(&server, &session).await;
    let many: Vec<_> = (0..17).map(|id| json!({"id": format!("w{id}"), "above": 1})).collect();
    for (op, field, value, pointer) in [
        ("subscribe", "events", json!(["settled", "thaw"]), "/events/1"),
        ("subscribe", "events", json!("all"), "/events"),
        ("subscribe", "watch", json!(many), "/watch"),
        (
            "subscribe",
            "watch",
            json!([{"id": "a", "above": 1}, {"id": "a", "below": 1}]),
            "/watch/1/id",
        ),
        ("subscribe", "watch", json!([{"id": "ä", "above": 1}]), "/watch/0/id"),
        ("subscribe", "watch", json!([{"id": "a"}]), "/watch/0"),
        ("subscribe", "watch", json!([{"id": "a", "above": 4.5}]), "/watch/0/above"),
        ("subscribe", "watch", json!([{"id": "a", "over": 4.5}]), "/watch/0/over"),
        (
            "update",
            "watch",
            json!([{"id": "a", "above": 1, "region": tile(16)}]),
            "/watch/0/region",
        ),
        ("update", "events", json!([7]), "/events/0"),
    ] {
        if op == "update" {
            client.send(json!({"op": "subscribe", "id": 1})).await;
        }
        let mut request = json!({"op": op, "id": 1});
        request[field] = value;
        client.send_raw(request.to_string().into()).await;
        let error = client.answer().await;
        let problem = &error["problem"];
        assert_eq!((&error["id"], &problem["status"]), (&json!(1), &json!(422)), "{request}");
        assert_eq!(problem["errors"][0]["pointer"], pointer, "{request}: {problem}");
    }
    server.stop().await;
}
