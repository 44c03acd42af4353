//! Sessions in which nothing moves while their time goes on: that costs nothing, and is not lost.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use firn::config::BackendChoice;
use firn::driver::{Durability, Fault};
use firn::store::{Kind, Loaded, RedbStore, Row, Store, StoreError, Write};
use reqwest::Method;
use serde_json::{Value, json};

use crate::disk::Disk;
use crate::on_each_backend;
use crate::process::Process;
use crate::support::wait::until;
use crate::support::{Options, Server};

on_each_backend!(time_at_rest_survives_kills, time_at_rest_survives_a_lost_device);

const NEVER: Duration = Duration::from_secs(3600);
const HEARTBEAT: Row = Row { session: u64::MAX, kind: Kind::Heartbeat, number: 0 };

/// A session that comes to rest within a second or two, made to run once it is there.
fn restless(id: &str, tick_rate: f64) -> Value {
    json!({
        "id": id,
        "grid": {"width": 9, "depth": 8, "height": 30, "cell_size": 0.2},
        "paused": true, "tick_rate": tick_rate, "time_scale": 1000,
        "initial_snow": [{"depth": 3.5}]
    })
}

fn fall() -> Value {
    json!({"depth": 0.3, "region": {"x": 0, "z": 0, "width": 1, "depth": 1}})
}

/// Creates sessions that run, and waits until they are at rest. Returns their ticks.
async fn come_to_rest(server: &Process, rates: &[(&str, f64)]) {
    for (id, rate) in rates {
        server.post("/v1/sessions", restless(id, *rate)).await;
        let path = format!("/v1/sessions/{id}");
        let running = json!({"paused": false});
        server.send(Method::PATCH, &path, Some(&running)).await.expect("it answers");
    }
    for (id, _) in rates {
        settled(server, id).await;
    }
}

async fn settled(server: &Process, id: &str) {
    let path = format!("/v1/sessions/{id}");
    until("it comes to rest", async || server.get(&path).await["settled"] == true).await;
}

async fn tick(server: &Process, id: &str) -> u64 {
    server.get(&format!("/v1/sessions/{id}")).await["tick"].as_u64().unwrap()
}

fn name(backend: BackendChoice) -> &'static str {
    if backend == BackendChoice::Cpu { "cpu" } else { "gpu" }
}

/// What passed by itself is there but for a second of it, what was asked for is there, and the time
/// that the server was dead for is not.
async fn time_at_rest_survives_kills(backend: BackendChoice) {
    let rates = [("slow", 7.0), ("usual", 60.0), ("fast", 240.0)];
    let data = tempfile::tempdir().unwrap();
    let options = ["--backend", name(backend), "--checkpoint-interval", "1h"];
    let mut server = Process::ready(data.path(), &options).await;
    come_to_rest(&server, &rates).await;
    let mut fallen = BTreeMap::new();
    for round in 0..3 {
        // Long enough that an older mark would be missed.
        let then = tick(&server, "usual").await;
        until("time passes", async || tick(&server, "usual").await >= then + 150).await;
        if round == 1 {
            for (id, _) in rates {
                let path = format!("/v1/sessions/{id}/snowfalls");
                let tick = server.post(&path, fall()).await["tick"].as_u64().unwrap();
                fallen.insert(id, tick);
                settled(&server, id).await;
            }
        }
        let (mut before, began) = (Vec::new(), Instant::now());
        for (id, _) in rates {
            before.push(tick(&server, id).await);
        }
        server.kill().await;
        let mut lived = began.elapsed();
        // It dies at any moment of its return, too.
        for delay in [0, 3, 10, 30, 100] {
            let dying = Process::start(data.path(), &options).await;
            let began = Instant::now();
            tokio::time::sleep(Duration::from_millis(delay)).await;
            dying.kill().await;
            lived += began.elapsed();
        }
        let began = Instant::now();
        server = Process::ready(data.path(), &options).await;
        for ((id, rate), then) in rates.into_iter().zip(before) {
            let now = tick(&server, id).await;
            let passed = (lived + began.elapsed()).as_secs_f64() * rate;
            assert!(now as f64 + rate >= then as f64, "{id}: tick {now}, was {then} at {rate} Hz");
            assert!(now as f64 <= then as f64 + passed + 2.0, "{id}: tick {now}, was {then}");
        }
    }
    for (id, rate) in rates {
        equals_its_twin(&server, id, rate, fallen[id]).await;
    }
    server.kill().await;
}

