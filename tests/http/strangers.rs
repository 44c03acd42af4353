//! Those who have no right token: how many are told so, and that nobody else suffers.

use std::num::NonZeroU32;

use firn::config::{AccessConfig, ApiKey, BackendChoice};
use reqwest::Method;
use serde_json::Value;

use crate::support::{Options, Server, small};

const KEY: &str = "a-key-that-nobody-can-guess";

/// The value of a counter of failures.
async fn failures(server: &Server, reason: &str) -> u64 {
    let text = String::from_utf8(server.get("/metrics").await.body).unwrap();
    let name = format!("firn_auth_failures_total{{reason=\"{reason}\"}} ");
    let value = text.lines().find_map(|line| line.strip_prefix(&name));
    value.unwrap_or_else(|| panic!("no {name}in {text}")).parse().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_tokens_are_limited_and_right_ones_work() {
    let access = AccessConfig {
        api_key: Some(ApiKey::from(KEY)),
        auth_failures_per_minute: NonZeroU32::MIN,
        ..AccessConfig::default()
    };
    let options = Options { access, ..Options::default() };
    let server = Server::start_with(BackendChoice::Cpu, options).await;
    let created = server.send_as(KEY, Method::POST, "/v1/sessions", &small()).await.expect(201);
    let path = format!("/v1/sessions/{}", created["id"].as_str().unwrap());
    let text = |name: &str| created[name].as_str().unwrap().to_owned();
    let (token, viewer) = (text("token"), text("viewer_token"));
    for reason in ["missing", "unknown", "forbidden"] {
        assert_eq!(failures(&server, reason).await, 0);
    }

    server.send_as("wrong", Method::GET, &path, &Value::Null).await.problem(401);
    for round in 0..20 {
        // Whether there is such a session makes no difference.
        for path in [&*path, "/v1/sessions/nobody", "/v1/sessions"] {
            let wrong = format!("{}{round}", &KEY[1..]);
            let refused = server.send_as(&wrong, Method::GET, path, &Value::Null).await;
            refused.problem(429);
            let wait: u32 = refused.header("retry-after").parse().expect("seconds");
            assert!((1..=60).contains(&wait), "{wait}");
        }
        for good in [KEY, &token, &viewer] {
            server.send_as(good, Method::GET, &path, &Value::Null).await.expect(200);
        }
    }
    // A page that has no token yet is told so, to ask for one.
    server.get(&path).await.problem(401);
    server.send_as(&viewer, Method::DELETE, &path, &Value::Null).await.problem(403);
    let upgrade = [("origin", &*server.url), ("connection", "upgrade"), ("upgrade", "websocket")];
    let stream = format!("{path}/stream?token=wrong");
    server.send(Method::GET, &stream, &upgrade, Vec::new()).await.problem(429);

    assert_eq!(failures(&server, "unknown").await, 1 + 3 * 20 + 1);
    assert_eq!(failures(&server, "missing").await, 1);
    assert_eq!(failures(&server, "forbidden").await, 1);
    server.stop().await;
}
