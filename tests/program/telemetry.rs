//! What the program says about its work: the log in its forms, and traces to a real collector.

use std::sync::{Arc, Mutex};

use axum::body::Bytes;
use axum::http::HeaderMap;
use axum::{Router, extract::State, routing};
use opentelemetry_proto::tonic::collector::trace::v1::ExportTraceServiceRequest;
use opentelemetry_proto::tonic::common::v1::{KeyValue, any_value::Value};
use opentelemetry_proto::tonic::trace::v1::{Span, status::StatusCode};
use prost::Message;
use serde_json::json;
use tokio::net::TcpListener;

use crate::running::{Running, serve};

const KEY: &str = "a-key-that-nobody-can-guess";

/// A request that succeeds, with a log as some options and variables want it; returns the log.
fn log(options: &[&str], variables: &[(&str, &str)]) -> String {
    let mut command = serve(&["--listen", "127.0.0.1:0"]);
    command.args(options).env_remove("RUST_LOG").env_remove("FIRN_LOG");
    command.envs(variables.iter().copied());
    let server = Running::start(command);
    let url = format!("{}/livez", server.url);
    let runtime = tokio::runtime::Runtime::new().expect("threads");
    runtime.block_on(reqwest::get(url)).expect("it answers");
    let (code, log) = server.stop();
    assert_eq!(code, Some(0), "{log}");
    log
}

#[test]
fn a_flag_a_variable_and_rust_log_say_what_is_logged() {
    let told = |log: &str| log.contains("/livez");
    assert!(!told(&log(&[], &[])));
    assert!(told(&log(&[], &[("RUST_LOG", "info,firn=debug")])));
    assert!(told(&log(&[], &[("FIRN_LOG", "info,firn=debug"), ("RUST_LOG", "info")])));
    assert!(!told(&log(&["--log", "info"], &[("FIRN_LOG", "debug"), ("RUST_LOG", "debug")])));
}

#[test]
fn a_log_for_machines_is_json() {
    let log = log(&["--log-format", "json", "--log", "info,firn=debug"], &[]);
    let lines: Vec<serde_json::Value> = log
        .lines()
        .map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}")))
        .collect();
    let listening = lines.iter().find(|line| line["auth"] == "open").expect("it says that it is");
    assert_eq!((&listening["level"], &listening["backend"]), (&json!("INFO"), &json!("cpu")));
    let answered = lines.iter().find(|line| line["status"] == 200).expect("a request is logged");
    assert_eq!(answered["span"]["http.route"], "/livez", "{answered}");
}

/// What a collector was sent, each time with its headers.
type Sent = Arc<Mutex<Vec<(HeaderMap, Bytes)>>>;

async fn take(State(sent): State<Sent>, headers: HeaderMap, body: Bytes) {
    sent.lock().expect("no panic").push((headers, body));
}

/// A collector on a free port; returns its address.
async fn collector(sent: &Sent) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port is free");
    let address = listener.local_addr().expect("it has an address");
    let router = Router::new().route("/v1/traces", routing::post(take)).with_state(sent.clone());
    tokio::spawn(axum::serve(listener, router).into_future());
    format!("http://{address}")
}

fn attribute(attributes: &[KeyValue], key: &str) -> Option<String> {
    let found = attributes.iter().find(|attribute| attribute.key == key)?;
    match found.value.as_ref()?.value.as_ref()? {
        Value::StringValue(text) => Some(text.clone()),
        Value::IntValue(number) => Some(number.to_string()),
        other => panic!("{key}: {other:?}"),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_request_is_a_span_without_its_secrets() {
    let sent = Sent::default();
    let endpoint = collector(&sent).await;
    let mut command = serve(&["--listen", "127.0.0.1:0", "--otlp-endpoint", &endpoint]);
    command.env("FIRN_API_KEY", KEY).env("OTEL_EXPORTER_OTLP_HEADERS", "tenant=snow");
    command.env_remove("OTEL_SERVICE_NAME").env_remove("OTEL_RESOURCE_ATTRIBUTES");
    let server = Running::start(command);
    let client = reqwest::Client::new();
    let sessions = format!("{}/v1/sessions", server.url);
    let body = json!({"id": "alp", "paused": true});
    let created = client.post(&sessions).bearer_auth(KEY).json(&body).send().await.unwrap();
    let created: serde_json::Value = created.json().await.unwrap();
    let token = created["token"].as_str().expect("it has a token").to_owned();
    let caller = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";
    // A token has no place there, but may come to stand there.
    let read = client.get(format!("{sessions}/alp/heights?token={token}"));
    read.bearer_auth(&token).header("traceparent", caller).send().await.unwrap();
    client.get(format!("{sessions}/alp")).send().await.unwrap();
    client.get(format!("{}/nothing", server.url)).send().await.unwrap();
    let (code, log) = tokio::task::spawn_blocking(|| server.stop()).await.unwrap();
    assert_eq!(code, Some(0), "{log}");

    let sent = std::mem::take(&mut *sent.lock().unwrap());
    assert!(!sent.is_empty(), "what was not sent yet is sent at the end: {log}");
    let mut spans = Vec::new();
    for (headers, body) in &sent {
        assert_eq!(headers["content-type"], "application/x-protobuf");
        assert_eq!(headers["tenant"], "snow");
        for secret in [KEY, &token] {
            let found = body.windows(secret.len()).any(|part| part == secret.as_bytes());
            assert!(!found, "a secret is in the traces");
        }
        for part in ExportTraceServiceRequest::decode(body.clone()).unwrap().resource_spans {
            let resource = part.resource.expect("it says whose spans these are").attributes;
            assert_eq!(attribute(&resource, "service.name").as_deref(), Some("firn"));
            spans.extend(part.scope_spans.into_iter().flat_map(|scope| scope.spans));
        }
    }
    let span = |name: &str| -> &Span {
        let found = spans.iter().find(|span| span.name == name);
        found.unwrap_or_else(|| panic!("{name} in {spans:#?}"))
    };
    for (name, status, session) in [
        ("POST /v1/sessions", "201", Some("alp")),
        ("GET /v1/sessions/{id}/heights", "422", Some("alp")),
        ("GET /v1/sessions/{id}", "401", Some("alp")),
        ("GET", "404", None),
    ] {
        let attributes = &span(name).attributes;
        let value = |key: &str| attribute(attributes, key);
        assert_eq!(value("http.response.status_code").as_deref(), Some(status), "{name}");
        assert_eq!(value("firn.session").as_deref(), session, "{name}");
        assert_eq!(value("http.request.method").as_deref(), name.split(' ').next());
    }
    let read = span("GET /v1/sessions/{id}/heights");
    assert_eq!(attribute(&read.attributes, "url.path").unwrap(), "/v1/sessions/alp/heights");
    assert_eq!(read.trace_id, 0x0af7651916cd43dd8448eb211c80319c_u128.to_be_bytes());
    assert_eq!(read.parent_span_id, 0xb7ad6b7169203331_u64.to_be_bytes());
    let error = StatusCode::Error as i32;
    assert!(spans.iter().all(|span| span.status.as_ref().is_none_or(|it| it.code != error)));
    assert_eq!(spans.len(), 4, "{spans:#?}");
}

/// Nobody has to be there to take them.
#[test]
fn a_collector_that_is_away_keeps_nothing_from_working() {
    let log = log(&["--otlp-endpoint", "http://127.0.0.1:1"], &[]);
    assert!(log.contains("http://127.0.0.1:1/v1/traces"), "{log}");
}
