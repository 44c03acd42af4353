//! Power cuts, full disks, and disks that can't be written to.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use firn::config::BackendChoice;
use firn::driver::{Driver, Durability, Fault, WorldConfig};
use firn::session::SessionError;
use firn::store::{Loaded, Store, StoreError, Write};
use firn_engine::cpu::CpuBackend;
use reqwest::{Client as Http, Method};
use serde_json::{Value, json};

use crate::client::Client;
use crate::disk::{Disk, Failing};
use crate::on_each_backend;
use crate::process::{Process, send};
use crate::script::{history, session};
use crate::support::wait::until;
use crate::support::{Options, Server, small};

on_each_backend!(a_disk_that_fails_refuses_changes_and_nothing_else);

async fn start(backend: BackendChoice, disk: &Disk) -> Server {
    let durability = disk.durability(Duration::from_millis(300));
    Server::start_stored(backend, Options::default(), durability).await
}

/// Everything of a session that a client can see and that does not depend on publications.
async fn seen(server: &Server, path: &str) -> Vec<Value> {
    let mut answers = Vec::new();
    for read in ["/digest", "/mass", "/heights", "/colliders"] {
        let mut answer = server.get(&format!("{path}{read}")).await.expect(200);
        answer["seq"] = Value::Null;
        answers.push(answer);
    }
    answers
}

#[tokio::test(flavor = "multi_thread")]
async fn a_power_cut_loses_nothing_acknowledged() {
    let mut disk = Disk::default();
    let mut server = start(BackendChoice::Cpu, &disk).await;
    let mut paths = Vec::new();
    for _ in 0..4 {
        paths.push(server.create(small()).await);
    }
    let mut known = [1.0; 4];
    for round in 0..12 {
        let over = Arc::new(AtomicBool::new(false));
        let counts: Vec<(Arc<AtomicU64>, Arc<AtomicU64>)> =
            paths.iter().map(|_| Default::default()).collect();
        let mut clients = Vec::new();
        for (path, (asked, done)) in paths.iter().zip(&counts) {
            let url = format!("{path}/snowfalls");
            let (base, asked, done) = (server.url.clone(), asked.clone(), done.clone());
            let over = over.clone();
            clients.push(tokio::spawn(async move {
                let (http, fall) = (Http::new(), json!({"depth": 0.01}));
                while !over.load(Ordering::Relaxed) {
                    asked.fetch_add(1, Ordering::SeqCst);
                    let answer = send(&http, &base, Method::POST, &url, Some(&fall)).await;
                    assert_eq!(answer.expect("it answers").0, 200);
                    done.fetch_add(1, Ordering::SeqCst);
                }
            }));
        }
        // The cut comes at another moment each time.
        tokio::time::sleep(Duration::from_millis(40 + 37 * round)).await;
        // What is acknowledged before the cut must be there, what is asked after it can't be.
        let done: Vec<u64> = counts.iter().map(|(_, done)| done.load(Ordering::SeqCst)).collect();
        let cut = disk.cut(round);
        let asked: Vec<u64> =
            counts.iter().map(|(asked, _)| asked.load(Ordering::SeqCst)).collect();
        over.store(true, Ordering::Relaxed);
        for client in clients {
            client.await.unwrap();
        }
        server.stop().await;
        disk = cut;
        server = start(BackendChoice::Cpu, &disk).await;
        let columns = 10.0 * 7.0 * 0.04 * 20.0;
        for (i, path) in paths.iter().enumerate() {
            let mass = server.get(&format!("{path}/mass")).await.expect(200);
            assert_eq!(mass["imbalance_quanta"], 0);
            let depth = mass["fallen"].as_f64().unwrap() / columns;
            let falls = (depth - known[i]) / 0.01;
            let within = done[i] as f64 - 0.01..=asked[i] as f64 + 0.01;
            assert!(within.contains(&falls), "round {round}: {falls} falls, {within:?} known");
            known[i] = depth;
        }
    }
    server.stop().await;
}

