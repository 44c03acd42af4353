//! Snapshots over HTTP: saved, restored bit for bit, and refused where they are not sound.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::{Options, Reply, Server, small};

on_each_backend!(
    a_restored_session_goes_on_bit_for_bit,
    a_snapshot_of_a_settled_session_is_small,
    what_is_not_a_sound_snapshot_is_refused,
    a_live_session_has_one_digest_at_a_tick,
    a_restored_session_is_reset_to_what_was_saved,
    digests_tell_snowpacks_apart,
    a_forged_snapshot_is_refused,
    a_reset_leads_back_to_the_digest_of_the_beginning,
);

const MEDIA_TYPE: &str = "application/vnd.firn.snapshot";

/// A session with a history: layers, an object that has moved, a changed exponent.
async fn eventful(server: &Server) -> String {
    let grid = json!({"width": 21, "depth": 18, "height": 20, "cell_size": 0.2});
    let snow = json!([{"depth": 1.5}, {"depth": 0.7, "temperature": -14, "density": 33}]);
    let body = json!({"grid": grid, "paused": true, "tick_rate": 45, "initial_snow": snow});
    let path = server.create(body).await;
    let object = json!({"id": "a", "mass": 70, "shape": {"type": "disk", "radius": 0.5},
        "position": {"x": 1.1, "z": 1.3}});
    server.post(&format!("{path}/colliders"), object).await.expect(201);
    server.post(&format!("{path}/step"), json!({"ticks": 100})).await.expect(200);
    let moved = json!({"position": {"x": 1.6, "z": 1.3}});
    server.patch(&format!("{path}/colliders/a"), moved).await.expect(200);
    server.patch(&path, json!({"stiffness_exponent": 3.4, "snowfall_rate": 2})).await.expect(200);
    server.post(&format!("{path}/step"), json!({"ticks": 61})).await.expect(200);
    path
}

async fn snapshot(server: &Server, path: &str) -> Vec<u8> {
    let reply = server.get(&format!("{path}/snapshot")).await;
    assert_eq!((reply.status, reply.header("content-type")), (200, MEDIA_TYPE));
    reply.body
}

async fn digest(server: &Server, path: &str) -> Value {
    server.get(&format!("{path}/digest")).await.expect(200)["digest"].clone()
}

async fn restore(server: &Server, query: &str, bytes: Vec<u8>) -> Reply {
    server.post_bytes(&format!("/v1/sessions{query}"), MEDIA_TYPE, bytes).await
}

async fn a_restored_session_goes_on_bit_for_bit(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = eventful(&server).await;
    let made = restore(&server, "?id=twin", snapshot(&server, &path).await).await.expect(201);
    assert_eq!(made["id"], "twin");
    let twin = "/v1/sessions/twin";
    assert_eq!(digest(&server, twin).await, digest(&server, &path).await);
    for session in [&path[..], twin] {
        server.post(&format!("{session}/step"), json!({"ticks": 333})).await.expect(200);
        server.post(&format!("{session}/snowfalls"), json!({"depth": 0.05})).await.expect(200);
        server.post(&format!("{session}/step"), json!({"ticks": 100})).await.expect(200);
    }
    assert_eq!(digest(&server, twin).await, digest(&server, &path).await);
    for read in ["colliders", "mass", "columns/8/6"] {
        let mut ours = server.get(&format!("{twin}/{read}")).await.expect(200);
        let mut theirs = server.get(&format!("{path}/{read}")).await.expect(200);
        // Seqs count publications, which are the server's own business.
        (ours["seq"], theirs["seq"]) = (Value::Null, Value::Null);
        assert_eq!(ours, theirs, "{read}");
    }
    let taken = restore(&server, "?id=twin", snapshot(&server, &path).await).await;
    taken.problem(409);
    server.stop().await;
}

async fn a_snapshot_of_a_settled_session_is_small(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(json!({"paused": true, "initial_snow": [{"depth": 5.8}]})).await;
    let goal = json!({"until_settled": true, "max_seconds": 2000});
    server.post(&format!("{path}/step"), goal).await.expect(200);
    let bytes = snapshot(&server, &path).await;
    assert!(bytes.len() <= 40_000, "{} bytes", bytes.len());
    server.stop().await;
}

