//! The ground in streams that ask for it, over real sockets.

use std::path::Path;

use firn::config::BackendChoice;
use firn::driver::Durability;
use firn::store::RedbStore;
use serde_json::{Value, json};

use crate::client::{Client, View};
use crate::support::{Options, Server, numbers};
use crate::{on_each_backend, rounded};

on_each_backend!(
    each_tile_is_told_once,
    who_does_not_ask_is_told_nothing,
    a_flat_world_costs_nothing,
    other_ground_is_told_anew,
    regions_and_strides_are_those_of_the_heights,
    who_resumes_is_told_what_it_missed,
    a_restart_tells_it_again,
    a_large_world_comes_in_parts,
);

const PROTOCOLS: [&str; 2] = ["firn.v1.json", "firn.v1.bin"];

/// A paused session of 3 × 2 tiles, those at the far edges clipped, with a metre of snow on a valley that lies
/// below 0 in part.
fn valley() -> Value {
    json!({
        "grid": {"width": 20, "depth": 12, "height": 20, "cell_size": 0.2},
        "paused": true,
        "initial_snow": [{"depth": 1.0}],
        "terrain": {"heights": slopes(20, 12, 0.123_456)}
    })
}

/// Elevations of a slope along x, and of another along z.
fn slopes(width: u32, depth: u32, step: f64) -> Vec<f64> {
    let place = |i: u32| (f64::from(i % width), f64::from(i / width));
    (0..width * depth).map(place).map(|(x, z)| step * (x * 3.0 - z * 5.0)).collect()
}

fn wish() -> Value {
    json!({"op": "subscribe", "id": 1, "max_rate": 60, "terrain": true})
}

/// Elevations as a stream rounds those that REST tells.
async fn ground(server: &Server, session: &str, query: &str) -> Vec<f64> {
    let read = server.get(&format!("{session}/terrain{query}")).await.expect(200);
    rounded(&numbers(&read["heights"]), 0.0001)
}

/// Corners of the tiles that a list of a message tells.
fn corners(message: &Value, list: &str) -> Vec<(u64, u64)> {
    let corner =
        |tile: &Value| (tile["column_x"].as_u64().unwrap(), tile["column_z"].as_u64().unwrap());
    message.get(list).and_then(Value::as_array).into_iter().flatten().map(corner).collect()
}

const ALL: [(u64, u64); 6] = [(0, 0), (8, 0), (16, 0), (0, 8), (8, 8), (16, 8)];

async fn fall(server: &Server, session: &str) {
    let region = json!({"x": 0, "z": 0, "width": 1, "depth": 1});
    let fallen = json!({"depth": 0.3, "region": region});
    server.post(&format!("{session}/snowfalls"), fallen).await.expect(200);
}

async fn each_tile_is_told_once(backend: BackendChoice) {
    let server = Server::start(backend).await;
    for protocol in PROTOCOLS {
        let session = server.create(valley()).await;
        let mut client = Client::open_as(&server, &session, protocol).await;
        client.send(wish()).await;
        let snapshot = client.told(1).await;
        assert_eq!((corners(&snapshot, "terrain"), snapshot.get("level")), (ALL.to_vec(), None));
        assert_eq!(client.view(1).elevations(), ground(&server, &session, "").await);
        assert!(client.view(1).elevations().iter().any(|&elevation| elevation < -1.0));

        fall(&server, &session).await;
        let delta = client.told(1).await;
        assert_eq!((corners(&delta, "tiles"), delta.get("terrain")), (vec![(0, 0)], None));
        assert_eq!(client.view(1).elevations(), ground(&server, &session, "").await);
    }
    server.stop().await;
}

async fn who_does_not_ask_is_told_nothing(backend: BackendChoice) {
    let server = Server::start(backend).await;
    for protocol in PROTOCOLS {
        let session = server.create(valley()).await;
        let mut client = Client::open_as(&server, &session, protocol).await;
        client.send(json!({"op": "subscribe", "id": 1, "max_rate": 60})).await;
        let snapshot = client.told(1).await;
        assert_eq!((snapshot.get("level"), snapshot.get("terrain")), (None, None));
        let before = client.view(1).messages;
        let other = json!({"heights": slopes(20, 12, 0.5)});
        server.put(&format!("{session}/terrain"), other).await.expect(200);
        fall(&server, &session).await;
        let delta = client.told(1).await;
        assert_eq!((delta.get("level"), delta.get("terrain")), (None, None));
        assert_eq!(corners(&delta, "tiles"), [(0, 0)]);
        assert_eq!(client.view(1).messages, before + 1, "other ground is no news of the snow");
    }
    server.stop().await;
}

