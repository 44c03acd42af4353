//! `Idempotency-Key`: what is sent again happens once.

use std::sync::Arc;

use firn::config::BackendChoice;
use reqwest::Method;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::{Reply, Server, small};

on_each_backend!(repeats_get_the_first_answer_and_change_nothing);

async fn post(server: &Server, path: &str, key: &str, body: &Value) -> Reply {
    let headers = [("content-type", "application/json"), ("idempotency-key", key)];
    server.send(Method::POST, path, &headers, body.to_string().into_bytes()).await
}

/// Everything of an answer but the time it was sent at and the mark of a repeat.
fn told(reply: &Reply) -> (u16, Vec<(String, String)>, Vec<u8>) {
    let mut headers: Vec<_> = reply
        .headers
        .iter()
        .filter(|(name, _)| !["date", "idempotent-replayed"].contains(&name.as_str()))
        .map(|(name, value)| (name.to_string(), value.to_str().unwrap().to_owned()))
        .collect();
    headers.sort();
    (reply.status, headers, reply.body.clone())
}

async fn repeats_get_the_first_answer_and_change_nothing(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let made = post(&server, "/v1/sessions", "a session", &small()).await;
    let path = format!("/v1/sessions/{}", made.expect(201)["id"].as_str().unwrap());
    let collider = json!({"mass": 80, "shape": {"type": "disk", "radius": 0.3},
                          "position": {"x": 1, "z": 0.7}});
    let mut named = collider.clone();
    named["id"] = json!("named");
    let calls = [
        ("/v1/sessions".to_owned(), small(), 201),
        (format!("{path}/snowfalls"), json!({"depth": 0.1}), 200),
        (format!("{path}/clearings"), json!({"depth": 0.8}), 200),
        (format!("{path}/colliders"), collider, 201),
        (format!("{path}/colliders:batch"), json!({"put": [named]}), 200),
    ];
    for (number, (url, body, status)) in calls.iter().enumerate() {
        let key = format!("key {number}");
        let first = post(&server, url, &key, body).await;
        assert_eq!(first.status, *status, "{url}");
        assert_eq!(first.header("idempotent-replayed"), "");
        let before = state(&server, &path).await;
        for _ in 0..3 {
            let again = post(&server, url, &key, body).await;
            assert_eq!(told(&again), told(&first), "{url}");
            assert_eq!(again.header("idempotent-replayed"), "true");
        }
        assert_eq!(state(&server, &path).await, before, "{url}");
        // Another key, another request.
        let other = post(&server, url, &format!("other {number}"), body).await;
        assert_eq!(other.header("idempotent-replayed"), "");
        // The same key, another request: refused, whatever it says.
        let before = state(&server, &path).await;
        let reply = post(&server, url, &key, &json!({"depth": 0.5})).await;
        assert_eq!(reply.pointers(422), ["Idempotency-Key"], "{url}");
        assert_eq!(state(&server, &path).await, before, "{url}");
    }
    // What was refused is refused again, and leaves its key free.
    let url = format!("{path}/snowfalls");
    for _ in 0..2 {
        let refused = post(&server, &url, "refused", &json!({"depth": -1})).await;
        assert_eq!(refused.pointers(422), ["/depth"]);
        assert_eq!(refused.header("idempotent-replayed"), "");
    }
    for replayed in ["", "true"] {
        let made = post(&server, &url, "refused", &json!({"depth": 0.1})).await;
        assert_eq!((made.status, made.header("idempotent-replayed")), (200, replayed));
    }
    server.stop().await;
}