async fn what_is_not_a_sound_snapshot_is_refused(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = eventful(&server).await;
    let good = snapshot(&server, &path).await;
    let count = || async {
        server.get("/v1/sessions").await.expect(200)["items"].as_array().unwrap().len()
    };
    let before = count().await;
    let mut cases: Vec<(String, Vec<u8>)> = vec![
        ("empty".into(), Vec::new()),
        (
            "foreign".into(),
            b"PK\x03\x04 something else entirely, long enough to have a head".to_vec(),
        ),
    ];
    for length in [7, 47, 48, 60, good.len() / 2, good.len() - 1] {
        cases.push((format!("cut to {length}"), good[..length].to_vec()));
    }
    let mut newer = good.clone();
    newer[8] = 3;
    cases.push(("newer".into(), newer));
    for at in [0, 16, 40, 50, good.len() / 3, good.len() / 2, good.len() - 5] {
        let mut damaged = good.clone();
        damaged[at] ^= 0x10;
        cases.push((format!("bit flipped at {at}"), damaged));
    }
    let mut longer = good.clone();
    longer.extend(b"more");
    cases.push(("longer".into(), longer));
    for (what, bytes) in cases {
        let reply = restore(&server, "", bytes).await;
        assert_eq!(reply.status, 422, "{what}: {}", String::from_utf8_lossy(&reply.body));
        reply.problem(422);
    }
    assert_eq!(count().await, before);
    restore(&server, "?id=not%20a%20name", good.clone()).await.problem(422);
    restore(&server, "", good).await.expect(201);
    server.stop().await;
}

async fn a_restored_session_is_reset_to_what_was_saved(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = eventful(&server).await;
    restore(&server, "?id=twin", snapshot(&server, &path).await).await.expect(201);
    let twin = "/v1/sessions/twin";
    let saved = digest(&server, twin).await;
    server.post(&format!("{twin}/clearings"), json!({"depth": 0.3})).await.expect(200);
    server.delete(&format!("{twin}/colliders/a")).await;
    server.post(&format!("{twin}/step"), json!({"ticks": 50})).await.expect(200);
    assert_ne!(digest(&server, twin).await, saved);
    server.post(&format!("{twin}/reset"), json!({})).await.expect(200);
    assert_eq!(digest(&server, twin).await, saved);
    server.stop().await;
}

async fn digests_tell_snowpacks_apart(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let body = || {
        json!({"grid": {"width": 9, "depth": 9, "height": 9, "cell_size": 0.2},
        "paused": true, "initial_snow": [{"depth": 1}]})
    };
    let (a, b) = (server.create(body()).await, server.create(body()).await);
    assert_eq!(digest(&server, &a).await, digest(&server, &b).await);
    let region = json!({"x": 0.4, "z": 0.4, "width": 0.2, "depth": 0.2});
    let flake = json!({"depth": 0.001, "region": region});
    server.post(&format!("{b}/snowfalls"), flake).await.expect(200);
    assert_ne!(digest(&server, &a).await, digest(&server, &b).await);
    server.stop().await;
}

/// Changes a snapshot's description, and makes its hash right again.
fn forge(bytes: &[u8], change: impl Fn(&mut Value)) -> Vec<u8> {
    let body = zstd::decode_all(&bytes[48..]).unwrap();
    let length = u64::from_le_bytes(body[..8].try_into().unwrap()) as usize;
    let mut description = serde_json::from_slice(&body[8..8 + length]).unwrap();
    change(&mut description);
    let description = serde_json::to_vec(&description).unwrap();
    let mut forged = (description.len() as u64).to_le_bytes().to_vec();
    forged.extend(description);
    forged.extend(&body[8 + length..]);
    let mut file = bytes[..16].to_vec();
    file.extend(blake3::hash(&forged).as_bytes());
    file.extend(zstd::encode_all(&forged[..], 1).unwrap());
    file
}

