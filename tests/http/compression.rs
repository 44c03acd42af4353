//! Answers in fewer bytes, for clients that ask for it.

use std::io::{Cursor, Read};

use firn::config::BackendChoice;
use reqwest::Method;
use serde_json::{Value, json};

use crate::support::{Reply, Server};

const CODINGS: [&str; 2] = ["gzip", "zstd"];

/// Asks for something in a coding; what is sent is left as it is.
async fn coded(server: &Server, method: Method, url: &str, accept: &str, coding: &str) -> Reply {
    let headers = [("accept", accept), ("accept-encoding", coding)];
    server.send(method, url, &headers, Vec::new()).await
}

/// What a coded answer says.
fn decoded(reply: &Reply) -> Vec<u8> {
    let bytes = Cursor::new(&reply.body);
    let mut plain = Vec::new();
    match reply.header("content-encoding") {
        "gzip" => flate2::read::GzDecoder::new(bytes).read_to_end(&mut plain).map(drop).unwrap(),
        "zstd" => plain = zstd::decode_all(bytes).unwrap(),
        other => panic!("{other:?} is no coding that was asked for"),
    }
    plain
}

/// A paused session of 60 × 50 columns on hills: its heights take more than 64 KiB as JSON, less as floats.
async fn hills(server: &Server) -> String {
    let elevations: Vec<f64> = (0..3000).map(|i| (f64::from(i) * 0.37).sin()).collect();
    let grid = json!({"width": 60, "depth": 50, "height": 20, "cell_size": 0.2});
    let snow = json!([{"depth": 1}]);
    let terrain = json!({ "heights": elevations });
    server
        .create(json!({"grid": grid, "paused": true, "initial_snow": snow, "terrain": terrain}))
        .await
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_comes_in_fewer_bytes_where_that_is_asked_for() {
    let server = Server::start(BackendChoice::Cpu).await;
    let path = hills(&server).await;
    let heights = format!("{path}/heights?surface=true");
    for (url, accept) in [
        (&heights, "application/json"),
        (&heights, "application/octet-stream"),
        (&heights, "application/x-npy"),
        (&format!("{path}/cells?height=2&width=8"), "*/*"),
        (&format!("{path}/profile.svg?column_x=3&column_z=4"), "*/*"),
        (&format!("{path}/terrain"), "*/*"),
        (&"/openapi.json".to_owned(), "*/*"),
        (&"/docs/swagger-ui-bundle.js".to_owned(), "*/*"),
    ] {
        let plain = coded(&server, Method::GET, url, accept, "identity").await;
        assert_eq!((plain.status, plain.header("content-encoding")), (200, ""), "{url}");
        assert!(plain.varies("accept-encoding"), "{url}: {:?}", plain.headers);
        for coding in CODINGS {
            let packed = coded(&server, Method::GET, url, accept, coding).await;
            assert_eq!((packed.status, packed.header("content-encoding")), (200, coding), "{url}");
            assert!(packed.body.len() < plain.body.len(), "{url}: {accept}");
            assert_eq!(decoded(&packed), plain.body, "{url}");
            assert!(packed.varies("accept-encoding"), "{url}: {:?}", packed.headers);
            for header in ["content-type", "etag", "firn-seq", "cache-control"] {
                assert_eq!(packed.header(header), plain.header(header), "{url}");
            }
            let head = coded(&server, Method::HEAD, url, accept, coding).await;
            for header in ["content-type", "content-encoding", "content-length", "vary", "etag"] {
                assert_eq!(head.header(header), packed.header(header), "{url}: {header}");
            }
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_does_not_gain_by_it_goes_as_it_is() {
    let server = Server::start(BackendChoice::Cpu).await;
    let path = hills(&server).await;
    for (url, accept) in [
        (format!("{path}/mass"), "*/*"),
        (format!("{path}/heights?width=8&depth=8"), "application/octet-stream"),
        (format!("{path}/heights?surface=true"), "image/png"),
        (format!("{path}/snapshot"), "*/*"),
    ] {
        let plain = coded(&server, Method::GET, &url, accept, "identity").await;
        let reply = coded(&server, Method::GET, &url, accept, "gzip, zstd").await;
        assert_eq!((reply.status, reply.header("content-encoding")), (200, ""), "{url}");
        assert_eq!(reply.body, plain.body, "{url}");
    }
    let url = format!("{path}/heights");
    for coding in ["", "br", "gzip;q=0", "*;q=0", "identity;q=0"] {
        let reply = coded(&server, Method::GET, &url, "*/*", coding).await;
        assert_eq!((reply.status, reply.header("content-encoding")), (200, ""), "{coding}");
        assert!(reply.json()["heights"].is_array());
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_the_client_holds_coded_is_not_sent_again() {
    let server = Server::start(BackendChoice::Cpu).await;
    let path = hills(&server).await;
    let url = format!("{path}/heights");
    for coding in CODINGS {
        let tag = coded(&server, Method::GET, &url, "*/*", coding).await.header("etag").to_owned();
        let headers = [("accept-encoding", coding), ("if-none-match", &tag)];
        let held = server.send(Method::GET, &url, &headers, Vec::new()).await;
        assert_eq!((held.status, held.body.len(), held.header("etag")), (304, 0, &*tag));
        assert_eq!(held.header("content-encoding"), "");
        assert!(held.varies("accept-encoding"), "{:?}", held.headers);
    }
    server.stop().await;
}

/// An answer is kept as it is, and a repeat gets it in the coding that it asks for.
#[tokio::test(flavor = "multi_thread")]
async fn repeats_may_ask_for_another_coding() {
    let server = Server::start(BackendChoice::Cpu).await;
    let body = json!({
        // A long name makes the answer long enough.
        "id": "n".repeat(64), "paused": true,
        "grid": {"width": 20, "depth": 20, "height": 4, "cell_size": 0.5},
    });
    let send = async |coding: &str| {
        let headers = [
            ("content-type", "application/json"),
            ("idempotency-key", "once"),
            ("accept-encoding", coding),
        ];
        let body = body.to_string().into_bytes();
        server.send(Method::POST, "/v1/sessions", &headers, body).await
    };
    let first = send("gzip").await;
    assert_eq!((first.status, first.header("content-encoding")), (201, "gzip"));
    let zstd = send("zstd").await;
    let plain = send("identity").await;
    for again in [&zstd, &plain] {
        assert_eq!((again.status, again.header("idempotent-replayed")), (201, "true"));
    }
    assert_eq!(plain.header("content-encoding"), "");
    assert_eq!(decoded(&first), plain.body);
    assert_eq!(decoded(&zstd), plain.body);
    let listed = server.get("/v1/sessions").await.expect(200);
    assert_eq!(listed["items"].as_array().map(Vec::len), Some(1), "{listed}");
    assert_ne!(plain.json()["token"], Value::Null);
    server.stop().await;
}
