//! What a client is told of the snow.

use std::collections::BTreeMap;
use std::time::Duration;

use firn::config::{BackendChoice, ConnectionConfig};
use serde_json::{Value, json};

use crate::client::Client;
use crate::support::{Options, Server, numbers, small};
use crate::{on_each_backend, rounded, settling};

on_each_backend!(
    reconstructed_heights_equal_a_read_at_the_same_seq,
    strides_and_quanta_are_those_asked_for,
    a_moved_view_is_sent_only_what_came_into_it,
    clients_of_different_rates_reach_the_same_state,
    a_client_that_does_not_read_holds_up_nobody,
);

async fn reconstructed_heights_equal_a_read_at_the_same_seq(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(settling()).await;
    let mut client = Client::open(&server, &session).await;
    client.send(json!({"op": "subscribe", "id": 1, "max_rate": 60})).await;

    let mut streamed = BTreeMap::new();
    let mut read: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
    let mut compared = 0;
    while compared < 10 {
        let seq = client.heights_of(1).await;
        streamed.insert(seq, client.heights(1));
        let reply = server.get(&format!("{session}/heights")).await.expect(200);
        read.insert(reply["seq"].as_u64().unwrap(), numbers(&reply["heights"]));
        compared = 0;
        for (seq, heights) in &read {
            if let Some(seen) = streamed.get(seq) {
                assert_eq!(seen, &rounded(heights, 0.001), "seq {seq}");
                compared += 1;
            }
        }
    }
    let (first, last) = (streamed.values().next().unwrap(), streamed.values().last().unwrap());
    assert!(first[0] > last[0], "the snow has settled meanwhile");
    server.stop().await;
}

async fn strides_and_quanta_are_those_asked_for(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(small()).await;
    let drift = json!({"x": 0.4, "z": 0.2, "width": 0.8, "depth": 0.6});
    let fallen = json!({"depth": 0.3333, "region": drift});
    server.post(&format!("{session}/snowfalls"), fallen).await.expect(200);
    let mut client = Client::open(&server, &session).await;
    for (stride, quantum) in [(1, 0.01), (2, 0.0001), (4, 0.001), (8, 1.0)] {
        let id = stride;
        client
            .send(json!({"op": "subscribe", "id": id, "stride": stride, "quantum": quantum}))
            .await;
        client.heights_of(id).await;
        let read = server.get(&format!("{session}/heights?stride={stride}")).await.expect(200);
        assert_eq!(client.heights(id), rounded(&numbers(&read["heights"]), quantum));
    }
    for (field, value) in [
        ("stride", json!(3)),
        ("quantum", json!(1e-5)),
        ("max_rate", json!(0)),
        ("depth", json!(1)),
    ] {
        client.send(json!({"op": "subscribe", "id": 9, field: value})).await;
        let error = client.answer().await;
        assert_eq!((&error["op"], &error["id"]), (&json!("error"), &json!(9)));
        assert_eq!(error["problem"]["status"], 422);
        assert_eq!(error["problem"]["errors"][0]["pointer"], format!("/{field}"));
    }
    server.stop().await;
}

async fn a_moved_view_is_sent_only_what_came_into_it(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut spec = settling();
    spec["paused"] = json!(true);
    let session = server.create(spec).await;
    let mut client = Client::open(&server, &session).await;
    let region =
        |x: u32, width: u32| json!({"column_x": x, "column_z": 0, "width": width, "depth": 3});
    let update = |region: Value| json!({"op": "update", "id": 1, "region": region});

    client.send(json!({"op": "subscribe", "id": 1, "region": region(3, 2)})).await;
    assert_eq!(client.tiles().await, ("snapshot".to_owned(), vec![(0, 0)]));
    client.send(update(region(0, 9))).await;
    assert_eq!(client.answer().await["op"], "ack");
    assert_eq!(client.tiles().await, ("delta".to_owned(), vec![(8, 0)]));
    // Nothing comes into view: no message, or the next would not be the one expected.
    client.send(update(region(8, 8))).await;
    assert_eq!(client.answer().await["op"], "ack");
    client.send(update(region(0, 20))).await;
    assert_eq!(client.answer().await["op"], "ack");
    assert_eq!(client.tiles().await, ("delta".to_owned(), vec![(0, 0), (16, 0)]));

    client.send(update(region(20, 1))).await;
    let error = client.answer().await;
    assert_eq!(error["problem"]["errors"][0]["pointer"], "/region");
    client.send(json!({"op": "unsubscribe", "id": 1})).await;
    assert_eq!(client.answer().await["op"], "ack");
    client.send(update(region(0, 1))).await;
    assert_eq!(client.answer().await["problem"]["status"], 404);
    server.stop().await;
}

async fn clients_of_different_rates_reach_the_same_state(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(settling()).await;
    let mut fast = Client::open(&server, &session).await;
    let mut slow = Client::open(&server, &session).await;
    fast.send(json!({"op": "subscribe", "id": 1, "max_rate": 60})).await;
    slow.send(json!({"op": "subscribe", "id": 1, "max_rate": 2})).await;
    slow.heights_of(1).await;
    slow.heights_of(1).await;
    server.patch(&session, json!({"paused": true})).await.expect(200);
    let end = rounded(&server.heights(&session).await, 0.001);
    for client in [&mut fast, &mut slow] {
        client.until(1, |view| view.samples_equal(&end)).await;
    }
    server.stop().await;
}

async fn a_client_that_does_not_read_holds_up_nobody(backend: BackendChoice) {
    // However long that takes.
    let write_timeout = Duration::from_secs(600);
    let connections = ConnectionConfig { write_timeout, ..ConnectionConfig::default() };
    let server = Server::start_with(backend, Options { connections, ..Options::default() }).await;
    let grid = json!({"width": 128, "depth": 128, "height": 20, "cell_size": 0.2});
    let snow = json!([{"depth": 3.5}]);
    let spec = json!({"grid": grid, "paused": true, "initial_snow": snow});
    let session = server.create(spec).await;
    // What it does not read is more than the connection holds: 64 times 16384 heights, and again
    // after each step.
    let mut stalled = Client::open_narrow(&server, &session).await;
    for id in 0..64 {
        stalled.send(json!({"op": "subscribe", "id": id, "max_rate": 60, "quantum": 0.0001})).await;
    }
    let mut other = Client::open(&server, &session).await;
    other.send(json!({"op": "subscribe", "id": 1, "max_rate": 60})).await;
    other.heights_of(1).await;
    let mut heights = server.heights(&session).await;
    for round in 0..10 {
        let before = heights;
        server.step(&session, 20).await;
        other.send(json!({"op": "ping", "id": round})).await;
        other.answer().await;
        heights = server.heights(&session).await;
        assert_ne!(rounded(&before, 0.001), rounded(&heights, 0.001));
        other.until(1, |view| view.samples_equal(&rounded(&heights, 0.001))).await;
    }
    for id in 0..64 {
        stalled.until(id, |view| view.samples_equal(&rounded(&heights, 0.0001))).await;
    }
    // The states in between were skipped, not kept for it.
    assert!(stalled.messages() <= 3 * 64, "{} messages for 11 states", stalled.messages());
    server.stop().await;
}