async fn a_forged_snapshot_is_refused(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = eventful(&server).await;
    let good = snapshot(&server, &path).await;
    let same = restore(&server, "?id=same", forge(&good, |_| {})).await;
    assert_eq!(same.status, 201, "{}", String::from_utf8_lossy(&same.body));
    type Forgery = (&'static str, fn(&mut Value));
    let changes: [Forgery; 13] = [
        ("time saved up", |d| d["clock"]["pending"][1] = json!(2e5)),
        ("another clock", |d| d["clock"]["dt"] = json!(1)),
        ("a future", |d| d["clock"]["mark"][0] = json!(1u64 << 60)),
        ("snow in the air", |d| d["falling"]["mass"] = json!(9e11)),
        ("endless snow", |d| d["falling"]["depth"] = json!(1e300)),
        ("bands of a world that has one", |d| {
            d["falling"]["spreading"] =
                json!({"depth": 65536, "mass": 1000, "celsius": -3, "bands": 1})
        }),
        ("too heavy", |d| d["colliders"][0]["mass"] = json!(1e300)),
        ("no size", |d| {
            d["colliders"][0]["shape"] = json!({"type": "box", "width": -0.5, "depth": 1})
        }),
        ("elsewhere", |d| d["colliders"][0]["position"]["x"] = json!(-9)),
        ("another mass", |d| d["ledger"]["fallen"] = json!(1)),
        ("another material", |d| d["material"]["max_density"] = json!(200)),
        ("another grid", |d| d["spec"]["grid"]["width"] = json!(1000)),
        ("unknown", |d| d["colour"] = json!("white")),
    ];
    for (what, change) in changes {
        let reply = restore(&server, "", forge(&good, change)).await;
        assert_eq!(reply.status, 422, "{what}: {}", String::from_utf8_lossy(&reply.body));
    }
    server.stop().await;
}

async fn a_reset_leads_back_to_the_digest_of_the_beginning(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let body = json!({"grid": {"width": 12, "depth": 9, "height": 20, "cell_size": 0.2},
        "paused": true, "initial_snow": [{"depth": 3.3}]});
    let path = server.create(body).await;
    let beginning = digest(&server, &path).await;
    server.patch(&path, json!({"paused": true, "air_temperature": -3})).await.expect(200);
    assert_eq!(digest(&server, &path).await, beginning, "nothing has changed");
    let object = json!({"mass": 70, "shape": {"type": "disk", "radius": 0.5},
        "position": {"x": 1.1, "z": 0.9}});
    server.post(&format!("{path}/colliders"), object).await.expect(201);
    server.step(&path, 77).await;
    server.patch(&path, json!({"air_temperature": -9, "tick_rate": 30})).await.expect(200);
    assert_ne!(digest(&server, &path).await, beginning);
    server.post(&format!("{path}/reset"), json!({})).await.expect(200);
    assert_eq!(digest(&server, &path).await, beginning);
    server.stop().await;
}

/// Whenever it is asked for: snow that falls at a tick is in all digests of that tick.
async fn a_live_session_has_one_digest_at_a_tick(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut snowy = small();
    snowy["tick_rate"] = json!(15);
    snowy["snowfall_rate"] = json!(100);
    let path = server.create(snowy).await;
    let plate = json!({"mass": 40, "position": {"x": 1, "z": 0.7},
        "shape": {"type": "disk", "radius": 0.3}});
    server.put(&format!("{path}/colliders/plate"), plate).await.expect(201);
    server.patch(&path, json!({"paused": false})).await.expect(200);
    let (mut ticks, mut last) = (0, Value::Null);
    while ticks < 12 {
        let answer = server.get(&format!("{path}/digest")).await.expect(200);
        ticks += u32::from(answer["tick"] != last["tick"]);
        if answer["tick"] == last["tick"] {
            assert_eq!(answer["digest"], last["digest"], "tick {}", last["tick"]);
        }
        last = answer;
    }
    server.stop().await;
}

/// A full server says so before it reads the cells, which a small file can have a lot of.
#[tokio::test(flavor = "multi_thread")]
async fn a_full_server_reads_no_cells() {
    let mut options = Options::default();
    options.limits.sessions = 1;
    let server = Server::start_with(BackendChoice::Cpu, options).await;
    let path = eventful(&server).await;
    let mut file = snapshot(&server, &path).await;
    // Whoever reads all of it finds that its hash is another.
    file[20] ^= 1;
    restore(&server, "", file.clone()).await.problem(429);
    server.delete(&path).await.expect(204);
    restore(&server, "", file).await.problem(422);
    assert_eq!(server.sessions.count(), 0, "what was refused takes no room");
    server.stop().await;
}

/// More than are decoded at the same time: they wait for each other, and all are made.
#[tokio::test(flavor = "multi_thread")]
async fn snapshots_wait_for_their_turn() {
    let server = std::sync::Arc::new(Server::start(BackendChoice::Cpu).await);
    let path = eventful(&server).await;
    let file = snapshot(&server, &path).await;
    let mut uploads = tokio::task::JoinSet::new();
    for _ in 0..12 {
        let (server, file) = (server.clone(), file.clone());
        uploads.spawn(async move { restore(&server, "", file).await.status });
    }
    assert_eq!(uploads.join_all().await, [201; 12]);
    assert_eq!(server.sessions.count(), 13);
    std::sync::Arc::into_inner(server).expect("all are made").stop().await;
}
