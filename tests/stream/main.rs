//! The height stream, over a real socket to a real server.

mod access;
mod changes;
mod client;
mod events;
mod faults;
mod ground;
mod heights;
mod limits;
mod objects;
mod reads;
mod rust;
#[path = "../support/mod.rs"]
mod support;
mod vectors;
mod weather;

use firn::config::BackendChoice;
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::CloseFrame;

use client::{Client, connect, refused};
use support::{Server, small};

on_each_backend!(
    a_stream_begins_with_a_welcome,
    what_can_not_be_streamed_is_refused_before_the_upgrade,
    what_can_not_be_read_leaves_the_socket_open,
    events_are_told_to_everybody,
    each_end_has_its_close_code,
);

/// A session that runs, with fresh snow that settles for a while: 3 × 2 tiles.
fn settling() -> Value {
    json!({
        "grid": {"width": 20, "depth": 12, "height": 20, "cell_size": 0.2},
        "initial_snow": [{"depth": 3.0}]
    })
}

/// Heights as the contract rounds them.
fn rounded(heights: &[f64], quantum: f64) -> Vec<f64> {
    let places = (1.0 / quantum).round();
    heights.iter().map(|height| (height / quantum + 0.5).floor() / places).collect()
}

async fn a_stream_begins_with_a_welcome(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(small()).await;
    let view = server.get(&session).await.expect(200);
    for (offered, expected) in [
        ("", ""),
        ("firn.v1.json", "firn.v1.json"),
        ("firn.v1.bin", "firn.v1.bin"),
        ("firn.v9.json, firn.v1.json", "firn.v1.json"),
        ("firn.v1.json, firn.v1.bin", "firn.v1.bin"),
    ] {
        let (mut client, chosen) = connect(&server, &session, offered).await;
        assert_eq!(chosen, expected);
        let welcome = client.next().await;
        assert_eq!(welcome["op"], "welcome");
        assert_eq!(welcome["session"], view["id"]);
        assert_eq!(welcome["tile_size"], 8);
        for field in ["epoch", "tick", "seq", "grid"] {
            assert_eq!(welcome[field], view[field], "{field}");
        }
        for field in
            ["air_temperature", "time_scale", "tick_rate", "paused", "snowfall_rate", "pressing"]
        {
            assert_eq!(welcome["settings"][field], view[field], "{field}");
        }
    }
    server.stop().await;
}

async fn what_can_not_be_streamed_is_refused_before_the_upgrade(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(small()).await;
    for offered in ["firn.v2.bin", "graphql-ws, soap"] {
        let (status, problem) = refused(&server, &session, offered).await;
        assert_eq!((status, &problem["status"]), (400, &json!(400)), "{offered}");
        assert!(problem["detail"].as_str().unwrap().contains("firn.v1.json"), "{problem}");
    }
    let (status, problem) = refused(&server, "/v1/sessions/nobody", "").await;
    assert_eq!((status, &problem["status"]), (404, &json!(404)));
    server.get(&format!("{session}/stream")).await.problem(400);
    server.stop().await;
}

async fn what_can_not_be_read_leaves_the_socket_open(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(small()).await;
    let mut client = Client::open(&server, &session).await;
    for (message, status) in [
        (Message::text("snow, please"), 400),
        (Message::text("[]"), 422),
        (Message::text(r#"{"op":"snowfall","depth":1}"#), 422),
        (Message::binary(vec![1, 2, 3]), 400),
    ] {
        client.send_raw(message.clone()).await;
        let error = client.answer().await;
        assert_eq!((&error["op"], &error["id"]), (&json!("error"), &Value::Null), "{message}");
        assert_eq!(error["problem"]["status"], status, "{message}");
    }
    client.send(json!({"op": "ping", "id": 5})).await;
    assert_eq!(client.answer().await, json!({"op": "pong", "id": 5}));
    server.stop().await;
}

async fn events_are_told_to_everybody(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(small()).await;
    let mut clients =
        [Client::open(&server, &session).await, Client::open(&server, &session).await];
    let fallen = server.post(&format!("{session}/snowfalls"), json!({"depth": 0.1})).await;
    server.put(&format!("{session}/air-temperature"), json!({"celsius": -7})).await.expect(200);
    server.post(&format!("{session}/reset"), json!({})).await.expect(200);
    for client in &mut clients {
        let snowfall = client.event("snowfall").await;
        assert_eq!(snowfall["fallen_mass"], fallen.expect(200)["fallen_mass"]);
        assert_eq!(client.event("settings").await["settings"]["air_temperature"], -7.0);
        client.event("reset").await;
    }
    server.stop().await;
}

async fn each_end_has_its_close_code(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let (doomed, other) = (server.create(small()).await, server.create(small()).await);

    let mut client = Client::open(&server, &doomed).await;
    client.send(json!({"op": "subscribe", "id": 1})).await;
    server.delete(&doomed).await.expect(204);
    assert_eq!(client.close_code().await, 3502);

    let mut client = Client::open(&server, &other).await;
    client.send_raw(Message::text(" ".repeat((1 << 20) + 1))).await;
    assert_eq!(client.close_code().await, 1009);

    let mut client = Client::open(&server, &other).await;
    let goodbye = CloseFrame { code: 1000.into(), reason: "".into() };
    client.send_raw(Message::Close(Some(goodbye))).await;
    assert_eq!(client.close_code().await, 1000);

    let mut client = Client::open(&server, &other).await;
    client.send(json!({"op": "subscribe", "id": 1})).await;
    client.heights_of(1).await;
    server.begin_to_stop();
    assert_eq!(client.close_code().await, 1001);
    server.stop().await;
}