async fn a_disk_that_fails_refuses_changes_and_nothing_else(backend: BackendChoice) {
    let disk = Disk::default();
    let mut server = start(backend, &disk).await;
    let mut paused = session("paused");
    paused["idle_timeout_s"] = json!(1);
    let path = server.create(paused).await;
    for (method, at, body) in history(3, 30) {
        let (at, body) = (format!("{path}{at}"), body.to_string().into_bytes());
        let headers = [("content-type", "application/json")];
        let reply = server.send(method, &at, &headers, body).await;
        assert!(reply.status < 300, "{at}");
    }
    let fall = json!({"depth": 0.1});
    for failing in [Failing::Full, Failing::ReadOnly, Failing::NoSync, Failing::Panic] {
        let live = json!({"grid": {"width": 9, "depth": 9, "height": 40, "cell_size": 0.2},
            "time_scale": 0.1, "initial_snow": [{"depth": 7}]});
        let live = server.create(live).await;
        let before = seen(&server, &path).await;
        let mut stream = Client::open(&server, &live).await;
        stream.send(json!({"op": "subscribe", "id": 1})).await;
        stream.heights_of(1).await;

        disk.fail(Some(failing));
        // The first ones find out, the others are refused at once; neither leaves a trace.
        for _ in 0..3 {
            let refused = server.post(&format!("{path}/snowfalls"), fall.clone()).await;
            let problem = refused.problem(507);
            assert_eq!(problem["type"], "urn:firn:problem:storage-failed", "{failing:?}");
            assert_eq!(seen(&server, &path).await, before, "{failing:?}");
        }
        assert!(!server.sessions.vitals().store.is_healthy(), "whoever watches is told");
        server.post(&format!("{path}/step"), json!({"ticks": 5})).await.problem(507);
        server.post(&format!("{path}/reset"), json!({})).await.problem(507);
        server.post("/v1/sessions", small()).await.problem(507);
        server.delete(&format!("{path}/colliders/boot")).await.problem(507);
        server.delete(&path).await.problem(507);
        assert_eq!(seen(&server, &path).await, before, "{failing:?}");
        // Time goes on, and streams tell it.
        let tick = server.get(&live).await.expect(200)["tick"].as_u64().unwrap();
        while stream.heights_of(1).await < 20 {}
        until("its time goes on", async || {
            server.get(&live).await.expect(200)["tick"].as_u64().unwrap() >= tick + 30
        })
        .await;

        disk.fail(None);
        let url = format!("{path}/snowfalls");
        until("changes are taken", async || server.post(&url, fall.clone()).await.status != 507)
            .await;
        assert!(server.sessions.vitals().store.is_healthy());
        let fallen = |answers: &[Value]| answers[1]["fallen"].as_f64().unwrap();
        let after = seen(&server, &path).await;
        let once = 0.1 * 20.0 * 21.0 * 18.0 * 0.04;
        assert!((fallen(&after) - fallen(&before) - once).abs() < 1e-3, "one has fallen");
        drop(stream);
        assert_eq!(server.delete(&live).await.status, 204);

        // What is on the disk now is the same.
        let copy = disk.cut(1);
        let twin = start(backend, &copy).await;
        assert_eq!(seen(&twin, &path).await, after, "{failing:?}");
        twin.get(&live).await.problem(404);
        twin.stop().await;
    }
    let after = seen(&server, &path).await;
    server.stop().await;
    server = start(backend, &disk).await;
    assert_eq!(seen(&server, &path).await, after);
    server.stop().await;
}

/// A store in the commits of which its thread can be made to die.
#[derive(Debug)]
struct Mortal {
    store: Box<dyn Store>,
    dies: Arc<AtomicBool>,
}

impl Store for Mortal {
    fn load(&mut self) -> Result<Loaded, StoreError> {
        self.store.load()
    }

