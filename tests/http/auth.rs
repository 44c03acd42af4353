//! Who may do what, over HTTP.

use firn::config::{AccessConfig, ApiKey, BackendChoice};
use reqwest::Method;
use serde_json::{Value, json};

use crate::support::{Options, Server, small};

const KEY: &str = "a-key-that-nobody-can-guess";

async fn guarded() -> Server {
    let access = AccessConfig {
        api_key: Some(ApiKey::from(KEY)),
        // Strangers come by the hundred here.
        auth_failures_per_minute: 1_000_000.try_into().unwrap(),
        ..AccessConfig::default()
    };
    Server::start_with(BackendChoice::Cpu, Options { access, ..Options::default() }).await
}

/// Creates a session; returns its path, its token and its viewer's token.
async fn create(server: &Server) -> (String, String, String) {
    let created = server.send_as(KEY, Method::POST, "/v1/sessions", &small()).await;
    assert_eq!(created.header("cache-control"), "no-store");
    let created = created.expect(201);
    let text = |field: &str| created[field].as_str().expect("a string").to_owned();
    (format!("/v1/sessions/{}", text("id")), text("token"), text("viewer_token"))
}

#[tokio::test(flavor = "multi_thread")]
async fn an_open_server_asks_nobody() {
    let server = Server::start(BackendChoice::Cpu).await;
    assert_eq!(server.get("/readyz").await.expect(200)["auth"], "open");
    let path = server.create(small()).await;
    let snowfall = json!({"depth": 0.1});
    let path = format!("{path}/snowfalls");
    let sent = server.send_as("nonsense", Method::POST, &path, &snowfall);
    sent.await.expect(200);
    server.stop().await;
}

/// Whatever the document lists under `/v1/` is closed to strangers, and says nothing of what is
/// there.
#[tokio::test(flavor = "multi_thread")]
async fn every_call_of_a_guarded_server_takes_a_token() {
    let server = guarded().await;
    let (path, ..) = create(&server).await;
    let (_, other_token, _) = create(&server).await;
    let document = server.get("/openapi.json").await.expect(200);
    let mut calls = 0;
    for (template, item) in document["paths"].as_object().unwrap() {
        for method in item.as_object().unwrap().keys() {
            let method: Method = method.to_uppercase().parse().unwrap();
            for session in [path.as_str(), "/v1/sessions/nobody"] {
                let url = template.replace("/v1/sessions/{id}", session);
                let url = url.replace("{cid}", "c").replace("{column_x}/{column_z}", "0/0");
                let plain = server.send(method.clone(), &url, &[], Vec::new()).await;
                if !template.starts_with("/v1/") {
                    assert_eq!(plain.status, 200, "{url}");
                    continue;
                }
                plain.problem(401);
                assert_eq!(plain.header("www-authenticate"), "Bearer realm=\"firn\"");
                for token in ["nonsense", &KEY[1..], &other_token] {
                    let reply = server.send_as(token, method.clone(), &url, &Value::Null).await;
                    reply.problem(401);
                }
                calls += 1;
            }
        }
    }
    assert!(calls > 40, "{calls}");
    server.get("/no/such/page").await.problem(404);
    assert_eq!(server.get("/readyz").await.expect(200)["auth"], "required");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn each_token_allows_what_it_is_for() {
    let server = guarded().await;
    let (path, token, viewer) = create(&server).await;
    let url = |part: &str| format!("{path}{part}");
    let collider = json!({"id": "c", "mass": 1, "shape": {"type": "disk", "radius": 0.3},
                          "position": {"x": 1, "z": 0.7}});
    let probes = json!({"probes": [{"x": 1, "z": 0.7, "mass": 80, "area": 0.1}]});
    let reads = [
        (Method::GET, url(""), Value::Null),
        (Method::HEAD, url("/heights"), Value::Null),
        (Method::GET, url("/snapshot"), Value::Null),
        (Method::GET, url("/colliders"), Value::Null),
        (Method::GET, url("/checkpoints"), Value::Null),
        (Method::POST, url("/probes"), probes),
        (Method::POST, url("/samples"), json!({"points": [[1, 0.7]]})),
    ];
    let changes = [
        (Method::POST, url("/snowfalls"), json!({"depth": 0.1})),
        (Method::POST, url("/colliders"), collider.clone()),
        (Method::PUT, url("/air-temperature"), json!({"celsius": -5})),
        (Method::PATCH, url("/colliders/c"), json!({"mass": 2})),
        (Method::DELETE, url("/colliders/c"), Value::Null),
        (Method::PATCH, url(""), json!({"time_scale": 2})),
        (Method::POST, url("/step"), json!({"ticks": 1})),
        (Method::DELETE, url("/step"), Value::Null),
        (Method::PUT, url("/checkpoints/p"), Value::Null),
        (Method::POST, url("/reset"), json!({"checkpoint": "p"})),
        (Method::DELETE, url("/checkpoints/p"), Value::Null),
        (Method::POST, url("/reset"), json!({})),
    ];
    for (method, url, body) in &reads {
        for token in [KEY, &token, &viewer] {
            let reply = server.send_as(token, method.clone(), url, body).await;
            assert_eq!(reply.status, 200, "{method} {url}");
        }
    }
    for (method, url, body) in &changes {
        server.send_as(&viewer, method.clone(), url, body).await.problem(403);
        for token in [KEY, &token] {
            let reply = server.send_as(token, method.clone(), url, body).await;
            // The second creation or removal of the collider finds it there, or gone.
            assert!(matches!(reply.status, 200 | 201 | 204 | 404 | 409), "{method} {url}");
        }
    }
    for (method, path) in [(Method::GET, "/v1/sessions"), (Method::POST, "/v1/sessions")] {
        server.send_as(&token, method.clone(), path, &Value::Null).await.problem(401);
        let reply = server.send_as(KEY, method, path, &Value::Null).await;
        assert!(reply.status < 300, "{}", reply.status);
    }
    // The owner of a session may end it; whoever has the key learns that it is gone.
    server.send_as(&viewer, Method::DELETE, &path, &Value::Null).await.problem(403);
    server.send_as(&token, Method::DELETE, &path, &Value::Null).await.expect(204);
    server.send_as(&token, Method::GET, &path, &Value::Null).await.problem(401);
    server.send_as(KEY, Method::GET, &path, &Value::Null).await.problem(404);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn new_tokens_take_the_place_of_old_ones() {
    let server = guarded().await;
    let (path, token, viewer) = create(&server).await;
    let tokens = format!("{path}/tokens");
    server.send_as(&viewer, Method::POST, &tokens, &Value::Null).await.problem(403);
    let reply = server.send_as(&token, Method::POST, &tokens, &Value::Null).await;
    assert_eq!(reply.header("cache-control"), "no-store");
    let new = reply.expect(200);
    for old in [&token, &viewer] {
        server.send_as(old, Method::GET, &path, &Value::Null).await.problem(401);
    }
    for field in ["token", "viewer_token"] {
        let token = new[field].as_str().unwrap();
        server.send_as(token, Method::GET, &path, &Value::Null).await.expect(200);
    }
    server.stop().await;
}
