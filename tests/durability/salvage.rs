//! What comes back from a damaged file: nothing that was deleted, and nothing that takes changes
//! before an administrator says so. Where nothing comes back, the server does not begin empty
//! without being told to.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use firn::config::{AccessConfig, ApiKey, BackendChoice};
use firn::driver::Durability;
use firn::store::RedbStore;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use reqwest::Method;
use serde_json::{Value, json};
use tempfile::NamedTempFile;

use crate::process::Process;
use crate::support::{Options, Reply, Server, small};

const FILE: &str = "firn.redb";
const OPERATOR: &str = "the-key-of-the-operator";
const WRITER: &str = "the-key-of-alpine-that-writes";
/// Longest time until a server that does not start has ended.
const PATIENCE: Duration = Duration::from_secs(60);
const CPU: [&str; 2] = ["--backend", "cpu"];

/// Where redb says what format a file has: the first byte that it does not read as damage.
const FORMAT_BYTE: usize = 64;

async fn start(data: &Path, options: Options) -> Server {
    let store = Box::new(RedbStore::in_directory(data).expect("the server starts all the same"));
    let checkpoint_interval = Duration::from_secs(3600);
    let durability = Durability { store, checkpoint_interval, accept_loss: false };
    Server::start_stored(BackendChoice::Cpu, options, durability).await
}

/// A body of a small session of a name.
fn named(id: &str) -> Value {
    let mut body = small();
    body["id"] = json!(id);
    body
}

/// The files that a damaged store is kept as.
fn kept(data: &Path) -> Vec<PathBuf> {
    let files = fs::read_dir(data).unwrap().map(|file| file.unwrap().path());
    let mut kept: Vec<PathBuf> =
        files.filter(|path| path.to_string_lossy().contains(".damaged-")).collect();
    kept.sort();
    kept
}

/// A store with sessions that live, `live-…`, and such as were deleted, `dead-…`; as it is while a
/// server uses it, and after that was stopped.
async fn prepare(data: &Path) -> [Vec<u8>; 2] {
    let server = start(data, Options::default()).await;
    for i in 0..6 {
        for id in [format!("live-{i}"), format!("dead-{i}")] {
            let path = server.create(named(&id)).await;
            let fall = json!({"depth": 0.1});
            server.post(&format!("{path}/snowfalls"), fall).await.expect(200);
        }
        // Some at once and some later, so that their rows lie on pages of all kinds.
        if i % 2 == 0 {
            assert_eq!(server.delete(&format!("/v1/sessions/dead-{i}")).await.status, 204);
        }
    }
    for i in [1, 3, 5] {
        assert_eq!(server.delete(&format!("/v1/sessions/dead-{i}")).await.status, 204);
    }
    server.create(named("last")).await;
    let crashed = fs::read(data.join(FILE)).unwrap();
    server.stop().await;
    [crashed, fs::read(data.join(FILE)).unwrap()]
}

#[tokio::test(flavor = "multi_thread")]
async fn no_flipped_bit_brings_back_what_was_deleted() {
    let data = tempfile::tempdir().unwrap();
    let files = prepare(data.path()).await;
    let mut dice = SmallRng::seed_from_u64(1);
    let mut salvaged = 0;
    for good in &files {
        // The head of the file, which leads to all the rest, and some of that.
        let head = (0..512).filter(|&at| good[at] != 0).collect::<Vec<_>>();
        let rest: Vec<usize> = (512..good.len()).filter(|&at| good[at] != 0).collect();
        let some = (0..40).map(|_| rest[dice.random_range(0..rest.len())]).collect::<Vec<_>>();
        for at in head.into_iter().chain(some) {
            let data = tempfile::tempdir().unwrap();
            let mut bad = good.clone();
            bad[at] ^= 1 << dice.random_range(0..8);
            fs::write(data.path().join(FILE), bad).unwrap();
            let server = start(data.path(), Options::default()).await;
            for i in 0..6 {
                let dead = server.get(&format!("/v1/sessions/dead-{i}")).await;
                assert_eq!(dead.status, 404, "dead-{i} is back, after a flipped bit at {at}");
            }
            let damaged = server.get("/readyz").await.expect(200)["store"] == "damaged";
            salvaged += usize::from(damaged);
            let list = server.get("/v1/sessions").await.expect(200);
            for session in list["items"].as_array().unwrap() {
                assert_eq!(session["locked"], damaged, "at {at}: {session}");
            }
            assert_eq!(damaged, !kept(data.path()).is_empty());
            server.stop().await;
        }
    }
    assert!(salvaged > 100, "{salvaged} damages were noticed: the test shows nothing");
}

