//! The device is lost, or the engine's thread panics, under load.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use firn::config::BackendChoice;
use firn::driver::Fault;
use reqwest::{Client as Http, Method};
use serde_json::json;

use crate::client::Client;
use crate::disk::Disk;
use crate::on_each_backend;
use crate::process::send;
use crate::support::wait::until;
use crate::support::{Options, Server, small};

on_each_backend!(sessions_survive_their_device, sessions_survive_a_panic);

async fn sessions_survive_their_device(backend: BackendChoice) {
    survive(Server::start(backend).await, Fault::LoseDevice).await;
    let durability = Disk::default().durability(Duration::from_millis(200));
    let stored = Server::start_stored(backend, Options::default(), durability).await;
    survive(stored, Fault::LoseDevice).await;
}

async fn sessions_survive_a_panic(backend: BackendChoice) {
    survive(Server::start(backend).await, Fault::Panic).await;
    let durability = Disk::default().durability(Duration::from_millis(200));
    let stored = Server::start_stored(backend, Options::default(), durability).await;
    survive(stored, Fault::Panic).await;
}

async fn survive(server: Server, fault: Fault) {
    let live = json!({"grid": {"width": 20, "depth": 20, "height": 40, "cell_size": 0.2},
        "time_scale": 0.1, "initial_snow": [{"depth": 5}]});
    let live = server.create(live).await;
    let mut paths = vec![live.clone()];
    for _ in 0..3 {
        paths.push(server.create(small()).await);
    }
    let still = server.create(small()).await;
    server.step(&still, 50).await;
    let before = server.get(&format!("{still}/digest")).await.expect(200);
    let epoch = server.get(&live).await.expect(200)["epoch"].clone();
    let mut stream = Client::open(&server, &live).await;
    stream.send(json!({"op": "subscribe", "id": 1})).await;
    let first = stream.heights_of(1).await;

    let (over, falls) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
    let more_falls = async || {
        let before = falls.load(Ordering::Relaxed);
        until("snow falls", async || falls.load(Ordering::Relaxed) >= before + 40).await;
    };
    let mut writers = Vec::new();
    for path in &paths {
        let (base, at) = (server.url.clone(), format!("{path}/snowfalls"));
        let (over, falls) = (over.clone(), falls.clone());
        writers.push(tokio::spawn(async move {
            let (http, fall, mut fallen) = (Http::new(), json!({"depth": 0.01}), 0.0);
            while !over.load(Ordering::Relaxed) {
                let answer = send(&http, &base, Method::POST, &at, Some(&fall)).await;
                match answer.expect("it answers") {
                    (200, answer) => {
                        fallen += answer["fallen_mass"].as_f64().unwrap();
                        falls.fetch_add(1, Ordering::Relaxed);
                    }
                    // Refused: it did not fall.
                    (status, answer) => assert_eq!(status, 503, "{answer}"),
                }
            }
            fallen
        }));
    }
    for _ in 0..2 {
        more_falls().await;
        server.sessions.sabotage(fault).await;
        let again = server.get_once_back(&format!("{still}/digest")).await;
        assert_eq!(again["digest"], before["digest"]);
    }
    more_falls().await;
    over.store(true, Ordering::Relaxed);
    for (path, writer) in paths.iter().zip(writers) {
        let fallen = writer.await.unwrap();
        let depth = if *path == live { 5.0 * 400.0 } else { 70.0 } * 20.0 * 0.04;
        let mass = server.get(&format!("{path}/mass")).await.expect(200);
        assert_eq!(mass["imbalance_quanta"], 0);
        let there = mass["fallen"].as_f64().unwrap() - depth;
        assert!((there - fallen).abs() < 1e-3, "{path}: {there} of {fallen} kg");
    }
    // The stream went on, and tells what is there.
    server.patch(&live, json!({"paused": true})).await.expect(200);
    let heights = server.get(&format!("{live}/heights")).await.expect(200);
    let seq = heights["seq"].as_u64().unwrap();
    assert!(seq > first);
    let rounded: Vec<f64> = crate::support::numbers(&heights["heights"])
        .into_iter()
        .map(|height| (height / 0.001 + 0.5).floor() / 1000.0)
        .collect();
    // The pause has a seq of its own and changes no height: streams may know all of them already.
    while !stream.view(1).samples_equal(&rounded) {
        stream.heights_of(1).await;
    }
    assert_eq!(server.get(&live).await.expect(200)["epoch"], epoch);
    server.get("/readyz").await.expect(200);
    server.stop().await;
}
