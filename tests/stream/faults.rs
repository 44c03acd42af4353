//! A client behind a bad network: what it puts together is always a state that there was.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use firn::config::BackendChoice;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::{JoinHandle, JoinSet};
use tokio::time::{sleep, timeout};

use crate::client::{Client, View};
use crate::support::{Server, numbers};
use crate::{on_each_backend, rounded, settling};

on_each_backend!(
    text_survives_a_bad_network,
    bytes_survive_a_bad_network,
    only_published_states_are_recovered,
);

/// Changes made while the client watches.
const CHANGES: usize = 60;

/// Time after which a client that hears nothing connects anew.
const IMPATIENCE: Duration = Duration::from_secs(1);

async fn text_survives_a_bad_network(backend: BackendChoice) {
    reconstructs(backend, "firn.v1.json", 0xF1A4).await;
}

async fn bytes_survive_a_bad_network(backend: BackendChoice) {
    reconstructs(backend, "firn.v1.bin", 0xB175).await;
}

/// A connection that delays what it passes on, and after some bytes breaks or falls silent.
struct Proxy {
    url: String,
    well: Arc<AtomicBool>,
    accepting: JoinHandle<()>,
}

impl Proxy {
    async fn start(server: &Server, seed: u64) -> Proxy {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let target = server.url.trim_start_matches("http://").to_owned();
        let well = Arc::new(AtomicBool::new(false));
        let behaves = well.clone();
        let accepting = tokio::spawn(async move {
            // Dropped with this task, and with it every connection.
            let mut connections = JoinSet::new();
            let mut random = SmallRng::seed_from_u64(seed);
            loop {
                let (client, _) = listener.accept().await.unwrap();
                let server = TcpStream::connect(&target).await.unwrap();
                let seed = random.random();
                connections.spawn(pass(client, server, seed, behaves.clone()));
            }
        });
        Proxy { url, well, accepting }
    }
}

/// Passes bytes both ways; those to the client with faults, unless the network is well.
async fn pass(client: TcpStream, server: TcpStream, seed: u64, well: Arc<AtomicBool>) {
    let mut random = SmallRng::seed_from_u64(seed);
    let left: usize = random.random_range(900..4000);
    let falls_silent = random.random_bool(0.3);
    let (mut from_client, mut to_client) = client.into_split();
    let (mut from_server, mut to_server) = server.into_split();
    let up = async { drop(tokio::io::copy(&mut from_client, &mut to_server).await) };
    let down = async {
        let mut left = left;
        let mut bytes = [0; 4096];
        while let Ok(count @ 1..) = from_server.read(&mut bytes).await {
            let mut rest = &bytes[..count];
            while !rest.is_empty() {
                let most = if well.load(Ordering::SeqCst) { rest.len() } else { left.min(700) };
                if most == 0 && falls_silent {
                    std::future::pending::<()>().await;
                }
                let (now, later) = rest.split_at(most.min(rest.len()));
                if now.is_empty() || to_client.write_all(now).await.is_err() {
                    return;
                }
                left = left.saturating_sub(now.len());
                rest = later;
                if !well.load(Ordering::SeqCst) {
                    sleep(Duration::from_millis(random.random_range(0..4))).await;
                }
            }
        }
    };
    tokio::select! {
        () = up => {}
        () = down => {}
    }
}

/// Columns `x0..x1` of rows `z0..z1`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Region {
    x0: u64,
    z0: u64,
    x1: u64,
    z1: u64,
}

impl Region {
    /// Some columns of the 20 × 12 that [`settling`] has.
    fn random(random: &mut SmallRng) -> Region {
        let (x0, z0) = (random.random_range(0..16), random.random_range(0..9));
        let (x1, z1) = (random.random_range(x0 + 1..=20), random.random_range(z0 + 1..=12));
        Region { x0, z0, x1, z1 }
    }

    fn json(&self) -> Value {
        json!({"column_x": self.x0, "column_z": self.z0,
               "width": self.x1 - self.x0, "depth": self.z1 - self.z0})
    }

    /// What it is widened to.
    fn tiles(&self) -> Region {
        let up = |column: u64, most: u64| column.next_multiple_of(8).min(most);
        let (x0, z0) = (self.x0 / 8 * 8, self.z0 / 8 * 8);
        Region { x0, z0, x1: up(self.x1, 20), z1: up(self.z1, 12) }
    }