/// Compares a session with one that was stepped to its tick without any break.
async fn equals_its_twin(server: &Process, id: &str, rate: f64, fallen: u64) {
    let (path, twin) = (format!("/v1/sessions/{id}"), format!("/v1/sessions/{id}-twin"));
    let paused = json!({"paused": true});
    server.send(Method::PATCH, &path, Some(&paused)).await.expect("it answers");
    let ours = server.get(&format!("{path}/digest")).await;
    let now = ours["tick"].as_u64().unwrap();
    server.post("/v1/sessions", restless(&format!("{id}-twin"), rate)).await;
    server.post(&format!("{twin}/step"), json!({ "ticks": fallen })).await;
    server.post(&format!("{twin}/snowfalls"), fall()).await;
    if now > fallen {
        server.post(&format!("{twin}/step"), json!({ "ticks": now - fallen })).await;
    }
    let theirs = server.get(&format!("{twin}/digest")).await;
    assert_eq!((&theirs["tick"], &theirs["digest"]), (&ours["tick"], &ours["digest"]), "{id}");
}

/// Nothing is lost at all where the process goes on.
async fn time_at_rest_survives_a_lost_device(backend: BackendChoice) {
    for durability in [Durability::ephemeral(), Disk::default().durability(NEVER)] {
        let server = Server::start_stored(backend, Options::default(), durability).await;
        let path = server.create(restless("a", 60.0)).await;
        let other = server.create(restless("b", 60.0)).await;
        server.patch(&path, json!({"paused": false})).await.expect(200);
        until("it comes to rest", async || server.get(&path).await.expect(200)["settled"] == true)
            .await;
        let tick = async || server.get(&path).await.expect(200)["tick"].as_u64().unwrap();
        let settled = tick().await;
        until("time passes at rest", async || tick().await >= settled + 90).await;
        let before = server.get(&path).await.expect(200);
        server.sessions.sabotage(Fault::LoseDevice).await;
        // Asking for another finds out, and waits until all are back.
        server.get_once_back(&format!("{other}/mass")).await;
        let after = server.get(&path).await.expect(200);
        let ticks = [&before, &after].map(|reply| reply["tick"].as_u64().unwrap());
        assert!(ticks[1] >= ticks[0], "tick {} after {}", ticks[1], ticks[0]);
        server.stop().await;
    }
}

/// Time that stands still does so too while others' goes on.
#[tokio::test(flavor = "multi_thread")]
async fn time_that_stands_still_is_not_counted() {
    let data = tempfile::tempdir().unwrap();
    let options = ["--backend", "cpu", "--checkpoint-interval", "1h"];
    let server = Process::ready(data.path(), &options).await;
    come_to_rest(&server, &[("paused", 240.0), ("asleep", 240.0), ("awake", 240.0)]).await;
    let patch = json!({"idle_timeout_s": 1});
    server.send(Method::PATCH, "/v1/sessions/asleep", Some(&patch)).await.expect("it answers");
    let patch = json!({"paused": true});
    server.send(Method::PATCH, "/v1/sessions/paused", Some(&patch)).await.expect("it answers");
    let paused = tick(&server, "paused").await;
    let listed = async || {
        let list = server.get("/v1/sessions").await;
        let found = list["items"].as_array().unwrap().iter().find(|item| item["id"] == "asleep");
        found.expect("it is listed").clone()
    };
    until("it hibernates", async || listed().await["state"] == "hibernating").await;
    let asleep = listed().await["tick"].as_u64().unwrap();
    let then = tick(&server, "awake").await;
    until("the time of others goes on", async || tick(&server, "awake").await >= then + 720).await;
    let awake = tick(&server, "awake").await;
    server.kill().await;
    let began = Instant::now();
    let server = Process::ready(data.path(), &options).await;
    assert_eq!(tick(&server, "paused").await, paused);
    let now = tick(&server, "asleep").await;
    let most = asleep as f64 + began.elapsed().as_secs_f64() * 240.0 + 2.0;
    assert!((asleep..=most as u64).contains(&now), "tick {now}, slept at {asleep}");
    assert!(tick(&server, "awake").await + 240 >= awake);
    server.kill().await;
}

/// A store that remembers what was written.
#[derive(Clone, Debug)]
struct Watched {
    store: Arc<Mutex<RedbStore>>,
    writes: Arc<Mutex<Vec<Write>>>,
}

impl Watched {
    fn new(data: &Path) -> Watched {
        let store = RedbStore::in_directory(data).expect("a directory that can be used");
        Watched { store: Arc::new(Mutex::new(store)), writes: Arc::default() }
    }

