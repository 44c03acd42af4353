//! Who may stream, and who may change anything over a stream.

use firn::config::{AccessConfig, ApiKey, BackendChoice};
use firn_protocol::stream::Cause;
use reqwest::Method;
use serde_json::{Value, json};

use crate::client::{Client, refusal, request_with};
use crate::support::{Options, Server, small};

const KEY: &str = "a-key-that-nobody-can-guess";

/// A guarded server with a session; returns its path and what its creation answered.
async fn guarded() -> (Server, String, Value) {
    let access = AccessConfig { api_key: Some(ApiKey::from(KEY)), ..AccessConfig::default() };
    let options = Options { access, ..Options::default() };
    let server = Server::start_with(BackendChoice::Cpu, options).await;
    let created = server.send_as(KEY, Method::POST, "/v1/sessions", &small()).await.expect(201);
    let session = format!("/v1/sessions/{}", created["id"].as_str().unwrap());
    (server, session, created)
}

fn bearer(token: &Value) -> String {
    format!("Bearer {}", token.as_str().unwrap())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_viewer_streams_and_changes_nothing() {
    let (server, session, created) = guarded().await;
    let snowfall = json!({"op": "snowfall", "id": 7, "depth": 0.1});
    for (token, may_change) in [("viewer_token", false), ("token", true)] {
        // As a header, and as browsers have to.
        let header = bearer(&created[token]);
        let by_header = request_with(&server, &session, &[("authorization", &header)]);
        let path = format!("{session}?token={}", created[token].as_str().unwrap());
        for request in [by_header, request_with(&server, &path, &[])] {
            let mut client = Client::begin(request).await;
            assert_eq!(client.next().await["op"], "welcome");
            client.send(json!({"op": "subscribe", "id": 1})).await;
            client.heights_of(1).await;
            client.send(snowfall.clone()).await;
            let answer = client.answer().await;
            assert_eq!(answer["id"], 7);
            if may_change {
                assert_eq!(answer["op"], "ack");
            } else {
                assert_eq!(
                    (&answer["op"], &answer["problem"]["status"]),
                    (&json!("error"), &json!(403))
                );
            }
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stranger_gets_no_stream() {
    let (server, session, _) = guarded().await;
    let unknown = "/v1/sessions/nobody".to_owned();
    for path in [session.clone(), format!("{session}?token=wrong"), unknown.clone()] {
        let (status, problem) = refusal(request_with(&server, &path, &[])).await;
        assert_eq!((status, &problem["status"]), (401, &json!(401)), "{path}");
    }
    let key = format!("Bearer {KEY}");
    let (status, _) = refusal(request_with(&server, &unknown, &[("authorization", &key)])).await;
    assert_eq!(status, 404);
    server.stop().await;
}

/// A browser sees no status of a refused upgrade, only how an open stream is closed.
#[tokio::test(flavor = "multi_thread")]
async fn a_browser_is_told_by_a_close_code() {
    let (server, session, _) = guarded().await;
    let origin = [("origin", server.url.as_str())];
    let mut stranger = Client::begin(request_with(&server, &session, &origin)).await;
    assert_eq!(stranger.close_code().await, 3500);
    let path = format!("/v1/sessions/nobody?token={KEY}");
    let mut lost = Client::begin(request_with(&server, &path, &origin)).await;
    assert_eq!(lost.close_code().await, 3501);
    assert_eq!(server.app.metrics.streams.ended(Cause::BadToken), 1);
    assert_eq!(server.app.metrics.streams.ended(Cause::UnknownSession), 1);
    // A page of somebody else is told nothing at all.
    let foreign = request_with(&server, &session, &[("origin", "https://evil.example")]);
    assert_eq!(refusal(foreign).await.0, 403);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn new_tokens_end_the_streams_of_the_old_ones() {
    let (server, session, created) = guarded().await;
    let mut clients = Vec::new();
    for header in [bearer(&created["token"]), bearer(&created["viewer_token"])] {
        let request = request_with(&server, &session, &[("authorization", &header)]);
        clients.push(Client::begin(request).await);
    }
    let key = format!("Bearer {KEY}");
    let operator = request_with(&server, &session, &[("authorization", &key)]);
    let mut operator = Client::begin(operator).await;
    assert_eq!(operator.next().await["op"], "welcome");

    let old = created["token"].as_str().unwrap();
    let path = format!("{session}/tokens");
    let new = server.send_as(old, Method::POST, &path, &Value::Null).await.expect(200);
    for client in &mut clients {
        assert_eq!(client.close_code().await, 3500);
    }
    // Who has the key stays, and the new token opens a stream.
    operator.send(json!({"op": "ping", "id": 1})).await;
    assert_eq!(operator.answer().await["op"], "pong");
    let header = bearer(&new["viewer_token"]);
    let request = request_with(&server, &session, &[("authorization", &header)]);
    assert_eq!(Client::begin(request).await.next().await["op"], "welcome");
    server.stop().await;
}