    fn holds(&self, z: u64, x: u64) -> bool {
        (self.x0..self.x1).contains(&x) && (self.z0..self.z1).contains(&z)
    }

    /// Its part of the heights of all columns.
    fn part(&self, all: &[f64]) -> Vec<f64> {
        let places = (0..12).flat_map(|z| (0..20).map(move |x| (z, x)));
        let inside = places.zip(all).filter(|&((z, x), _)| self.holds(z, x));
        inside.map(|(_, &height)| height).collect()
    }
}

/// What a client holds between its connections.
struct Viewer {
    region: Region,
    view: Option<View>,
    epoch: String,
    random: SmallRng,
    /// Seq, region and heights of every state it put together.
    states: Vec<(u64, Region, Vec<f64>)>,
    recovered: usize,
}

impl Viewer {
    /// Heights of its region, if it holds all of them.
    fn whole(&self, view: &View) -> Option<Vec<f64>> {
        let region = self.region.tiles();
        let heights = view.part(|z, x| region.holds(z, x));
        let columns = (region.x1 - region.x0) * (region.z1 - region.z0);
        (heights.len() as u64 == columns).then_some(heights)
    }

    /// Begins the subscription, with what it holds from earlier ones if that is all of a region.
    /// Returns what it should be told about that.
    async fn subscribe(&mut self, client: &mut Client) -> Option<bool> {
        let mut wish = json!({"op": "subscribe", "id": 1, "max_rate": 60,
                              "region": self.region.json()});
        let held = self.view.take().filter(|view| self.whole(view).is_some());
        let Some(view) = held else {
            client.inherit(1, View::of(1, 0.001));
            client.try_send(&wish).await;
            return None;
        };
        let lies = self.random.random_bool(0.1);
        let seq = if lies { view.seq + 1_000_000 } else { view.seq };
        wish["resume"] = json!({"epoch": self.epoch, "seq": seq});
        client.inherit(1, view);
        client.try_send(&wish).await;
        Some(!lies)
    }

    /// Watches through one connection, until that ends or `last` is reached.
    async fn watch(&mut self, client: &mut Client, last: &AtomicU64) -> bool {
        let mut expected = self.subscribe(client).await;
        let mut moving = None;
        while let Ok(Ok(message)) = timeout(IMPATIENCE, client.try_take()).await {
            while client.pop_answer().is_some() {
                self.region = moving.take().expect("only moves are answered");
                let region = self.region.tiles();
                client.view(1).keep(|z, x| region.holds(z, x));
            }
            let Some(message) = message else { continue };
            assert_eq!(message["recovered"], json!(expected), "{}", message["op"]);
            self.recovered += usize::from(expected == Some(true));
            assert!(expected != Some(true) || message["op"] == "delta");
            expected = None;
            let heights = self.whole(client.view(1));
            let seq = client.view(1).seq;
            if let Some(heights) = heights {
                self.states.push((seq, self.region.tiles(), heights));
                let last = last.load(Ordering::SeqCst);
                if last != 0 && seq >= last && moving.is_none() {
                    return true;
                }
            }
            if moving.is_none() && self.random.random_bool(0.2) {
                let region = Region::random(&mut self.random);
                let update = json!({"op": "update", "id": 1, "region": region.json()});
                if client.try_send(&update).await {
                    moving = Some(region);
                }
            }
        }
        false
    }
}

/// Makes some change.
async fn change(server: &Server, session: &str, random: &mut SmallRng) {
    let (x, z) = (random.random_range(0.3..3.0), random.random_range(0.3..1.8));
    let region = json!({"x": x, "z": z, "width": 0.9, "depth": 0.5});
    match random.random_range(0..5) {
        0 => {
            let fall = json!({"depth": 0.05, "region": region});
            server.post(&format!("{session}/snowfalls"), fall).await.expect(200);
        }
        1 => {
            let plough = json!({"depth": 2.0, "region": region});
            server.post(&format!("{session}/clearings"), plough).await.expect(200);
        }
        2 => {
            let object = json!({"mass": 30, "shape": {"type": "disk", "radius": 0.3},
                                "position": {"x": x, "z": z}});
            let put = server.put(&format!("{session}/colliders/sledge"), object).await;
            assert!([200, 201].contains(&put.status));
        }
        _ => drop(server.step(session, random.random_range(1..20)).await),
    }
}