    /// Waits for some more heartbeats, and takes out everything that was written meanwhile.
    async fn beats(&self, count: usize) -> Vec<Write> {
        self.writes.lock().unwrap().clear();
        let writes = || self.writes.lock().unwrap().clone();
        until("it is written that time passes", async || {
            writes().iter().filter(|write| is_heartbeat(write)).count() >= count
        })
        .await;
        writes()
    }
}

fn is_heartbeat(write: &Write) -> bool {
    matches!(write, Write::Put(row, _) if *row == HEARTBEAT)
}

impl Store for Watched {
    fn load(&mut self) -> Result<Loaded, StoreError> {
        self.store.lock().unwrap().load()
    }

    fn commit(&mut self, writes: &[Write]) -> Result<(), StoreError> {
        self.writes.lock().unwrap().extend(writes.iter().cloned());
        self.store.lock().unwrap().commit(writes)
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_world_at_rest_writes_nothing_but_its_heartbeat() {
    let data = tempfile::tempdir().unwrap();
    let store = Watched::new(data.path());
    let durability = Durability {
        store: Box::new(store.clone()),
        checkpoint_interval: NEVER,
        accept_loss: false,
    };
    let server = Server::start_stored(BackendChoice::Cpu, Options::default(), durability).await;
    let mut paths = Vec::new();
    for i in 0..40 {
        paths.push(server.create(restless(&format!("s{i}"), 20.0 + f64::from(i))).await);
    }
    // While nobody's time passes nothing at all is written.
    store.writes.lock().unwrap().clear();
    server.beats(90).await;
    assert!(store.writes.lock().unwrap().is_empty(), "{:?}", store.writes);

    for path in &paths[..30] {
        server.patch(path, json!({"paused": false})).await.expect(200);
    }
    for path in &paths[..30] {
        until("it comes to rest", async || server.get(path).await.expect(200)["settled"] == true)
            .await;
    }
    store.beats(2).await;
    let ticks = server.get(&paths[0]).await.expect(200)["tick"].as_u64().unwrap();
    // Reads of the device put sessions into frames, and change nothing.
    for path in &paths {
        server.get(&format!("{path}/mass")).await.expect(200);
    }
    let writes = store.beats(4).await;
    let rows = writes.iter().filter(|write| !is_heartbeat(write));
    assert_eq!(rows.count(), 0, "{writes:?}");
    assert!(server.get(&paths[0]).await.expect(200)["tick"].as_u64().unwrap() > ticks);
    server.stop().await;
}

/// A file that has lost its heartbeat.
#[tokio::test(flavor = "multi_thread")]
async fn without_a_heartbeat_only_the_passing_since_the_anchor_is_lost() {
    let data = tempfile::tempdir().unwrap();
    let options = ["--backend", "cpu", "--checkpoint-interval", "1h"];
    let server = Process::ready(data.path(), &options).await;
    come_to_rest(&server, &[("a", 60.0)]).await;
    let path = "/v1/sessions/a/snowfalls";
    let fallen = server.post(path, fall()).await["tick"].as_u64().unwrap();
    settled(&server, "a").await;
    let then = tick(&server, "a").await;
    until("time passes at rest", async || tick(&server, "a").await >= then + 120).await;
    server.kill().await;

    let mut store = RedbStore::in_directory(data.path()).unwrap();
    let rows = store.load().unwrap().rows;
    assert!(rows.contains_key(&HEARTBEAT));
    let (_, anchor) = rows.iter().find(|(row, _)| row.kind == Kind::Anchor).unwrap();
    let anchor: Value = serde_json::from_slice(&anchor.bytes).unwrap();
    assert_eq!(anchor["rate"], 60.0);
    store.commit(&[Write::Remove(HEARTBEAT)]).unwrap();
    drop(store);

    let began = Instant::now();
    let server = Process::ready(data.path(), &options).await;
    let (now, anchored) = (tick(&server, "a").await, anchor["tick"].as_u64().unwrap());
    // Its newest change tells as much.
    let known = anchored.max(fallen);
    let most = known as f64 + began.elapsed().as_secs_f64() * 60.0 + 2.0;
    assert!((known..=most as u64).contains(&now), "tick {now}, known to have been at {known}");
    assert!(now < then, "what has passed since is lost");
    equals_its_twin(&server, "a", 60.0, fallen).await;
    server.kill().await;
}
