//! What streams may take, and what they share.

use std::num::NonZeroU32;
use std::time::Duration;

use firn::config::{BackendChoice, StreamConfig};
use firn::stream::EncodedTiles;
use firn_protocol::stream::Cause;
use serde_json::json;

use crate::client::Client;
use crate::on_each_backend;
use crate::support::wait::until;
use crate::support::{self, Options, Server};

on_each_backend!(
    a_tile_is_encoded_once_for_all_who_watch_it,
    what_streams_hold_is_counted_while_they_are_open,
    states_that_a_client_was_too_busy_for_are_counted,
    a_client_that_lets_a_write_block_is_closed,
    a_client_that_sends_too_many_commands_is_closed,
    level_snow_that_settles_costs_a_tenth_of_a_byte_per_column,
    ploughed_snow_costs_half_a_byte_per_column,
);

fn big() -> serde_json::Value {
    json!({
        "grid": {"width": 128, "depth": 128, "height": 20, "cell_size": 0.2},
        "paused": true,
        "initial_snow": [{"depth": 3.5}]
    })
}

async fn a_tile_is_encoded_once_for_all_who_watch_it(backend: BackendChoice) {
    const SOCKETS: usize = 20;
    const ROUNDS: u64 = 5;
    let server = Server::start(backend).await;
    let session = server.create(support::small()).await;
    let other = server.create(support::small()).await;
    let id = session.rsplit('/').next().unwrap();
    let encoded = server.sessions.get(id).unwrap().companion::<EncodedTiles>();
    for (number, protocol) in (0..).zip(["firn.v1.json", "firn.v1.bin"]) {
        let before = (encoded.encoded(), encoded.shared());
        let mut clients = Vec::new();
        for _ in 0..SOCKETS {
            let mut client = Client::open_as(&server, &session, protocol).await;
            client.send(json!({"op": "subscribe", "id": 1, "max_rate": 60})).await;
            client.heights_of(1).await;
            clients.push(client);
        }
        for _ in 0..ROUNDS {
            // Meanwhile the session's seq passes over numbers. No state is lost by that.
            server.post(&format!("{other}/snowfalls"), json!({"depth": 0.1})).await.expect(200);
            let fallen = server.post(&format!("{session}/snowfalls"), json!({"depth": 0.1})).await;
            let newest = fallen.expect(200)["seq"].as_u64().unwrap();
            for client in &mut clients {
                client.until(1, |view| view.seq >= newest).await;
            }
        }
        // Two tiles, at first and after each snowfall.
        let tiles = 2 * (1 + ROUNDS);
        assert_eq!(encoded.encoded() - before.0, tiles, "{number}");
        assert_eq!(encoded.shared() - before.1, tiles * (SOCKETS as u64 - 1), "{number}");
        let metrics = server.app.metrics.encode().unwrap();
        let told = tiles * SOCKETS as u64;
        for (name, count) in [("tiles", told), ("tiles_encoded", tiles), ("states_conflated", 0)] {
            let line = format!("firn_stream_{name}_total{{protocol=\"{protocol}\"}} {count}\n");
            assert!(metrics.contains(&line), "{line} in {metrics}");
        }
    }
    server.stop().await;
}

async fn what_streams_hold_is_counted_while_they_are_open(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(big()).await;
    let held = async || {
        let body = server.get(&format!("{session}/usage")).await.expect(200);
        body["memory_bytes"]["streams"].as_u64().unwrap()
    };
    assert_eq!(held().await, 0);
    let mut clients = Vec::new();
    for count in 1..=3u64 {
        let mut client = Client::open_as(&server, &session, "firn.v1.bin").await;
        client.send(json!({"op": "subscribe", "id": 1})).await;
        client.heights_of(1).await;
        // Nothing is being written any more once this is answered.
        client.send(json!({"op": "ping", "id": 2})).await;
        client.answer().await;
        clients.push(client);
        // 256 tiles, encoded once for all: a place in a table of 512, and some bytes each.
        let tiles = 512 * (size_of::<(u32, (u64, axum::body::Bytes))>() as u64 + 1) + 256 * 24;
        let beside = held().await - count * 20 * 1024 - tiles;
        assert!((256..256 * 100).contains(&beside), "{beside} bytes of tiles");
    }
    drop(clients);
    until("nothing is held any more", async || held().await == 0).await;
    server.stop().await;
}