async fn reconstructs(backend: BackendChoice, protocol: &str, seed: u64) {
    let server = Server::start(backend).await;
    let mut spec = settling();
    spec["paused"] = json!(true);
    let session = server.create(spec).await;
    let proxy = Proxy::start(&server, seed).await;
    let mut random = SmallRng::seed_from_u64(seed);
    let (known, last) = (Mutex::new(BTreeMap::new()), AtomicU64::new(0));
    let view = server.get(&session).await.expect(200);
    let mut viewer = Viewer {
        region: Region::random(&mut random),
        view: None,
        epoch: view["epoch"].as_str().unwrap().to_owned(),
        random: SmallRng::seed_from_u64(seed + 1),
        states: Vec::new(),
        recovered: 0,
    };
    let changing = async {
        let mut newest = 0;
        for _ in 0..CHANGES {
            change(&server, &session, &mut random).await;
            let read = server.get(&format!("{session}/heights")).await.expect(200);
            newest = read["seq"].as_u64().unwrap();
            known.lock().unwrap().insert(newest, rounded(&numbers(&read["heights"]), 0.001));
            // So that the network fails again and again while there are changes.
            sleep(Duration::from_millis(20)).await;
        }
        proxy.well.store(true, Ordering::SeqCst);
        last.store(newest, Ordering::SeqCst);
    };
    let watching = async {
        let mut connections = 0;
        loop {
            let Some(mut client) = Client::try_open(&proxy.url, &session, protocol).await else {
                continue;
            };
            connections += 1;
            let reached = viewer.watch(&mut client, &last).await;
            viewer.view = Some(client.bequeath(1));
            client.cut();
            if reached {
                break connections;
            }
        }
    };
    let ((), connections) = tokio::join!(changing, watching);
    let known = known.into_inner().unwrap();
    let mut compared = 0;
    for (seq, region, heights) in &viewer.states {
        if let Some(all) = known.get(seq) {
            assert_eq!(heights, &region.part(all), "seq {seq}, {region:?}");
            compared += 1;
        }
    }
    assert_eq!(viewer.states.last().unwrap().0, last.into_inner());
    assert!(compared > 0 && connections > 1, "{compared} states, {connections} connections");
    proxy.accepting.abort();
    server.stop().await;
}

async fn only_published_states_are_recovered(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(settling()).await;
    server.patch(&session, json!({"paused": true})).await.expect(200);
    for protocol in ["firn.v1.json", "firn.v1.bin"] {
        let (epoch, seq) = {
            let view = server.get(&session).await.expect(200);
            (view["epoch"].clone(), view["seq"].as_u64().unwrap())
        };
        let drift = json!({"x": 0.0, "z": 0.0, "width": 1.0, "depth": 1.0});
        let fall = json!({"depth": 0.1, "region": drift});
        let fallen = server.post(&format!("{session}/snowfalls"), fall).await.expect(200);
        let newest = fallen["seq"].as_u64().unwrap();
        let mut client = Client::open_as(&server, &session, protocol).await;
        for (epoch, seq, recovered, tiles) in [
            (&epoch, seq, true, 1),
            (&epoch, newest, true, 0),
            (&epoch, newest + 1, false, 6),
            (&epoch, 0, false, 6),
            (&json!("another"), seq, false, 6),
        ] {
            let resume = json!({"epoch": epoch, "seq": seq});
            let wish = json!({"op": "subscribe", "id": 1, "colliders": true, "resume": resume});
            client.send(wish).await;
            let message = loop {
                if let Some(message) = client.try_take().await.unwrap() {
                    break message;
                }
            };
            assert_eq!(message["recovered"], recovered, "{seq} of {newest}");
            assert_eq!(message["op"], if recovered { "delta" } else { "snapshot" });
            assert_eq!(message["tiles"].as_array().unwrap().len(), tiles, "{seq} of {newest}");
            assert_eq!(message["colliders"], json!([]));
        }
    }
    server.stop().await;
}
