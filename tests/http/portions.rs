//! Ticks of thousands of cycles: nobody else waits for them, and they are what they would be in one
//! piece.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use firn::backend;
use firn::config::{BackendChoice, EngineConfig};
use firn_engine::frame::{Deposit, Edit, Frame, Layout, Placement, Run, Work};
use firn_snow::{Cover, Footprint, Grid, MASS_QUANTA, Material, Position, Shape, Turn};
use serde_json::{Value, json};
use tokio::task::JoinHandle;

use crate::on_each_backend;
use crate::support::Server;

on_each_backend!(
    others_are_served_in_the_middle_of_a_long_tick,
    a_long_tick_is_the_same_as_in_one_piece,
    what_arrives_in_the_middle_of_a_long_tick_does_not_fall_into_it,
    what_is_read_beside_changes_and_long_ticks_is_of_one_moment,
);

/// Cycles of a tick of 1000 s: a quarter of a second is the longest.
const CYCLES: u32 = 4000;

/// A session whose ticks have [`CYCLES`], evaluated one by one where a sledge stands on the snow.
fn long(side: u32) -> Value {
    json!({
        "grid": {"width": side, "depth": side, "height": 20, "cell_size": 0.2},
        "paused": true, "tick_rate": 1, "time_scale": 1000,
        "initial_snow": [{"depth": 3.0}],
    })
}

fn sledge(metres: f64) -> Value {
    let middle = metres / 2.0;
    json!({"id": "sledge", "mass": 300, "position": {"x": middle, "z": middle},
        "shape": {"type": "box", "width": middle, "depth": middle}})
}

/// Begins a step of one tick, and waits until it is under way.
async fn begin_to_step(server: &Server, path: &str) -> JoinHandle<u16> {
    let step = || {
        let request = reqwest::Client::new().post(format!("{}{path}/step", server.url));
        tokio::spawn(async move {
            request.json(&json!({"ticks": 1})).send().await.unwrap().status().as_u16()
        })
    };
    // Of two, one is refused because of the other.
    let (mut one, mut other) = (step(), step());
    let (refused, left) = tokio::select! {
        status = &mut one => (status, other),
        status = &mut other => (status, one),
    };
    assert_eq!(refused.unwrap(), 409);
    left
}

async fn others_are_served_in_the_middle_of_a_long_tick(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let heavy = server.create(long(64)).await;
    server.post(&format!("{heavy}/colliders"), sledge(12.8)).await.expect(201);
    let other = server.create(json!({"paused": true})).await;
    let step = begin_to_step(&server, &heavy).await;
    for _ in 0..5 {
        server.post(&format!("{other}/snowfalls"), json!({"depth": 0.1})).await.expect(200);
        let mass = server.get(&format!("{other}/mass")).await.expect(200);
        assert_eq!(mass["imbalance_quanta"], 0);
    }
    assert_eq!(server.get(&heavy).await.expect(200)["tick"], 0, "it is still in its first tick");
    // Nor does anybody wait for what is deleted.
    assert_eq!(server.delete(&heavy).await.status, 204);
    assert_eq!(step.await.unwrap(), 404);
    server.stop().await;
}

async fn a_long_tick_is_the_same_as_in_one_piece(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(long(10)).await;
    server.post(&format!("{path}/colliders"), sledge(2.0)).await.expect(201);
    server.step(&path, 1).await;
    let heights = server.heights(&path).await;
    server.stop().await;

    let grid = Grid { width: 10, depth: 10, height: 20, cell_size: 0.2 };
    let config = EngineConfig { backend, device_memory: None };
    let mut engine = backend::open(&config).unwrap();
    let layout =
        Layout { grid, material: Material::default(), ground: Default::default(), surface: None };
    engine.create(0, &layout).unwrap();
    let snow = Deposit {
        columns: grid.all(),
        depth: grid.thickness_quanta(3.0) as u32,
        mass: (3.0 * 20.0 * MASS_QUANTA).round() as u32,
        temperature: -3.0,
    };
    let shape = Shape::Box { width: 1.0, depth: 1.0 };
    let footprint = Footprint::new(&grid, &shape, Position { x: 1.0, z: 1.0 }, Turn::NONE);
    let collider =
        Arc::new(Placement { mass: 300.0, cover: Cover::default(), footprints: vec![footprint] });
    let put = Edit::PutCollider { id: "sledge".into(), collider, placed: true };
    let run = Run { cycles: CYCLES, dt: 0.25 };
    let edits = vec![Edit::Deposit(snow), put];
    let work = Work { edits, run, publish: true, ..Work::default() };
    engine.submit(Frame { work: vec![work] }).unwrap();
    let outcome = loop {
        if let Some(outcome) = engine.poll(Duration::from_secs(10)).unwrap() {
            break outcome;
        }
    };
    let mut whole = vec![0.0; 100];
    for (tile, columns) in outcome.published.tiles(outcome.work[0].tiles.clone()) {
        let rect = grid.tile_rect(tile);
        for (x, z) in (rect.z0..rect.z1).flat_map(|z| (rect.x0..rect.x1).map(move |x| (x, z))) {
            let height = columns[grid.locate(x, z).1 as usize];
            whole[(z * 10 + x) as usize] = grid.metres(u64::from(height));
        }
    }
    assert_eq!(heights, whole);
    assert!(whole[55] < whole[0] - 0.1, "the sledge has sunk: {whole:?}");
}