/// The byte of a file that says which of its two newest states is the newest.
const STATE_BYTE: usize = 9;

#[tokio::test(flavor = "multi_thread")]
async fn a_head_that_leads_to_the_state_before_a_deletion_brings_nothing_back_that_can_be_used() {
    let data = tempfile::tempdir().unwrap();
    let server = Process::ready(data.path(), &CPU).await;
    for id in ["live", "dead"] {
        server.post("/v1/sessions", named(id)).await;
    }
    let deleted = server.send(Method::DELETE, "/v1/sessions/dead", None).await.unwrap();
    assert_eq!(deleted.0, 204);
    server.kill().await;
    let good = fs::read(data.path().join(FILE)).unwrap();
    let mut back = 0;
    for bit in 0..8 {
        let data = tempfile::tempdir().unwrap();
        let mut bad = good.clone();
        bad[STATE_BYTE] ^= 1 << bit;
        fs::write(data.path().join(FILE), bad).unwrap();
        let server = Process::ready(data.path(), &CPU).await;
        let live = server.get("/v1/sessions/live").await;
        let locks = live["locked"] == true;
        let damaged = server.get("/readyz").await["store"] == "damaged";
        assert_eq!(locks, damaged, "bit {bit}: the session that nobody deleted");
        let (status, dead) = server.send(Method::GET, "/v1/sessions/dead", None).await.unwrap();
        assert!(status == 404 || dead["locked"] == true, "bit {bit}: {dead}");
        back += usize::from(status == 200);
        server.kill().await;
    }
    assert_eq!(back, 1, "one bit tells the newest state: the test shows nothing without it");
}

/// A server with keys, on a data directory.
async fn guarded(data: &Path, keys: &NamedTempFile) -> Server {
    let access = AccessConfig {
        api_key: Some(ApiKey::from(OPERATOR)),
        api_keys_file: Some(keys.path().to_owned()),
        ..AccessConfig::default()
    };
    start(data, Options { access, ..Options::default() }).await
}

async fn send(server: &Server, token: &str, method: Method, path: &str, body: Value) -> Reply {
    server.send_as(token, method, path, &body).await
}

#[tokio::test(flavor = "multi_thread")]
async fn what_comes_back_stands_still_and_is_locked_until_an_administrator_says_otherwise() {
    let data = tempfile::tempdir().unwrap();
    let keys = NamedTempFile::new().unwrap();
    let scopes = "[\"read\", \"write\"]";
    let entry = format!("[[tenants.alpine.keys]]\nkey = \"{WRITER}\"\nscopes = {scopes}\n");
    fs::write(keys.path(), entry).unwrap();
    let server = guarded(data.path(), &keys).await;
    let mut live = named("peak");
    (live["paused"], live["delete_after_s"]) = (json!(false), json!(1));
    let made = send(&server, WRITER, Method::POST, "/v1/sessions", live).await.expect(201);
    let token = made["token"].as_str().unwrap();
    send(&server, WRITER, Method::POST, "/v1/sessions", named("col")).await.expect(201);
    server.stop().await;
    let path = data.path().join(FILE);
    let mut bytes = fs::read(&path).unwrap();
    bytes[0] ^= 1;
    fs::write(&path, &bytes).unwrap();

    let peak = "/v1/sessions/peak";
    let mut server = guarded(data.path(), &keys).await;
    for round in 0..2 {
        let seen = send(&server, token, Method::GET, peak, Value::Null).await.expect(200);
        assert_eq!((&seen["locked"], &seen["state"]), (&json!(true), &json!("paused")));
        let fall = json!({"depth": 0.1});
        let collider = json!({"mass": 5, "shape": {"type": "disk", "radius": 0.3},
            "position": {"x": 1, "z": 0.7}});
        for (method, at, body) in [
            (Method::POST, "/snowfalls", fall.clone()),
            (Method::PATCH, "", json!({"paused": false})),
            (Method::PUT, "/colliders/boot", collider),
            (Method::POST, "/step", json!({"ticks": 1})),
            (Method::POST, "/reset", json!({})),
            (Method::POST, "/tokens", Value::Null),
            (Method::DELETE, "", Value::Null),
        ] {
            for who in [token, WRITER] {
                let at = format!("{peak}{at}");
                let refused = send(&server, who, method.clone(), &at, body.clone()).await;
                let problem = refused.problem(423);
                assert_eq!(problem["type"], "urn:firn:problem:locked", "{method} {at}");
            }
        }
        for read in ["/heights", "/mass", "/digest", "/snapshot"] {
            let at = format!("{peak}{read}");
            let seen = send(&server, token, Method::GET, &at, Value::Null).await;
            assert_eq!(seen.status, 200, "{at}");
        }
        for who in [token, WRITER, made["viewer_token"].as_str().unwrap()] {
            let at = format!("{peak}/unlock");
            send(&server, who, Method::POST, &at, Value::Null).await.problem(403);
        }
        let metrics = String::from_utf8(server.get("/metrics").await.body).unwrap();
        let damaged = 1 - round;
        for line in [
            format!("firn_store_damaged {damaged}\n"),
            format!("firn_store_revived_sessions {}\n", 2 * damaged),
            "firn_locked_sessions 2\n".to_owned(),
        ] {
            assert!(metrics.contains(&line), "no {line} in {metrics}");
        }
        // Nobody has asked for it for a while, and it is there all the same; then a restart.
        server.beats(72).await;
        server.stop().await;
        server = guarded(data.path(), &keys).await;
    }
    let unlock = |id: &str| format!("/v1/sessions/{id}/unlock");
    let open = send(&server, OPERATOR, Method::POST, &unlock("peak"), Value::Null).await;
    let open = open.expect(200);
    assert_eq!((&open["locked"], &open["state"]), (&json!(false), &json!("paused")));
    send(&server, OPERATOR, Method::POST, &unlock("peak"), Value::Null).await.expect(200);
    let kept = json!({"paused": false, "delete_after_s": null});
    send(&server, token, Method::PATCH, peak, kept).await.expect(200);
    let gone = send(&server, OPERATOR, Method::DELETE, "/v1/sessions/col", Value::Null).await;
    assert_eq!(gone.status, 204, "an administrator may delete it instead");
    server.stop().await;

    let server = guarded(data.path(), &keys).await;
    let seen = send(&server, token, Method::GET, peak, Value::Null).await.expect(200);
    assert_eq!((&seen["locked"], &seen["state"]), (&json!(false), &json!("running")));
    send(&server, OPERATOR, Method::GET, "/v1/sessions/col", Value::Null).await.problem(404);
    server.stop().await;
}