async fn state(server: &Server, path: &str) -> Vec<Value> {
    let mut state = Vec::new();
    for part in ["/mass", "/colliders", "/digest"] {
        state.push(server.get(&format!("{path}{part}")).await.expect(200));
    }
    state.push(json!(server.sessions.count()));
    state
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_of_one_key_at_once_are_carried_out_once() {
    let server = Arc::new(Server::start(BackendChoice::Cpu).await);
    let path = server.create(small()).await;
    let mut senders = tokio::task::JoinSet::new();
    for _ in 0..20 {
        let (server, url) = (server.clone(), format!("{path}/snowfalls"));
        senders.spawn(async move {
            let reply = post(&server, &url, "one", &json!({"depth": 0.1})).await;
            (told(&reply), reply.header("idempotent-replayed").to_owned())
        });
    }
    let replies = senders.join_all().await;
    assert!(replies.iter().all(|(told, _)| told == &replies[0].0 && told.0 == 200), "{replies:?}");
    let firsts = replies.iter().filter(|(_, replayed)| replayed.is_empty()).count();
    assert_eq!(firsts, 1, "{replies:?}");
    let fallen = server.get(&format!("{path}/mass")).await.expect(200)["fallen"].clone();
    // 1 m of initial snow and 0.1 m, of 20 kg/m³ on 2 m × 1.4 m.
    assert!((fallen.as_f64().unwrap() - 1.1 * 20.0 * 2.8).abs() < 0.1, "{fallen}");
    Arc::into_inner(server).expect("all have answered").stop().await;
}

/// A client that goes away before it is answered finds the answer when it asks again.
#[tokio::test(flavor = "multi_thread")]
async fn what_a_client_did_not_wait_for_is_done_once() {
    use tokio::io::AsyncWriteExt;
    let server = Server::start(BackendChoice::Cpu).await;
    let path = server.create(small()).await;
    let url = format!("{path}/snowfalls");
    let body = json!({"depth": 0.1}).to_string();
    for number in 0..20 {
        let head = format!(
            "POST {url} HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\n\
             idempotency-key: {number}\r\ncontent-length: {}\r\n\r\n{body}",
            body.len()
        );
        let address = server.url.strip_prefix("http://").unwrap();
        let mut stream = tokio::net::TcpStream::connect(address).await.unwrap();
        stream.write_all(head.as_bytes()).await.unwrap();
        drop(stream);
        post(&server, &url, &number.to_string(), &json!({"depth": 0.1})).await.expect(200);
    }
    let fallen = server.get(&format!("{path}/mass")).await.expect(200)["fallen"].clone();
    assert!((fallen.as_f64().unwrap() - 3.0 * 20.0 * 2.8).abs() < 0.2, "{fallen}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_belongs_to_its_session_and_its_call() {
    let server = Server::start(BackendChoice::Cpu).await;
    let mut spec = small();
    spec["id"] = json!("a");
    let path = server.create(spec.clone()).await;
    let other = server.create(small()).await;
    for session in [&path, &other] {
        for (call, body) in
            [("snowfalls", json!({"depth": 0.1})), ("clearings", json!({"depth": 0.5}))]
        {
            let reply = post(&server, &format!("{session}/{call}"), "1", &body).await;
            assert_eq!((reply.status, reply.header("idempotent-replayed")), (200, ""));
        }
    }
    // A new session of an old name knows nothing of the old one's requests.
    server.delete(&path).await.expect(204);
    server.create(spec).await;
    let url = format!("{path}/snowfalls");
    let reply = post(&server, &url, "1", &json!({"depth": 0.3})).await;
    assert_eq!((reply.status, reply.header("idempotent-replayed")), (200, ""));
    let long = "k".repeat(256);
    for wrong in ["", &long] {
        let reply = post(&server, &url, wrong, &json!({"depth": 0.1})).await;
        assert_eq!(reply.pointers(422), ["Idempotency-Key"]);
    }
    // Calls that take no key don't mind one.
    let reset = format!("{path}/reset");
    for _ in 0..2 {
        let reply = post(&server, &reset, "1", &json!({})).await;
        assert_eq!((reply.status, reply.header("idempotent-replayed")), (200, ""));
    }
    server.stop().await;
}

/// A session is told in few words, whatever it lies on, so that its answer is kept.
#[tokio::test(flavor = "multi_thread")]
async fn the_answer_about_a_large_terrain_is_repeated_too() {
    let server = Server::start(BackendChoice::Cpu).await;
    let mut spec = small();
    spec["grid"] = json!({"width": 128, "depth": 128, "height": 20, "cell_size": 0.2});
    spec["terrain"] = json!({"heights": vec![0.125; 128 * 128]});
    let first = post(&server, "/v1/sessions", "long", &spec).await;
    let made = first.expect(201);
    assert!(first.body.len() < 4096, "{} bytes", first.body.len());
    assert_eq!(first.header("idempotent-replayed"), "");
    for _ in 0..2 {
        let again = post(&server, "/v1/sessions", "long", &spec).await;
        assert_eq!((&again.expect(201), again.header("idempotent-replayed")), (&made, "true"));
    }
    assert_eq!(server.sessions.count(), 1);
    let other = post(&server, "/v1/sessions", "long", &small()).await;
    assert_eq!(other.pointers(422), ["Idempotency-Key"]);
    server.stop().await;
}
