//! Backups of a running server: each is one moment of it, a server starts from it, and nothing is left of
//! those that nobody took.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use firn::store::{Kind, RedbStore, Row, Store, Write};
use rand::rngs::SmallRng;
use rand::{RngCore, SeedableRng};
use reqwest::{Client, Method, Response};
use serde_json::{Value, json};

use crate::process::{Process, send};
use crate::script::{history, session};
use crate::support::wait::until;

pub const CPU: [&str; 2] = ["--backend", "cpu"];
pub const FILE: &str = "firn.redb";
const BACKUP: &str = "/v1/store/backup";

/// Names of the files in a directory.
pub fn files(data: &Path) -> Vec<String> {
    let names = fs::read_dir(data).unwrap().map(|entry| entry.unwrap().file_name());
    let mut names: Vec<String> = names.map(|name| name.into_string().unwrap()).collect();
    names.sort();
    names
}

/// Makes the store of a directory some megabytes larger, by a row of each. Returns the rows, which are of the
/// first session and mean nothing.
pub fn fatten(data: &Path, megabytes: u64) -> Vec<Row> {
    let mut store = RedbStore::in_directory(data).unwrap();
    store.load().unwrap();
    let mut dice = SmallRng::seed_from_u64(1);
    let row = |number| Row { session: 0, kind: Kind::Answer, number };
    let rows: Vec<Row> = (0..megabytes).map(row).collect();
    let writes = rows.iter().map(|row| {
        let mut bytes = vec![0; 1 << 20];
        dice.fill_bytes(&mut bytes);
        Write::Put(*row, bytes)
    });
    store.commit(&writes.collect::<Vec<_>>()).unwrap();
    rows
}

/// Sessions that stand still, each with a history; returns their digests.
pub async fn prepare(server: &Process, count: u64) -> Vec<(String, Value)> {
    let mut digests = Vec::new();
    for i in 0..count {
        let path = format!("/v1/sessions/s{i}");
        server.post("/v1/sessions", session(&format!("s{i}"))).await;
        for (method, at, body) in history(i, 12) {
            let (status, answer) =
                server.send(method, &format!("{path}{at}"), Some(&body)).await.unwrap();
            assert!(status < 300, "{at}: {answer}");
        }
        let digest = server.get(&format!("{path}/digest")).await["digest"].clone();
        digests.push((path, digest));
    }
    digests
}

/// Checks that sessions are what they were.
pub async fn are_there(server: &Process, digests: &[(String, Value)]) {
    for (path, digest) in digests {
        assert_eq!(server.get(&format!("{path}/digest")).await["digest"], *digest, "{path}");
    }
}

async fn fallen(server: &Process) -> f64 {
    server.get("/v1/sessions/busy/mass").await["fallen"].as_f64().unwrap()
}

/// A backup that is begun, of which no more is read than it takes to know that.
async fn begin(server: &Process) -> Response {
    Client::new().get(format!("{}{BACKUP}", server.url)).send().await.expect("it answers")
}

/// A data directory with a backup of a server in it.
pub async fn restored(server: &Process) -> tempfile::TempDir {
    let data = tempfile::tempdir().unwrap();
    let answer = begin(server).await;
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.headers()["content-type"], "application/octet-stream");
    assert_eq!(answer.headers()["content-disposition"], "attachment; filename=\"firn.redb\"");
    let length = answer.content_length().expect("its length is told");
    let bytes = answer.bytes().await.expect("it is whole");
    assert_eq!(bytes.len() as u64, length);
    fs::write(data.path().join(FILE), bytes).unwrap();
    data
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_under_load_has_all_that_was_acknowledged_before_it() {
    let data = tempfile::tempdir().unwrap();
    let server = Process::ready(data.path(), &CPU).await;
    let digests = prepare(&server, 4).await;
    server.post("/v1/sessions", session("gone")).await;
    server.send(Method::DELETE, "/v1/sessions/gone", None).await.unwrap();
    server.post("/v1/sessions", session("busy")).await;
    let bare = fallen(&server).await;
    let (path, fall) = ("/v1/sessions/busy/snowfalls", json!({"depth": 0.01}));
    server.post(path, fall.clone()).await;
    let each = fallen(&server).await - bare;
    let (more, acknowledged) = (Arc::new(AtomicBool::new(true)), Arc::new(AtomicU64::new(1)));
    const AT_ONCE: u64 = 4;
    let load = (0..AT_ONCE).map(|_| {
        let (more, acknowledged) = (more.clone(), acknowledged.clone());
        let (url, fall) = (server.url.clone(), fall.clone());
        tokio::spawn(async move {
            let client = Client::new();
            while more.load(Ordering::SeqCst) {
                let answer = send(&client, &url, Method::POST, path, Some(&fall)).await.unwrap();
                assert_eq!(answer.0, 200, "{}", answer.1);
                acknowledged.fetch_add(1, Ordering::SeqCst);
            }
        })
    });
    let load: Vec<_> = load.collect();
    let count = || acknowledged.load(Ordering::SeqCst);
    for _ in 0..3 {
        let begun = count();
        until("changes go on", async || count() > begun + 10).await;
        let before = count();
        let copy = restored(&server).await;
        let most = count() + AT_ONCE;

        let twin = Process::ready(copy.path(), &CPU).await;
        are_there(&twin, &digests).await;
        let there = ((fallen(&twin).await - bare) / each).round() as u64;
        assert!((before..=most).contains(&there), "{there} changes, of {before} to {most}");
        let (status, _) = twin.send(Method::GET, "/v1/sessions/gone", None).await.unwrap();
        assert_eq!(status, 404);
        assert_eq!(twin.get("/readyz").await["store"], "sound");
        twin.post(path, fall.clone()).await;
        twin.kill().await;
    }
    more.store(false, Ordering::SeqCst);
    for task in load {
        task.await.unwrap();
    }
    assert_eq!(files(data.path()), [FILE]);
    server.kill().await;
}