/// A store of which nothing is left, in some way.
fn rubbish(good: &[u8]) -> [Vec<u8>; 3] {
    let mut dice = SmallRng::seed_from_u64(2);
    let noise = (0..good.len()).map(|_| dice.random()).collect();
    [noise, Vec::new(), good[..100].to_vec()]
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_has_lost_everything_does_not_begin_empty_unless_it_is_told_to() {
    let data = tempfile::tempdir().unwrap();
    let path = data.path().join(FILE);
    let [_, good] = prepare(data.path()).await;
    for (i, bad) in rubbish(&good).into_iter().enumerate() {
        fs::write(&path, &bad).unwrap();
        for _ in 0..2 {
            let ended = Process::command(data.path(), &CPU).kill_on_drop(true).output();
            let refused =
                tokio::time::timeout(PATIENCE, ended).await.expect("it began empty").unwrap();
            let text = String::from_utf8_lossy(&refused.stderr);
            assert_eq!(refused.status.code(), Some(1), "{text}");
            let last = text.lines().rfind(|line| line.starts_with("error:")).expect("an error");
            for word in ["--accept-loss", "backup", &*path.to_string_lossy()] {
                assert!(last.contains(word), "no {word} in {last}");
            }
            assert!(fs::read(&path).unwrap() == bad, "the file is as it was");
        }
        let server = Process::ready(data.path(), &[CPU[0], CPU[1], "--accept-loss"]).await;
        assert_eq!(server.get("/readyz").await["store"], "damaged");
        assert_eq!(server.metric("firn_store_damaged").await, 1.0);
        server.post("/v1/sessions", small()).await;
        server.kill().await;
        let kept = kept(data.path());
        assert_eq!(kept.len(), i + 1, "{kept:?}");
        assert!(kept.iter().any(|path| fs::read(path).unwrap() == bad), "it is kept as it was");
        let server = Process::ready(data.path(), &CPU).await;
        assert_eq!(server.get("/readyz").await["store"], "sound");
        server.kill().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_file_that_tells_another_format_is_salvaged_too() {
    let data = tempfile::tempdir().unwrap();
    let files = prepare(data.path()).await;
    for good in &files {
        for slot in [0, 128] {
            for bit in 0..8 {
                let data = tempfile::tempdir().unwrap();
                let mut bad = good.clone();
                bad[FORMAT_BYTE + slot] ^= 1 << bit;
                fs::write(data.path().join(FILE), bad).unwrap();
                let server = start(data.path(), Options::default()).await;
                let list = server.get("/v1/sessions").await.expect(200);
                let count = list["items"].as_array().unwrap().len();
                assert_eq!(count, 7, "slot {slot}, bit {bit}");
                server.stop().await;
            }
        }
    }
}