async fn what_arrives_in_the_middle_of_a_long_tick_does_not_fall_into_it(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let create = async || {
        let path = server.create(long(32)).await;
        server.post(&format!("{path}/colliders"), sledge(6.4)).await.expect(201);
        path
    };
    let snow = async |path: &str| {
        let fallen = server.post(&format!("{path}/snowfalls"), json!({"depth": 0.5})).await;
        assert_eq!(fallen.expect(200)["tick"].as_u64().map(|tick| tick <= 1), Some(true));
    };
    let digest = async |path: &str| {
        let mass = server.get(&format!("{path}/mass")).await.expect(200);
        assert_eq!((&mass["tick"], &mass["imbalance_quanta"]), (&json!(1), &json!(0)));
        server.get(&format!("{path}/digest")).await.expect(200)["digest"].clone()
    };
    let (before, after, during) = (create().await, create().await, create().await);
    snow(&before).await;
    server.step(&before, 1).await;
    server.step(&after, 1).await;
    snow(&after).await;

    // The request mostly finds the tick under way; it may also overtake its first cycle.
    let step = begin_to_step(&server, &during).await;
    snow(&during).await;
    assert_eq!(step.await.unwrap(), 200);
    let digests = [digest(&before).await, digest(&after).await];
    assert_ne!(digests[0], digests[1]);
    assert!(digests.contains(&digest(&during).await), "the snow fell into the tick");
    server.stop().await;
}

/// One long tick follows the other; changes and reads fall into them.
async fn what_is_read_beside_changes_and_long_ticks_is_of_one_moment(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut body = long(32);
    body["time_scale"] = json!(250);
    // It never comes to rest.
    body["snowfall_rate"] = json!(0.5);
    let path = server.create(body).await;
    server.post(&format!("{path}/colliders"), sledge(6.4)).await.expect(201);
    let over = AtomicBool::new(false);
    let is_over = || over.load(Ordering::Relaxed);
    let ticks = async {
        server.step(&path, 30).await;
        over.store(true, Ordering::Relaxed);
    };
    // Whoever asks again after every answer asks in every tick.
    let snow = async || {
        while !is_over() {
            let fall = json!({"depth": 0.002});
            server.post(&format!("{path}/snowfalls"), fall).await.expect(200);
        }
    };
    let masses = async || {
        while !is_over() {
            let mass = server.get(&format!("{path}/mass")).await.expect(200);
            assert_eq!(mass["imbalance_quanta"], 0);
        }
    };
    let objects = async {
        // It comes before the sledge in the order of the list, and goes again.
        let ahead = format!("{path}/colliders/ahead");
        let light = json!({"mass": 1, "position": {"x": 0.6, "z": 0.6},
            "shape": {"type": "disk", "radius": 0.3}});
        while !is_over() {
            server.put(&ahead, light.clone()).await.expect(201);
            assert_eq!(server.delete(&ahead).await.status, 204);
        }
    };
    let snapshots = async {
        while !is_over() {
            let saved = server.get(&format!("{path}/snapshot")).await.body;
            let media_type = "application/vnd.firn.snapshot";
            let again = server.post_bytes("/v1/sessions", media_type, saved).await.expect(201);
            let again = format!("/v1/sessions/{}", again["id"].as_str().unwrap());
            assert_eq!(server.delete(&again).await.status, 204);
        }
    };
    let lists = async {
        while !is_over() {
            let listed = server.get(&format!("{path}/colliders")).await.expect(200);
            for object in listed["items"].as_array().unwrap() {
                // The light one stands on a few columns, the sledge on a quarter of all.
                let area = object["contact_area"].as_f64().unwrap();
                assert_eq!(object["id"] == "sledge", area > 1.0, "{object}");
            }
        }
    };
    tokio::join!(ticks, snow(), snow(), masses(), masses(), objects, snapshots, lists);
    server.stop().await;
}