async fn a_flat_world_costs_nothing(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut spec = valley();
    spec.as_object_mut().unwrap().remove("terrain");
    let session = server.create(spec).await;
    let mut bytes = Vec::new();
    for terrain in [false, true] {
        let mut client = Client::open_as(&server, &session, "firn.v1.bin").await;
        let mut wish = wish();
        wish["terrain"] = json!(terrain);
        client.send(wish).await;
        client.told(1).await;
        bytes.push(client.payload);
    }
    assert_eq!(bytes[0], bytes[1]);
    for protocol in PROTOCOLS {
        let mut client = Client::open_as(&server, &session, protocol).await;
        client.send(wish()).await;
        let snapshot = client.told(1).await;
        assert_eq!((&snapshot["level"], snapshot.get("terrain")), (&json!(true), None));
        assert_eq!(client.view(1).elevations(), [0.0; 240]);
        fall(&server, &session).await;
        assert_eq!(client.told(1).await.get("level"), None, "it was told");
    }
    server.stop().await;
}

async fn other_ground_is_told_anew(backend: BackendChoice) {
    let server = Server::start(backend).await;
    for protocol in PROTOCOLS {
        let session = server.create(valley()).await;
        let mut client = Client::open_as(&server, &session, protocol).await;
        client.send(wish()).await;
        client.told(1).await;
        let path = format!("{session}/terrain");
        let other = json!({"heights": slopes(20, 12, -7.5)});
        let laid = server.put(&path, other).await.expect(200);
        let delta = client.told(1).await;
        assert_eq!((&delta["op"], &delta["seq"]), (&json!("delta"), &laid["seq"]));
        assert_eq!((corners(&delta, "tiles"), corners(&delta, "terrain")), (vec![], ALL.to_vec()));
        assert_eq!(client.view(1).elevations(), ground(&server, &session, "").await);

        server.put(&path, json!({"heights": vec![0.0; 240]})).await.expect(200);
        assert_eq!(client.told(1).await["level"], true);
        assert_eq!(client.view(1).elevations(), [0.0; 240]);
        server.post(&format!("{session}/reset"), json!({})).await.expect(200);
        client.until(1, |view| view.elevations()[1] != 0.0).await;
        assert_eq!(client.view(1).elevations(), ground(&server, &session, "").await);
    }
    server.stop().await;
}

async fn regions_and_strides_are_those_of_the_heights(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(valley()).await;
    for protocol in PROTOCOLS {
        let mut client = Client::open_as(&server, &session, protocol).await;
        for stride in [1, 2, 4, 8] {
            let mut wish = wish();
            wish["id"] = json!(stride);
            wish["stride"] = json!(stride);
            // A coarse step of heights is none of the ground.
            wish["quantum"] = json!(0.5);
            client.send(wish).await;
            client.told(stride).await;
            let read = ground(&server, &session, &format!("?stride={stride}")).await;
            assert_eq!(client.view(stride).elevations(), read, "stride {stride}");
        }
        let region = |x: u32| json!({"column_x": x, "column_z": 3, "width": 2, "depth": 2});
        let mut part = wish();
        part["region"] = region(9);
        client.send(part).await;
        assert_eq!(corners(&client.told(1).await, "terrain"), [(8, 0)]);
        client.send(json!({"op": "update", "id": 1, "region": region(15)})).await;
        assert_eq!(client.answer().await["op"], "ack");
        let delta = client.told(1).await;
        assert_eq!(
            (corners(&delta, "tiles"), corners(&delta, "terrain")),
            (vec![(16, 0)], vec![(16, 0)])
        );
    }
    server.stop().await;
}

/// What a client is told first that goes on from what another one was told.
async fn resume(
    server: &Server,
    session: &str,
    protocol: &str,
    (epoch, view): (&Value, View),
) -> (Value, View) {
    let mut client = Client::open_as(server, session, protocol).await;
    let mut wish = wish();
    wish["resume"] = json!({"epoch": epoch, "seq": view.seq});
    client.send(wish).await;
    client.inherit(1, view);
    let told = client.told(1).await;
    (told, client.bequeath(1))
}