    fn commit(&mut self, writes: &[Write]) -> Result<(), StoreError> {
        assert!(!self.dies.load(Ordering::SeqCst), "the thread dies here");
        self.store.commit(writes)
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn changes_are_refused_where_the_thread_that_stores_them_has_died() {
    let disk = Disk::default();
    let dies = Arc::new(AtomicBool::new(false));
    let durability = disk.durability(Duration::from_secs(60));
    let store = Box::new(Mortal { store: durability.store, dies: dies.clone() });
    let durability = Durability { store, ..durability };
    let server = Server::start_stored(BackendChoice::Cpu, Options::default(), durability).await;
    let path = server.create(small()).await;
    let falls = format!("{path}/snowfalls");
    server.post(&falls, json!({"depth": 0.1})).await.expect(200);
    let before = seen(&server, &path).await;
    dies.store(true, Ordering::SeqCst);
    server.post(&falls, json!({"depth": 0.1})).await.problem(500);
    for _ in 0..3 {
        let refused = server.post(&falls, json!({"depth": 0.1})).await.problem(503);
        assert!(refused["detail"].as_str().unwrap().contains("restart"), "{refused}");
    }
    server.get(&format!("{path}/heights")).await.expect(200);
    assert!(!server.sessions.vitals().store.is_healthy(), "whoever watches is told");
    server.stop().await;
    let server = start(BackendChoice::Cpu, &disk).await;
    assert_eq!(seen(&server, &path).await, before, "what was acknowledged is there, and no more");
    server.stop().await;
}

/// A seq that somebody was told must never be given out again, so a start has to be on disk first.
#[tokio::test(flavor = "multi_thread")]
async fn nobody_is_told_anything_before_a_start_is_on_disk() {
    let disk = Disk::default();
    let server = start(BackendChoice::Cpu, &disk).await;
    let path = server.create(small()).await;
    let id = path.trim_start_matches("/v1/sessions/").to_owned();
    let told = server.post(&format!("{path}/snowfalls"), json!({"depth": 0.1})).await.expect(200);
    server.stop().await;

    let durability = disk.durability(Duration::from_secs(60));
    disk.fail(Some(Failing::ReadOnly));
    let open = Box::new(|| Ok(Box::new(CpuBackend::new(None, false)) as _));
    let options = Options::default();
    let config = WorldConfig { limits: options.limits, publish_rate: 20.0, sleep: true };
    let (sessions, world) = Driver::open(open, config, durability).unwrap();
    until("it can't be written", async || !sessions.vitals().store.is_healthy()).await;
    assert!(!sessions.vitals().is_recovered());
    assert!(matches!(sessions.get(&id), Err(SessionError::Unavailable(_))));
    // Nor does a device that is lost meanwhile wait for the disk.
    sessions.sabotage(Fault::Panic).await;
    until("the device is open again", async || {
        sessions.vitals().rebuilds() == 1 && sessions.vitals().is_healthy()
    })
    .await;
    assert!(!sessions.vitals().is_recovered());
    disk.fail(None);
    until("the session is back", async || sessions.vitals().is_recovered()).await;
    let now = sessions.get(&id).unwrap().view().seq;
    assert!(now > told["seq"].as_u64().unwrap(), "{now} after {told}");
    tokio::task::spawn_blocking(move || world.stop()).await.unwrap();
}

#[tokio::test]
async fn a_directory_that_can_not_be_used_is_said_at_the_start() {
    let data = tempfile::tempdir().unwrap();
    let file = data.path().join("file");
    std::fs::write(&file, "").unwrap();
    for directory in [&file, &file.join("below"), std::path::Path::new("/proc/firn")] {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_firn"))
            .args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--data-dir"])
            .arg(directory)
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(text.contains("--data-dir") && text.contains("--ephemeral"), "{text}");
    }
    // Two servers don't share one.
    let first = Process::ready(data.path(), &["--backend", "cpu"]).await;
    let second = std::process::Command::new(env!("CARGO_BIN_EXE_firn"))
        .args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--data-dir"])
        .arg(data.path())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&second.stderr);
    assert!(!second.status.success() && text.contains("another server"), "{text}");
    first.kill().await;
}
