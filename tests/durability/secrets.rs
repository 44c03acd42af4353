//! Tokens and keys of requests outlive the server; secrets are nowhere on its disk.

use std::path::Path;

use firn::config::BackendChoice;
use reqwest::header::HeaderMap;
use reqwest::{Client, Method};
use serde_json::{Value, json};

use crate::disk::{Disk, Failing};
use crate::process::Process;
use crate::support::{Options, Server, small};

const KEY: &str = "a-key-of-thirty-two-characters--";
const OPTIONS: [&str; 4] = ["--backend", "cpu", "--api-key", KEY];

struct Answer {
    status: u16,
    headers: HeaderMap,
    body: Value,
}

async fn send(
    server: &Process,
    method: Method,
    path: &str,
    headers: &[(&str, &str)],
    body: &Value,
) -> Answer {
    let mut request = Client::new().request(method, format!("{}{path}", server.url));
    for (name, value) in headers {
        request = request.header(*name, *value);
    }
    if !body.is_null() {
        request = request.json(body);
    }
    let response = request.send().await.expect("it answers");
    let (status, headers) = (response.status().as_u16(), response.headers().clone());
    let body = response.bytes().await.unwrap();
    Answer { status, headers, body: serde_json::from_slice(&body).unwrap_or_default() }
}

/// Sends a request with the API key and a key of its own.
async fn once(server: &Process, key: &str, path: &str, body: &Value) -> Answer {
    let bearer = format!("Bearer {KEY}");
    let headers = [("authorization", &*bearer), ("idempotency-key", key)];
    send(server, Method::POST, path, &headers, body).await
}

async fn status(server: &Process, token: &str, path: &str) -> u16 {
    let bearer = format!("Bearer {token}");
    let headers = [("authorization", &*bearer)];
    send(server, Method::GET, path, &headers, &Value::Null).await.status
}

fn text<'a>(body: &'a Value, name: &str) -> &'a str {
    body[name].as_str().unwrap_or_else(|| panic!("no {name} in {body}"))
}

/// Whether a text is anywhere in the files of a directory.
fn is_on_disk(directory: &Path, secret: &str) -> bool {
    std::fs::read_dir(directory).unwrap().any(|file| {
        let bytes = std::fs::read(file.unwrap().path()).unwrap();
        bytes.windows(secret.len()).any(|window| window == secret.as_bytes())
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_that_is_sent_again_after_a_kill_changes_nothing() {
    let data = tempfile::tempdir().unwrap();
    let server = Process::ready(data.path(), &OPTIONS).await;
    let made = once(&server, "make it", "/v1/sessions", &small()).await;
    assert_eq!(made.status, 201, "{}", made.body);
    let path = format!("/v1/sessions/{}", text(&made.body, "id"));
    let disk = json!({"mass": 50, "shape": {"type": "disk", "radius": 0.3},
                      "position": {"x": 1, "z": 0.7}});
    let requests = [
        ("fall", format!("{path}/snowfalls"), json!({"depth": 0.1}), 200),
        ("clear", format!("{path}/clearings"), json!({"depth": 0.9}), 200),
        ("put", format!("{path}/colliders"), disk, 201),
        ("batch", format!("{path}/colliders:batch"), json!({"delete": []}), 200),
    ];
    let mut first = Vec::new();
    for (key, path, body, status) in &requests {
        let answer = once(&server, key, path, body).await;
        assert_eq!(answer.status, *status, "{key}: {}", answer.body);
        first.push(answer);
    }
    server.kill().await;
    let server = Process::ready(data.path(), &OPTIONS).await;
    let bearer = format!("Bearer {KEY}");
    let read = async |server: &Process, at: &str| {
        let headers = [("authorization", &*bearer)];
        let at = format!("{path}{at}");
        send(server, Method::GET, &at, &headers, &Value::Null).await.body
    };
    let before = (read(&server, "/mass").await, read(&server, "/colliders").await);
    for _ in 0..2 {
        for ((key, path, body, status), first) in requests.iter().zip(&first) {
            let again = once(&server, key, path, body).await;
            assert_eq!((again.status, &again.body), (*status, &first.body), "{key}");
            assert_eq!(again.headers.get("location"), first.headers.get("location"));
            assert_eq!(again.headers["idempotent-replayed"], "true", "{key}");
        }
    }
    let other = once(&server, "fall", &requests[0].1, &json!({"depth": 0.2})).await;
    assert_eq!(other.status, 422, "{}", other.body);
    let mut after = (read(&server, "/mass").await, read(&server, "/colliders").await);
    after.0["seq"] = before.0["seq"].clone();
    after.1["seq"] = before.1["seq"].clone();
    assert_eq!(after, before);

    let again = once(&server, "make it", "/v1/sessions", &small()).await;
    assert_eq!(again.status, 201, "{}", again.body);
    for same in ["id", "created_at", "token", "viewer_token"] {
        assert_eq!(again.body[same], made.body[same], "{same}");
    }
    for name in ["token", "viewer_token"] {
        let token = text(&made.body, name);
        assert_eq!(status(&server, token, &path).await, 200);
        assert!(!is_on_disk(data.path(), token), "the {name} can be read on the disk");
    }
    server.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tokens_that_were_given_out_anew_are_so_after_a_kill() {
    let data = tempfile::tempdir().unwrap();
    let server = Process::ready(data.path(), &OPTIONS).await;
    let made = once(&server, "make it", "/v1/sessions", &small()).await.body;
    let path = format!("/v1/sessions/{}", text(&made, "id"));
    let bearer = format!("Bearer {}", text(&made, "token"));
    let headers = [("authorization", &*bearer)];
    let anew = send(&server, Method::POST, &format!("{path}/tokens"), &headers, &Value::Null).await;
    assert_eq!(anew.status, 200, "{}", anew.body);
    server.kill().await;

    let server = Process::start(data.path(), &OPTIONS).await;
    // Who asks too early is told to wait, never that there is no such session or token.
    let mut seen = Vec::new();
    while seen.last() != Some(&200) {
        seen.push(status(&server, text(&anew.body, "token"), &path).await);
        assert!([200, 503].contains(seen.last().unwrap()), "{seen:?}");
    }
    assert_eq!(status(&server, text(&anew.body, "viewer_token"), &path).await, 200);
    for old in ["token", "viewer_token"] {
        assert_eq!(status(&server, text(&made, old), &path).await, 401);
    }
    assert!(!is_on_disk(data.path(), text(&anew.body, "token")));
    server.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tokens_that_can_not_be_stored_are_not_given_out() {
    let disk = Disk::default();
    let durability = disk.durability(std::time::Duration::from_secs(60));
    let server = Server::start_stored(BackendChoice::Cpu, Options::default(), durability).await;
    let path = server.create(small()).await;
    let id = path.rsplit('/').next().unwrap();
    let before = server.sessions.get(id).unwrap().tokens();
    disk.fail(Some(Failing::Full));
    server.post(&format!("{path}/tokens"), Value::Null).await.problem(507);
    assert_eq!(server.sessions.get(id).unwrap().tokens(), before);
    disk.fail(None);
    server.stop().await;
}
