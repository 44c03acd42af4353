//! Restore points, resets to them and to snapshots, and steps that were ended outlive the server.

use firn::config::BackendChoice;
use reqwest::{Client, Method};
use serde_json::{Value, json};

use crate::backup::{CPU, restored};
use crate::on_each_backend;
use crate::process::Process;
use crate::script::{history, session};
use crate::support::wait::until;

on_each_backend!(what_is_kept_outlives_a_kill, an_ended_step_comes_back_where_it_ended,);

const SNAPSHOT: &str = "application/vnd.firn.snapshot";
const PATH: &str = "/v1/sessions/s";

fn options(backend: BackendChoice, interval: &str) -> [&str; 4] {
    let backend = if backend == BackendChoice::Cpu { "cpu" } else { "gpu" };
    ["--backend", backend, "--checkpoint-interval", interval]
}

async fn call(server: &Process, method: Method, below: &str, body: Value) -> Value {
    let path = format!("{PATH}{below}");
    let (status, answer) = server.send(method, &path, Some(&body)).await.expect("it answers");
    assert!((200..300).contains(&status), "{path}: {status} {answer}");
    answer
}

async fn go_on(server: &Process, seed: u64) {
    for (method, below, body) in history(seed, 6) {
        call(server, method, &below, body).await;
    }
}

async fn digest(server: &Process) -> Value {
    server.get(&format!("{PATH}/digest")).await["digest"].clone()
}

async fn bytes(server: &Process, below: &str) -> Vec<u8> {
    let request = Client::new().get(format!("{}{PATH}{below}", server.url));
    let answer = request.header("accept", SNAPSHOT).send().await.expect("it answers");
    assert_eq!(answer.status(), 200, "{below}");
    answer.bytes().await.expect("it is whole").to_vec()
}

/// Kills the server after each reset, with changes before and after it.
async fn what_is_kept_outlives_a_kill(backend: BackendChoice) {
    for interval in ["50ms", "1h"] {
        let data = tempfile::tempdir().unwrap();
        let options = options(backend, interval);
        let mut server = Process::ready(data.path(), &options).await;
        let created = server.post("/v1/sessions", session("s")).await;
        go_on(&server, 1).await;
        let (first, snapshot) = (digest(&server).await, bytes(&server, "/snapshot").await);
        let kept = call(&server, Method::PUT, "/checkpoints/a", json!(null)).await;
        go_on(&server, 2).await;
        call(&server, Method::PUT, "/checkpoints/b", json!(null)).await;
        server.kill().await;
        server = Process::ready(data.path(), &options).await;
        let points = server.get(&format!("{PATH}/checkpoints")).await["items"].clone();
        assert_eq!((points.as_array().unwrap().len(), &points[0]), (2, &kept));
        assert_eq!(bytes(&server, "/checkpoints/a").await, snapshot);

        // It is replaced and deleted after the session went back to it.
        go_on(&server, 3).await;
        call(&server, Method::POST, "/reset", json!({"checkpoint": "a"})).await;
        go_on(&server, 4).await;
        let later = digest(&server).await;
        call(&server, Method::PUT, "/checkpoints/a", json!(null)).await;
        call(&server, Method::DELETE, "/checkpoints/a", json!(null)).await;
        server.kill().await;
        server = Process::ready(data.path(), &options).await;
        assert_eq!(digest(&server).await, later, "checkpoints every {interval}");

        let reset = Client::new().post(format!("{}{PATH}/reset", server.url));
        let reset = reset.header("content-type", SNAPSHOT).body(snapshot);
        assert_eq!(reset.send().await.unwrap().status(), 200);
        server.kill().await;
        server = Process::ready(data.path(), &options).await;
        assert_eq!(digest(&server).await, first);
        let back = server.get(PATH).await;
        for field in ["id", "created_at"] {
            assert_eq!(back[field], created[field]);
        }
        go_on(&server, 4).await;
        assert_eq!(digest(&server).await, later, "it goes on as it did before");
        server.kill().await;
    }
}

async fn an_ended_step_comes_back_where_it_ended(backend: BackendChoice) {
    let data = tempfile::tempdir().unwrap();
    let options = options(backend, "1h");
    let server = Process::ready(data.path(), &options).await;
    let mut slow = session("s");
    (slow["snowfall_rate"], slow["time_scale"]) = (json!(100), json!(10));
    server.post("/v1/sessions", slow).await;
    let ended = async {
        until("the step has come some way", async || {
            server.get(PATH).await["progress"]["done"].as_u64().is_some_and(|done| done > 3)
        })
        .await;
        call(&server, Method::DELETE, "/step", json!(null)).await;
    };
    let step = call(&server, Method::POST, "/step", json!({"ticks": 1_000_000}));
    let (stepped, ()) = tokio::join!(step, ended);
    let before = digest(&server).await;
    server.kill().await;
    let server = Process::ready(data.path(), &options).await;
    let back = server.get(PATH).await;
    assert_eq!((&back["tick"], &back["state"]), (&stepped["tick"], &json!("paused")));
    assert_eq!(digest(&server).await, before);

    // A kill in the middle of a step loses it, and nothing else.
    let url = format!("{}{PATH}/step", server.url);
    let step = json!({"ticks": 1_000_000});
    let step = tokio::spawn(Client::new().post(url).json(&step).send());
    until("it is stepped again", async || server.get(PATH).await["state"] == "stepping").await;
    server.kill().await;
    assert!(step.await.unwrap().is_err());
    let server = Process::ready(data.path(), &options).await;
    assert_eq!(server.get(PATH).await["state"], "paused");
    assert_eq!(digest(&server).await, before);
    server.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_holds_restore_points_and_an_emptied_store_does_not() {
    let data = tempfile::tempdir().unwrap();
    let server = Process::ready(data.path(), &CPU).await;
    server.post("/v1/sessions", session("s")).await;
    call(&server, Method::PUT, "/checkpoints/a", json!(null)).await;
    let kept = bytes(&server, "/checkpoints/a").await;
    let rows = async |server: &Process| {
        let verified = server.post("/v1/store/verify", json!({})).await;
        assert_eq!(verified["sound"], true, "{verified}");
        verified["rows"].as_u64().unwrap()
    };
    let before = rows(&server).await;
    let copy = restored(&server).await;
    let twin = Process::ready(copy.path(), &CPU).await;
    assert_eq!(bytes(&twin, "/checkpoints/a").await, kept);
    twin.kill().await;

    // A replaced one leaves nothing, nor does a deleted one but the list of them.
    call(&server, Method::PUT, "/checkpoints/a", json!(null)).await;
    until("the old one is gone", async || rows(&server).await == before).await;
    call(&server, Method::DELETE, "/checkpoints/a", json!(null)).await;
    until("so is the new one", async || rows(&server).await == before - 1).await;
    server.kill().await;
}
