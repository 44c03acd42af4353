//! `kill -9` at random moments under load: what was acknowledged is there, nothing is torn.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use reqwest::{Client, Method};
use serde_json::{Value, json};

use crate::process::{Process, send};
use crate::support::skips_gpu;

/// Clients, each with sessions of its own and one request under way.
const CLIENTS: u64 = 6;

/// What one client knows to be acknowledged, and what it had asked for when the server died.
#[derive(Default)]
struct Knowledge {
    sessions: BTreeMap<String, Known>,
    deleted: Vec<String>,
}

#[derive(Clone, Default)]
struct Known {
    fallen: f64,
    cleared: f64,
    tick: u64,
    seq: u64,
    objects: BTreeMap<String, f64>,
    celsius: Option<f64>,
    /// Under way at the end: what may or may not have happened.
    asked: Option<(Method, String, Value)>,
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_acknowledged_is_lost_by_a_kill() {
    let rounds = std::env::var("FIRN_KILL_ROUNDS").map_or(20, |rounds| rounds.parse().unwrap());
    let data = tempfile::tempdir().unwrap();
    let mut dice = SmallRng::seed_from_u64(rounds);
    let mut known: Vec<Knowledge> = (0..CLIENTS).map(|_| Knowledge::default()).collect();
    let mut acknowledged = 0;
    for round in 0..rounds {
        let on_gpu = round % 5 == 0 && !skips_gpu();
        let backend = if on_gpu { "gpu" } else { "cpu" };
        // Checkpoints fall between changes, at every moment.
        let options = ["--backend", backend, "--checkpoint-interval", "80ms"];
        let server = Process::ready(data.path(), &options).await;
        for knowledge in &mut known {
            check(&server, knowledge).await;
        }
        let dead = Arc::new(AtomicBool::new(false));
        let clients: Vec<_> = known
            .drain(..)
            .zip(0..)
            .map(|(knowledge, client)| {
                let (url, dead) = (server.url.clone(), dead.clone());
                tokio::spawn(load(url, knowledge, round * 1000 + client, dead))
            })
            .collect();
        tokio::time::sleep(Duration::from_millis(dice.random_range(30..700))).await;
        server.kill().await;
        dead.store(true, Ordering::Relaxed);
        for client in clients {
            let (knowledge, count) = client.await.unwrap();
            known.push(knowledge);
            acknowledged += count;
        }
    }
    assert!(acknowledged > 20 * rounds, "only {acknowledged} requests in {rounds} rounds");
    println!("{acknowledged} requests were acknowledged in {rounds} rounds");
}

/// Asks for changes until the server is gone.
async fn load(
    url: String,
    mut knowledge: Knowledge,
    seed: u64,
    dead: Arc<AtomicBool>,
) -> (Knowledge, u64) {
    let mut dice = SmallRng::seed_from_u64(seed);
    let client = Client::new();
    let mut acknowledged = 0;
    for count in 0.. {
        if knowledge.sessions.len() < 2 || (count % 40 == 39 && knowledge.sessions.len() < 4) {
            let id = format!("s{seed}-{count}");
            knowledge.sessions.insert(id.clone(), Known::default());
            let grid = json!({"width": 12, "depth": 9, "height": 12, "cell_size": 0.2});
            // Some have ticks of so many cycles that they are parted.
            let time_scale = [1, 1, 1000][dice.random_range(0..3)];
            let body = json!({"id": id, "grid": grid, "paused": dice.random_bool(0.5),
                "tick_rate": 30, "time_scale": time_scale});
            knowledge.sessions.get_mut(&id).unwrap().asked =
                Some((Method::PUT, "create".to_owned(), Value::Null));
            let Some((status, answer)) =
                send(&client, &url, Method::POST, "/v1/sessions", Some(&body)).await
            else {
                break;
            };
            assert_eq!(status, 201, "{answer}");
            knowledge.sessions.get_mut(&id).unwrap().asked = None;
            acknowledged += 1;
            continue;
        }
        let nth = dice.random_range(0..knowledge.sessions.len());
        let id = knowledge.sessions.keys().nth(nth).unwrap().clone();
        let known = knowledge.sessions.get_mut(&id).unwrap();
        if knowledge.deleted.len() < 1000 && dice.random_range(0..60) == 0 {
            let path = format!("/v1/sessions/{id}");
            known.asked = Some((Method::DELETE, String::new(), Value::Null));
            let Some((status, _)) = send(&client, &url, Method::DELETE, &path, None).await else {
                break;
            };
            assert_eq!(status, 204);
            knowledge.sessions.remove(&id);
            knowledge.deleted.push(id);
            acknowledged += 1;
            continue;
        }
        let asked = ask(&mut dice);
        let (method, path, body) = asked.clone();
        known.asked = Some(asked);
        let path = format!("/v1/sessions/{id}{path}");
        let Some((status, answer)) = send(&client, &url, method, &path, Some(&body)).await else {
            break;
        };
        // A running session can't be stepped.
        assert!(status < 300 || status == 409, "{path}: {status} {answer}");
        let (_, path, body) = known.asked.take().unwrap();
        if status < 300 {
            known.learn(&path, &body, &answer);
            acknowledged += 1;
        }
    }
    while !dead.load(Ordering::Relaxed) {
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    (knowledge, acknowledged)
}

fn ask(dice: &mut SmallRng) -> (Method, String, Value) {
    match dice.random_range(0..10) {
        0..5 => {
            let fall = json!({"depth": dice.random_range(0.01..0.3)});
            (Method::POST, "/snowfalls".to_owned(), fall)
        }
        5 => (Method::POST, "/clearings".to_owned(), json!({"depth": dice.random_range(0.2..2.0)})),
        6 | 7 => {
            let x = dice.random_range(0.5..1.9);
            let body = json!({"mass": 30, "shape": {"type": "disk", "radius": 0.3},
                "position": {"x": x, "z": 0.9}});
            (Method::PUT, format!("/colliders/{}", ["a", "b"][dice.random_range(0..2)]), body)
        }
        8 => {
            let celsius = json!({"celsius": dice.random_range(-20.0..0.0)});
            (Method::PUT, "/air-temperature".to_owned(), celsius)
        }
        _ => {
            let ticks = json!({"ticks": dice.random_range(1..30)});
            (Method::POST, "/step".to_owned(), ticks)
        }
    }
}

impl Known {
    fn learn(&mut self, path: &str, body: &Value, answer: &Value) {
        self.tick = self.tick.max(answer["tick"].as_u64().unwrap());
        self.seq = self.seq.max(answer["seq"].as_u64().unwrap());
        match path {
            "/snowfalls" => self.fallen += answer["fallen_mass"].as_f64().unwrap(),
            "/clearings" => self.cleared += answer["cleared_mass"].as_f64().unwrap(),
            "/air-temperature" => self.celsius = answer["celsius"].as_f64(),
            _ => {
                if let Some(object) = path.strip_prefix("/colliders/") {
                    let x = body["position"]["x"].as_f64().unwrap();
                    self.objects.insert(object.to_owned(), x);
                }
            }
        }
    }
}

/// Compares what is there with what was acknowledged; what was under way may be there, whole.
async fn check(server: &Process, knowledge: &mut Knowledge) {
    for id in &knowledge.deleted {
        let path = format!("/v1/sessions/{id}");
        let (status, _) = server.send(Method::GET, &path, None).await.unwrap();
        assert_eq!(status, 404, "{id} was deleted");
    }
    let ids: Vec<String> = knowledge.sessions.keys().cloned().collect();
    for id in ids {
        let known = knowledge.sessions.get_mut(&id).unwrap();
        let (method, path, body) = known.asked.take().unwrap_or_default();
        let at = format!("/v1/sessions/{id}");
        let (status, session) = server.send(Method::GET, &at, None).await.unwrap();
        if status == 404 && (path == "create" || method == Method::DELETE) {
            knowledge.sessions.remove(&id);
            continue;
        }
        assert_eq!(status, 200, "{id}: {session}");
        if session["locked"] == true {
            assert_eq!(method, Method::DELETE, "{id} is locked, and nobody wanted it deleted");
            server.post(&format!("{at}/unlock"), Value::Null).await;
            server.send(Method::PATCH, &at, Some(&json!({"paused": false}))).await;
        }
        assert!(session["tick"].as_u64().unwrap() >= known.tick, "{id}: {session}");
        assert!(session["seq"].as_u64().unwrap() >= known.seq, "{id}: {session}");
        let mass = server.get(&format!("{at}/mass")).await;
        assert_eq!(mass["imbalance_quanta"], 0, "{id}: {mass}");
        let near = |a: f64, b: f64| (a - b).abs() < 1e-6 * (1.0 + b);
        let fallen = mass["fallen"].as_f64().unwrap();
        if path != "/snowfalls" {
            assert!(near(fallen, known.fallen), "{id}: {fallen} of {} kg", known.fallen);
        } else {
            let more = body["depth"].as_f64().unwrap() * 20.0 * 12.0 * 9.0 * 0.04;
            let whole = near(fallen, known.fallen) || (fallen - known.fallen - more).abs() < 1e-3;
            assert!(whole, "{id}: {fallen} of {} and perhaps {more} kg", known.fallen);
        }
        let cleared = mass["cleared"].as_f64().unwrap();
        let exact = near(cleared, known.cleared);
        assert!(exact || (path == "/clearings" && cleared > known.cleared), "{id}: {cleared}");
        let objects = server.get(&format!("{at}/colliders")).await;
        for (object, &x) in &known.objects {
            let found = objects["items"].as_array().unwrap().iter().find(|o| o["id"] == *object);
            let found = found.unwrap_or_else(|| panic!("{id} has lost {object}: {objects}"));
            let moved = path == format!("/colliders/{object}");
            let asked = body["position"]["x"].as_f64();
            let there = found["position"]["x"].as_f64();
            assert!(there == Some(x) || (moved && there == asked), "{id}: {found}");
        }
        if let Some(celsius) = known.celsius {
            let there = session["air_temperature"].as_f64();
            let asked = (path == "/air-temperature").then(|| body["celsius"].as_f64()).flatten();
            assert!(there == Some(celsius) || there == asked, "{id}: {session}");
        }
        // From here on this is what is known.
        known.fallen = fallen;
        known.cleared = cleared;
        known.celsius = known.celsius.and(session["air_temperature"].as_f64());
        known.seq = session["seq"].as_u64().unwrap();
        for object in objects["items"].as_array().unwrap() {
            let x = object["position"]["x"].as_f64().unwrap();
            known.objects.insert(object["id"].as_str().unwrap().to_owned(), x);
        }
    }
}