/// What a client is told that has seen nothing.
async fn first(server: &Server, session: &str, protocol: &str) -> View {
    let mut client = Client::open_as(server, session, protocol).await;
    client.send(wish()).await;
    client.told(1).await;
    client.bequeath(1)
}

async fn who_resumes_is_told_what_it_missed(backend: BackendChoice) {
    let server = Server::start(backend).await;
    for protocol in PROTOCOLS {
        let session = server.create(valley()).await;
        let epoch = server.get(&session).await.expect(200)["epoch"].clone();
        let view = first(&server, &session, protocol).await;
        fall(&server, &session).await;
        let (told, view) = resume(&server, &session, protocol, (&epoch, view)).await;
        assert_eq!(told["recovered"], true);
        assert_eq!((corners(&told, "tiles"), told.get("terrain")), (vec![(0, 0)], None));

        let other = json!({"heights": slopes(20, 12, 2.0)});
        server.put(&format!("{session}/terrain"), other).await.expect(200);
        let (told, mut view) = resume(&server, &session, protocol, (&epoch, view)).await;
        assert_eq!(told["recovered"], true);
        assert_eq!((corners(&told, "tiles"), corners(&told, "terrain")), (vec![], ALL.to_vec()));
        assert_eq!(view.elevations(), ground(&server, &session, "").await);

        view.seq += 1000;
        let (told, _) = resume(&server, &session, protocol, (&epoch, view)).await;
        assert_eq!((&told["recovered"], corners(&told, "terrain")), (&json!(false), ALL.to_vec()));
    }
    server.stop().await;
}

async fn stored(backend: BackendChoice, directory: &Path) -> Server {
    let store = RedbStore::in_directory(directory).unwrap();
    let durability = Durability { store: Box::new(store), ..Durability::ephemeral() };
    Server::start_stored(backend, Options::default(), durability).await
}

async fn a_restart_tells_it_again(backend: BackendChoice) {
    for protocol in PROTOCOLS {
        let data = tempfile::tempdir().unwrap();
        let server = stored(backend, data.path()).await;
        let session = server.create(valley()).await;
        let other = json!({"heights": slopes(20, 12, 2.0)});
        server.put(&format!("{session}/terrain"), other).await.expect(200);
        let epoch = server.get(&session).await.expect(200)["epoch"].clone();
        let view = first(&server, &session, protocol).await;
        server.stop().await;

        let server = stored(backend, data.path()).await;
        let (told, view) = resume(&server, &session, protocol, (&epoch, view)).await;
        assert_eq!(told["recovered"], true);
        assert_eq!((corners(&told, "tiles"), corners(&told, "terrain")), (vec![], ALL.to_vec()));
        assert_eq!(view.elevations(), ground(&server, &session, "").await);
        assert_eq!(view.elevations(), rounded(&slopes(20, 12, 2.0), 0.0001));
        server.stop().await;
    }
}

async fn a_large_world_comes_in_parts(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let spec = json!({
        "grid": {"width": 512, "depth": 508, "height": 10, "cell_size": 2.0},
        "paused": true,
    });
    let session = server.create(spec).await;
    // 260 096 elevations of up to eleven bytes each.
    let heights: Vec<f64> = (0..512u32 * 508)
        .map(|i| f64::from(i.wrapping_mul(2_654_435_761) % 40_000_000) / 1000.0 - 20_000.0)
        .collect();
    let bytes = heights.iter().flat_map(|&height| (height as f32).to_le_bytes()).collect();
    let path = format!("{session}/terrain");
    let laid = server.send(
        reqwest::Method::PUT,
        &path,
        &[("content-type", "application/octet-stream")],
        bytes,
    );
    laid.await.expect(200);
    for protocol in PROTOCOLS {
        let mut client = Client::open_as(&server, &session, protocol).await;
        client.send(wish()).await;
        let last = client.told(1).await;
        assert!(client.heard.0 > 2, "{} messages", client.heard.0);
        assert_eq!(last.get("more"), None);
        assert_eq!(client.view(1).elevations(), ground(&server, &session, "").await);
    }
    server.stop().await;
}
