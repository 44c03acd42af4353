//! Bad input over HTTP: the documented status, a problem that names the field, nothing changed.

use std::time::Duration;

use firn::config::{BackendChoice, RequestConfig};
use reqwest::Method;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::{Options, Server, small};

on_each_backend!(
    bad_sessions_are_refused,
    bad_changes_are_refused_and_change_nothing,
    bad_bodies_are_refused,
    unknown_things_are_not_found,
);

const JSON: (&str, &str) = ("content-type", "application/json");

async fn bad_sessions_are_refused(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let cases = [
        (json!({"grid": {"width": 0}}), "/grid/width"),
        (json!({"grid": {"depth": 0}}), "/grid/depth"),
        (json!({"grid": {"width": -5}}), "/grid/width"),
        (json!({"grid": {"width": 2.5}}), "/grid/width"),
        (json!({"grid": {"width": 5_000_000_000_u64}}), "/grid/width"),
        (json!({"grid": {"height": 256}}), "/grid/height"),
        (json!({"grid": {"height": 0}}), "/grid/height"),
        (json!({"grid": {"cell_size": 0.01}}), "/grid/cell_size"),
        (json!({"grid": {"cell_size": 2.5}}), "/grid/cell_size"),
        (json!({"grid": {"cell_size": "small"}}), "/grid/cell_size"),
        (json!({"grid": {"cells": 1}}), "/grid/cells"),
        (json!({"grid": {"width": 100_000, "depth": 100_000}}), "/grid"),
        (json!({"grid": {"width": u32::MAX, "depth": u32::MAX, "height": 255}}), "/grid"),
        (json!({"grid": [50, 50, 50]}), "/grid"),
        (json!({"material": {"fresh_density": 5}}), "/material/fresh_density"),
        (json!({"material": {"fresh_density": 200}}), "/material/fresh_density"),
        (json!({"material": {"max_density": 1000}}), "/material/max_density"),
        (json!({"material": {"stiffness_exponent": 7}}), "/material/stiffness_exponent"),
        (json!({"material": {"hardness_law": "magic"}}), "/material/hardness_law"),
        (json!({"material": {"grain_size_mm": 0}}), "/material/grain_size_mm"),
        (json!({"material": {"load_distribution": 2}}), "/material/load_distribution"),
        (json!({"air_temperature": 1}), "/air_temperature"),
        (json!({"air_temperature": -41}), "/air_temperature"),
        (json!({"air_temperature": null}), "/air_temperature"),
        (json!({"time_scale": -1}), "/time_scale"),
        (json!({"time_scale": 1001}), "/time_scale"),
        (json!({"tick_rate": 0}), "/tick_rate"),
        (json!({"tick_rate": 241}), "/tick_rate"),
        (json!({"paused": "yes"}), "/paused"),
        (json!({"snowfall_rate": -1}), "/snowfall_rate"),
        (json!({"pressing": "fast"}), "/pressing"),
        (json!({"pressing": -0.1}), "/pressing"),
        (json!({"pressing": 10.1}), "/pressing"),
        (json!({"pressing": true}), "/pressing"),
        (json!({"pressing": null}), "/pressing"),
        (json!({"idle_timeout_s": 0}), "/idle_timeout_s"),
        (json!({"delete_after_s": -1}), "/delete_after_s"),
        (json!({"initial_snow": {"depth": 1}}), "/initial_snow"),
        (json!({"initial_snow": [{"depth": 1}, {"depth": 0}]}), "/initial_snow/1/depth"),
        (json!({"initial_snow": [{"temperature": -3}]}), "/initial_snow/0/depth"),
        (json!({"initial_snow": [{"depth": 1, "density": 5}]}), "/initial_snow/0/density"),
        (json!({"initial_snow": [{"depth": 1, "temperature": 2}]}), "/initial_snow/0/temperature"),
        (json!({"terrain": {"heights": [0, 1]}}), "/terrain/heights"),
        (json!({"terrain": {"heights": "flat"}}), "/terrain/heights"),
        (json!({"terrain": {}}), "/terrain/heights"),
        (json!({"name": "x"}), "/name"),
        (json!({"id": 7}), "/id"),
    ];
    for (body, pointer) in cases {
        let reply = server.post("/v1/sessions", body.clone()).await;
        assert!(
            reply.pointers(422).iter().any(|found| found == pointer),
            "{body}: {}",
            reply.json()
        );
    }
    let grid = json!({"width": 2, "depth": 1, "cell_size": 0.02});
    let steep = json!({"grid": grid, "terrain": {"heights": [0.0, 1311.0]}});
    assert_eq!(server.post("/v1/sessions", steep).await.pointers(422), ["/terrain/heights"]);
    for far in [1e308, -20_000.1] {
        let terrain = json!({"heights": [0.0, far]});
        let body = json!({"grid": {"width": 2, "depth": 1}, "terrain": terrain});
        let reply = server.post("/v1/sessions", body).await;
        assert_eq!(reply.pointers(422), ["/terrain/heights/1"]);
    }
    // Everything that is wrong is told at once.
    let body = json!({"grid": {"width": 0, "height": 300}, "tick_rate": 0});
    let pointers = server.post("/v1/sessions", body).await.pointers(422);
    assert_eq!(pointers, ["/grid/width", "/grid/height", "/tick_rate"]);
    assert_eq!(server.get("/v1/sessions").await.expect(200)["items"], json!([]));
    server.stop().await;
}