/// Whether a process has a copy of its store open.
#[cfg(target_os = "linux")]
fn has_copy(server: &Process) -> bool {
    let open = fs::read_dir(format!("/proc/{}/fd", server.id())).unwrap();
    let open = open.filter_map(|entry| fs::read_link(entry.unwrap().path()).ok());
    open.into_iter().any(|file: PathBuf| file.to_string_lossy().contains("firn.redb.backup"))
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_goes_away_leaves_nothing_and_others_have_their_turn_then() {
    let data = tempfile::tempdir().unwrap();
    // More than what connections take in that nobody reads from.
    fatten(data.path(), 40);
    let server = Process::ready(data.path(), &CPU).await;
    let stalled = begin(&server).await;
    assert_eq!(stalled.status(), 200);
    assert!(has_copy(&server), "the test shows nothing");
    for (method, path) in
        [(Method::GET, "backup"), (Method::POST, "verify"), (Method::POST, "compact")]
    {
        let path = format!("/v1/store/{path}");
        let (status, problem) = server.send(method, &path, None).await.unwrap();
        assert_eq!(
            (status, &problem["type"]),
            (409, &json!("urn:firn:problem:conflict")),
            "{path}"
        );
    }
    // Changes go on all the same.
    server.post("/v1/sessions", session("s")).await;
    drop(stalled);
    until("its copy is gone", async || !has_copy(&server)).await;
    until("others have their turn", async || begin(&server).await.status() == 200).await;
    assert_eq!(files(data.path()), [FILE]);
    until("that one is gone as well", async || !has_copy(&server)).await;
    until("nobody is before us", async || {
        let verify = server.send(Method::POST, "/v1/store/verify", None).await;
        verify.unwrap().0 == 200
    })
    .await;
    let copy = restored(&server).await;
    let twin = Process::ready(copy.path(), &CPU).await;
    twin.get("/v1/sessions/s").await;
    twin.kill().await;
    server.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_killed_server_left_of_a_copy_is_removed_at_the_next_start() {
    let data = tempfile::tempdir().unwrap();
    Process::ready(data.path(), &CPU).await.kill().await;
    fs::write(data.path().join("firn.redb.backup"), "half a copy").unwrap();
    fs::write(data.path().join("firn-monday.redb"), "somebody's own").unwrap();
    let server = Process::ready(data.path(), &CPU).await;
    assert_eq!(files(data.path()), ["firn-monday.redb", FILE]);
    server.kill().await;
}

/// Where the name is taken by something that can't be removed, nothing else suffers.
#[tokio::test(flavor = "multi_thread")]
async fn a_copy_that_can_not_be_written_is_told_and_costs_nothing_else() {
    let data = tempfile::tempdir().unwrap();
    let server = Process::ready(data.path(), &CPU).await;
    fs::create_dir(data.path().join("firn.redb.backup")).unwrap();
    let (status, problem) = server.send(Method::GET, BACKUP, None).await.unwrap();
    assert_eq!(status, 500, "{problem}");
    assert!(problem["detail"].as_str().unwrap().contains("firn.redb.backup"), "{problem}");
    server.post("/v1/sessions", session("s")).await;
    fs::remove_dir(data.path().join("firn.redb.backup")).unwrap();
    let copy = restored(&server).await;
    let twin = Process::ready(copy.path(), &CPU).await;
    twin.get("/v1/sessions/s").await;
    twin.kill().await;
    server.kill().await;
}