async fn states_that_a_client_was_too_busy_for_are_counted(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(big()).await;
    let mut busy = Client::open_narrow(&server, &session).await;
    for id in 0..16 {
        let wish = json!({"op": "subscribe", "id": id, "quantum": 0.0001, "max_rate": 60});
        busy.send(wish).await;
    }
    for id in 0..16 {
        busy.heights_of(id).await;
    }
    // Much more than the sockets hold, and the client reads nothing meanwhile: the server can't but
    // skip some of it.
    let mut newest = 0;
    for _ in 0..200 {
        let fallen = server.post(&format!("{session}/snowfalls"), json!({"depth": 0.001})).await;
        newest = fallen.expect(200)["seq"].as_u64().unwrap();
    }
    for id in 0..16 {
        busy.until(id, |view| view.seq >= newest).await;
    }
    let skipped = conflated(&server);
    assert!((1..200).contains(&skipped), "{skipped}");
    server.stop().await;
}

/// Published states that a client was not told, because a newer one was there first.
fn conflated(server: &Server) -> u64 {
    let metrics = server.app.metrics.encode().unwrap();
    let name = "firn_stream_states_conflated_total{protocol=\"firn.v1.json\"} ";
    let line = metrics.lines().find_map(|line| line.strip_prefix(name)).expect("it is counted");
    line.parse().unwrap()
}

async fn a_client_that_lets_a_write_block_is_closed(backend: BackendChoice) {
    let stream = StreamConfig {
        stream_write_timeout: Duration::from_millis(200),
        // The client reads again when it has been given up, however long that takes.
        stream_farewell: Duration::from_secs(60),
        ..StreamConfig::default()
    };
    let server = Server::start_with(backend, Options { stream, ..Options::default() }).await;
    let session = server.create(big()).await;
    let mut stalled = Client::open_narrow(&server, &session).await;
    for id in 0..64 {
        stalled.send(json!({"op": "subscribe", "id": id, "quantum": 0.0001})).await;
    }
    until("it is given up", async || server.app.metrics.streams.ended(Cause::TooSlow) > 0).await;
    assert_eq!(stalled.close_code().await, 3008);
    server.stop().await;
}

async fn a_client_that_sends_too_many_commands_is_closed(backend: BackendChoice) {
    let stream =
        StreamConfig { stream_commands_per_second: NonZeroU32::MIN, ..StreamConfig::default() };
    let server = Server::start_with(backend, Options { stream, ..Options::default() }).await;
    let session = server.create(support::small()).await;
    let mut client = Client::open(&server, &session).await;
    for id in 0..100 {
        if !client.try_send(&json!({"op": "ping", "id": id})).await {
            break;
        }
    }
    assert_eq!(client.close_code().await, 3013);
    assert_eq!(server.app.metrics.streams.ended(Cause::TooManyCommands), 1);
    server.stop().await;
}

/// Bytes for each column told while a session is stepped, the first message left out.
async fn cost(server: &Server, session: &str, rounds: usize, moves: bool) -> f64 {
    let mut client = Client::open_as(server, session, "firn.v1.bin").await;
    let region = json!({"column_x": 48, "column_z": 48, "width": 32, "depth": 32});
    client.send(json!({"op": "subscribe", "id": 1, "max_rate": 60, "region": region})).await;
    client.heights_of(1).await;
    let before = client.payload;
    let mut columns = 0;
    for round in 0..rounds {
        if moves {
            let objects: Vec<_> = (0..20)
                .map(|i| {
                    // Across the region and back, each on a track of its own.
                    let along = 10.0 + 0.12 * round as f64 + 0.1 * f64::from(i % 4);
                    let across = 9.8 + 0.33 * f64::from(i);
                    let (x, z) = if i % 2 == 0 { (along, across) } else { (across, along) };
                    json!({"id": format!("o{i}"), "mass": 20,
                           "shape": {"type": "disk", "radius": 0.3}, "position": {"x": x, "z": z}})
                })
                .collect();
            let batch = json!({ "put": objects });
            server.post(&format!("{session}/colliders:batch"), batch).await.expect(200);
        }
        let newest = server.step(session, 6).await["seq"].as_u64().unwrap();
        while client.view(1).seq < newest {
            let Some(message) = client.try_take().await.unwrap() else { continue };
            columns += 64 * message["tiles"].as_array().unwrap().len();
            // What lies beyond the region changes the seq, but is not told.
            if message["tiles"].as_array().unwrap().is_empty() {
                break;
            }
        }
    }
    assert!(columns >= rounds * 1024 / 2, "{columns} columns");
    (client.payload - before) as f64 / columns as f64
}

async fn level_snow_that_settles_costs_a_tenth_of_a_byte_per_column(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(big()).await;
    let cost = cost(&server, &session, 20, false).await;
    println!("{cost:.3} bytes per column");
    assert!(cost <= 0.1, "{cost} bytes per column");
    server.stop().await;
}

async fn ploughed_snow_costs_half_a_byte_per_column(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(big()).await;
    let cost = cost(&server, &session, 40, true).await;
    println!("{cost:.3} bytes per column");
    assert!(cost <= 0.5, "{cost} bytes per column");
    server.stop().await;
}