async fn bad_changes_are_refused_and_change_nothing(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    server.step(&path, 10).await;
    let state = async || {
        let mut state = Vec::new();
        for part in ["", "/mass", "/heights", "/colliders", "/columns/3/3"] {
            state.push(server.get(&format!("{path}{part}")).await.expect(200));
        }
        state
    };
    let before = state().await;
    let whole = json!({"x": 0, "z": 0, "width": 1, "depth": 1});
    let region = |field: &str, value: Value| {
        let mut region = whole.clone();
        region[field] = value;
        json!({"depth": 0.5, "region": region})
    };
    let cases: Vec<(Method, &str, Value, &str)> = vec![
        (Method::POST, "snowfalls", json!({}), "/depth"),
        (Method::POST, "snowfalls", json!({"depth": 0}), "/depth"),
        (Method::POST, "snowfalls", json!({"depth": -1}), "/depth"),
        (Method::POST, "snowfalls", json!({"depth": 1e300}), "/depth"),
        (Method::POST, "snowfalls", json!({"depth": null}), "/depth"),
        (Method::POST, "snowfalls", json!({"depth": "deep"}), "/depth"),
        (Method::POST, "snowfalls", json!({"depth": 1, "density": 9}), "/density"),
        (Method::POST, "snowfalls", json!({"depth": 1, "density": 101}), "/density"),
        (Method::POST, "snowfalls", json!({"depth": 1, "temperature": 0.5}), "/temperature"),
        (Method::POST, "snowfalls", json!({"depth": 1, "height": 2}), "/height"),
        (Method::POST, "snowfalls", region("width", json!(0)), "/region/width"),
        (Method::POST, "snowfalls", region("depth", json!(-1)), "/region/depth"),
        (Method::POST, "snowfalls", region("x", json!("left")), "/region/x"),
        (Method::POST, "snowfalls", region("y", json!(1)), "/region/y"),
        (Method::POST, "snowfalls", region("x", json!(1e300)), "/region"),
        (Method::POST, "snowfalls", json!({"depth": 1, "region": {"x": 0}}), "/region/z"),
        (Method::POST, "clearings", json!({"depth": -0.1}), "/depth"),
        (Method::POST, "clearings", json!({}), "/depth"),
        (Method::POST, "clearings", json!({"depth": 0.1, "to": 1}), "/to"),
        (Method::PUT, "air-temperature", json!({"celsius": 5}), "/celsius"),
        (Method::PUT, "air-temperature", json!({"celsius": -273}), "/celsius"),
        (Method::PUT, "air-temperature", json!({"kelvin": 263}), "/kelvin"),
        (Method::PUT, "air-temperature", json!({}), "/celsius"),
        (Method::PATCH, "", json!({"air_temperature": 3, "tick_rate": 30}), "/air_temperature"),
        (Method::PATCH, "", json!({"time_scale": -1}), "/time_scale"),
        (Method::PATCH, "", json!({"tick_rate": 1000}), "/tick_rate"),
        (Method::PATCH, "", json!({"stiffness_exponent": 2}), "/stiffness_exponent"),
        (Method::PATCH, "", json!({"snowfall_rate": 101}), "/snowfall_rate"),
        (Method::PATCH, "", json!({"pressing": 11}), "/pressing"),
        (Method::PATCH, "", json!({"pressing": "slow"}), "/pressing"),
        (Method::PATCH, "", json!({"pressing": ["creep"]}), "/pressing"),
        (Method::PATCH, "", json!({"idle_timeout_s": 0}), "/idle_timeout_s"),
        (Method::PATCH, "", json!({"delete_after_s": "soon"}), "/delete_after_s"),
        (Method::PATCH, "", json!({"grid": {"width": 9}}), "/grid"),
        (Method::POST, "step", json!({"ticks": 1e300}), "/ticks"),
    ];
    for (method, part, body, pointer) in cases {
        let url = if part.is_empty() { path.clone() } else { format!("{path}/{part}") };
        let reply = server.send(method, &url, &[JSON], body.to_string().into_bytes()).await;
        let pointers = reply.pointers(422);
        assert!(pointers.iter().any(|p| p == pointer), "{part} {body}: {}", reply.json());
    }
    assert_eq!(state().await, before, "nothing changed");
    server.stop().await;
}

