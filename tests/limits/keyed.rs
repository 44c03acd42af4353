//! Answers that are kept for requests with an `Idempotency-Key`.

use firn::config::BackendChoice;
use reqwest::Method;
use serde_json::{Value, json};

use crate::raw::metric;
use crate::support::{Reply, Server, small};

async fn post(server: &Server, path: &str, key: Option<String>, body: &Value) -> Reply {
    let mut headers = vec![("content-type", "application/json")];
    headers.extend(key.as_deref().map(|key| ("idempotency-key", key)));
    server.send(Method::POST, path, &headers, body.to_string().into_bytes()).await
}

#[tokio::test(flavor = "multi_thread")]
async fn refusals_are_short_and_not_kept() {
    let server = Server::start(BackendChoice::Cpu).await;
    let (path, other) = (server.create(small()).await, server.create(small()).await);
    let name = "n".repeat(64);
    let stone = json!({"id": name, "mass": 1, "shape": {"type": "disk", "radius": 0.1},
        "position": {"x": 1, "z": 1}});
    let batch = json!({"put": vec![stone; 4001]});
    for number in 0..130 {
        let url = format!("{path}/colliders:batch");
        let refused = post(&server, &url, Some(number.to_string()), &batch).await;
        let problem = refused.problem(422);
        assert!(refused.body.len() < 40_000, "{} bytes", refused.body.len());
        let errors = problem["errors"].as_array().unwrap();
        assert_eq!((errors.len(), errors[0]["pointer"].as_str()), (100, Some("/put/1/id")));
        let detail = errors[0]["detail"].as_str().unwrap();
        assert!(detail.contains(&format!("'{name}'")), "{detail}");
        assert!(problem["detail"].as_str().unwrap().starts_with("4000 parts"), "{problem}");
    }
    assert_eq!(metric(&server, "firn_kept_answers_bytes").await, 0);
    let snow = json!({"depth": 0.1});
    post(&server, &format!("{other}/snowfalls"), Some("1".into()), &snow).await.expect(200);
    server.stop().await;
}

/// However a name, a value or a path is wrong, no more than a part of it comes back.
#[tokio::test(flavor = "multi_thread")]
async fn what_was_sent_is_repeated_in_part() {
    let server = Server::start(BackendChoice::Cpu).await;
    let path = server.create(small()).await;
    let long = "x".repeat(9000);
    let named = |name: &str| format!("{path}/{name}/{long}");
    for (method, url, body) in [
        (Method::GET, format!("/v1/sessions/{long}"), Value::Null),
        (Method::GET, format!("/nothing/{long}"), Value::Null),
        (Method::GET, format!("/assets/{long}"), Value::Null),
        (Method::GET, format!("/docs/{long}"), Value::Null),
        (Method::GET, named("colliders"), Value::Null),
        (Method::GET, named("columns/0"), Value::Null),
        (Method::GET, format!("{path}/cells?fields={long}"), Value::Null),
        (Method::GET, format!("{path}/heights?stride={long}"), Value::Null),
        (Method::GET, format!("{path}/heights?{long}=1"), Value::Null),
        (Method::GET, format!("{path}/render.png?view={long}"), Value::Null),
        (Method::POST, format!("{path}/snowfalls"), json!({"depth": long})),
        (Method::POST, format!("{path}/snowfalls"), json!({&long: 1})),
        (Method::POST, "/v1/sessions".to_owned(), json!({"id": long})),
        (
            Method::PUT,
            named("colliders"),
            json!({"id": long, "mass": 1,
            "shape": {"type": "disk", "radius": 1}, "position": {"x": 1, "z": 1}}),
        ),
    ] {
        let headers = [("content-type", "application/json")];
        let body = if body.is_null() { Vec::new() } else { body.to_string().into_bytes() };
        let reply = server.send(method, &url, &headers, body).await;
        assert!((400..500).contains(&reply.status), "{url}: {}", reply.status);
        assert!(reply.body.len() < 1500, "{url}: {} bytes", reply.body.len());
    }
    server.stop().await;
}