async fn bad_bodies_are_refused(backend: BackendChoice) {
    let mut options = Options::default();
    options.requests.max_body_bytes = 4096;
    let server = Server::start_with(backend, options).await;
    let path = format!("{}/snowfalls", server.create(small()).await);
    let send = async |headers: &[(&str, &str)], body: &str| {
        server.send(Method::POST, &path, headers, body.as_bytes().to_vec()).await
    };
    for body in ["", "{", "depth=1", "{\"depth\": NaN}", "{\"depth\": 1,}", "{\"depth\": 1}{}"] {
        send(&[JSON], body).await.problem(400);
    }
    let not_utf8 = server.send(Method::POST, &path, &[JSON], b"{\"depth\": \"\xff\"}".to_vec());
    not_utf8.await.problem(400);
    for body in ["[]", "1", "null", "\"snow\""] {
        send(&[JSON], body).await.problem(422);
    }
    assert_eq!(send(&[JSON], "{\"depth\": 1e999}").await.pointers(422), ["/depth"]);
    assert_eq!(send(&[JSON], "{\"depth\": 1, \"depth\": 2}").await.pointers(422), ["/depth"]);
    for media_type in ["text/plain", "application/x-www-form-urlencoded", "application/jsonx"] {
        send(&[("content-type", media_type)], "{\"depth\": 1}").await.problem(415);
    }
    send(&[], "{\"depth\": 1}").await.problem(415);
    let long = format!("{{\"depth\": 1{}}}", " ".repeat(4096));
    assert!(send(&[JSON], &long).await.problem(413)["detail"].as_str().unwrap().contains("4096"));
    for media_type in ["application/json; charset=utf-8", "Application/JSON"] {
        send(&[("content-type", media_type)], "{\"depth\": 0.1}").await.expect(200);
    }
    server.stop().await;
}

async fn unknown_things_are_not_found(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    for unknown in [
        "/v2/sessions",
        "/v1",
        "/v1/session",
        "/v1/sessions/",
        "/v1/sessions/nobody",
        "/v1/sessions/nobody/heights",
        "/v1/sessions/%00",
        "/v1/sessions/%ff",
        "/index.html",
    ] {
        server.get(unknown).await.problem(404);
    }
    server.post("/v1/sessions/nobody/snowfalls", json!({"depth": 1})).await.problem(404);
    server.post("/v1/sessions/nobody/step", json!({"ticks": 1})).await.problem(404);
    server.post("/v1/sessions/nobody/reset", json!({})).await.problem(404);
    server.put("/v1/sessions/nobody/air-temperature", json!({"celsius": -1})).await.problem(404);
    server.get(&format!("{path}/colliders/nobody")).await.problem(404);
    for (method, url, allowed) in [
        (Method::PUT, "/v1/sessions".to_owned(), ["GET", "POST"]),
        (Method::POST, path.clone(), ["GET", "PATCH"]),
        (Method::DELETE, format!("{path}/colliders"), ["GET", "POST"]),
        (Method::POST, format!("{path}/heights"), ["GET", "HEAD"]),
    ] {
        let reply = server.send(method, &url, &[], Vec::new()).await;
        reply.problem(405);
        let allow: Vec<&str> = reply.header("allow").split(',').map(str::trim).collect();
        assert!(allowed.iter().all(|method| allow.contains(method)), "{url}: {allow:?}");
    }
    server.stop().await;
}

/// A body that never ends runs into the time limit of requests; the server lives on.
#[tokio::test(flavor = "multi_thread")]
async fn a_request_that_takes_too_long_is_ended() {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    let options = Options {
        requests: RequestConfig {
            max_body_bytes: 4096,
            request_timeout: Duration::from_millis(50),
            ..RequestConfig::default()
        },
        ..Options::default()
    };
    let server = Server::start_with(BackendChoice::Cpu, options).await;
    let address = server.url.strip_prefix("http://").unwrap();
    let mut stream = tokio::net::TcpStream::connect(address).await.unwrap();
    let head = "POST /v1/sessions HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\n\
                content-length: 100\r\nconnection: close\r\n\r\n{";
    stream.write_all(head.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 503"), "{answer}");
    assert!(answer.contains("application/problem+json"), "{answer}");
    server.get("/livez").await.expect(200);
    server.stop().await;
}
