//! Large answers, and clients that don't take them.

use std::io::Read;
use std::time::Duration;

use firn::config::{BackendChoice, RequestConfig};
use futures_util::SinkExt;
use futures_util::future::join_all;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use reqwest::Method;
use serde_json::{Value, json};
use tokio::io::AsyncWriteExt;
use tokio_tungstenite::tungstenite::Message;

use crate::raw::{ask, metric, reached};
use crate::support::wait::{PATIENCE, until};
use crate::support::{Options, Server};

/// Memory for answers.
const BUDGET: u64 = 12 << 20;

async fn server(request_timeout: Duration) -> Server {
    let requests =
        RequestConfig { max_unsent: BUDGET, request_timeout, ..RequestConfig::default() };
    Server::start_with(BackendChoice::Cpu, Options { requests, ..Options::default() }).await
}

/// Heights of it take some 5.7 MB.
fn large() -> Value {
    let grid = json!({"width": 512, "depth": 512, "height": 2, "cell_size": 0.5});
    json!({"grid": grid, "paused": true, "initial_snow": [{"depth": 0.3}]})
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_that_nobody_takes_stay_within_their_budget() {
    let server = server(Duration::from_millis(500)).await;
    // However long that takes.
    let (session, _tokens) =
        server.sessions.create(serde_json::from_value(large()).unwrap()).await.unwrap();
    let path = format!("/v1/sessions/{}", session.id);
    let mut silent = Vec::new();
    for _ in 0..30 {
        silent.push(ask(&server, &format!("GET {path}/heights"), "").await);
    }
    until("the budget is used", async || reached(&server, "max-unsent").await > 0).await;
    assert!(server.app.answers.unsent.held() >= BUDGET / 4);
    // The sockets may still be taking some of it.
    let told = async || metric(&server, "firn_unsent_bytes").await;
    until("it is told", async || told().await == server.app.answers.unsent.held()).await;
    // Small answers need no room, large ones are refused.
    server.get(&format!("{path}/heights?width=8&depth=8")).await.expect(200);
    let mut refused = server.get(&format!("{path}/heights")).await;
    while refused.status == 200 {
        // The sockets had taken enough of the others to make room for one.
        silent.push(ask(&server, &format!("GET {path}/heights"), "").await);
        refused = server.get(&format!("{path}/heights")).await;
    }
    assert_eq!(refused.header("retry-after"), "5");
    refused.problem(503);
    drop(silent);
    until("it is given back", async || server.app.answers.unsent.held() == 0).await;
    let again = async || server.get(&format!("{path}/heights")).await.status == 200;
    until("there is room again", again).await;
    server.stop().await;
}

/// Snapshots, digests, cells and the grid in pictures are made one after another where there is no room
/// for all at once; and each answer's memory is given back.
#[tokio::test(flavor = "multi_thread")]
async fn large_answers_wait_for_each_other() {
    let server = server(PATIENCE).await;
    let path = server.create(large()).await;
    for what in ["snapshot", "digest", "cells?height=2&width=256", "heights"] {
        let url = format!("{path}/{what}");
        let answers = join_all((0..6).map(|_| server.get(&url))).await;
        answers.iter().for_each(|answer| assert_eq!(answer.status, 200, "{what}"));
        until("it is given back", async || server.app.answers.unsent.held() == 0).await;
    }
    server.stop().await;
}

/// An answer that no handler asked leave for is counted all the same.
#[tokio::test(flavor = "multi_thread")]
async fn every_large_answer_is_counted() {
    let server = server(PATIENCE).await;
    // One after another on each connection, so that they are more than the operating system takes.
    let next = "GET /openapi.json HTTP/1.1\r\nhost: localhost\r\n\r\n";
    let mut silent = Vec::new();
    for _ in 0..8 {
        let mut stream = ask(&server, "GET /openapi.json", "").await;
        stream.write_all(next.repeat(63).as_bytes()).await.unwrap();
        silent.push(stream);
    }
    until("they are counted", async || server.app.answers.unsent.held() > 1 << 20).await;
    drop(silent);
    until("it is given back", async || server.app.answers.unsent.held() == 0).await;
    server.stop().await;
}

/// Compressed answers are counted until the last byte is taken, as others are.
#[tokio::test(flavor = "multi_thread")]
async fn compressed_answers_that_nobody_takes_are_counted() {
    let server = server(PATIENCE).await;
    let mut dice = SmallRng::seed_from_u64(1);
    let mut body = large();
    body["terrain"] =
        json!({"heights": (0..512 * 512).map(|_| dice.random()).collect::<Vec<f64>>()});
    // It is longer than a request may be.
    let (session, _tokens) =
        server.sessions.create(serde_json::from_value(body).unwrap()).await.unwrap();
    let url = format!("/v1/sessions/{}/heights?surface=true", session.id);
    let plain = server.get(&url).await;
    for (coding, decode) in [
        ("zstd", (|coded| zstd::decode_all(coded).unwrap()) as fn(&[u8]) -> Vec<u8>),
        ("gzip", |coded| {
            let mut plain = Vec::new();
            flate2::read::GzDecoder::new(coded).read_to_end(&mut plain).unwrap();
            plain
        }),
    ] {
        let mut silent = Vec::new();
        until("the budget is used", async || {
            let headers = format!("accept-encoding: {coding}\r\n");
            silent.push(ask(&server, &format!("GET {url}"), &headers).await);
            server.app.answers.unsent.held() > BUDGET / 2
        })
        .await;
        drop(silent);
        until("it is given back", async || server.app.answers.unsent.held() == 0).await;
        let headers = [("accept-encoding", coding)];
        let coded = server.send(Method::GET, &url, &headers, Vec::new()).await;
        assert_eq!(coded.header("content-encoding"), coding);
        assert!(decode(&coded.body) == plain.body, "{coding}");
        until("it is given back", async || server.app.answers.unsent.held() == 0).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_that_nobody_reads_stay_within_the_budget() {
    let server = server(PATIENCE).await;
    let path = server.create(large()).await;
    let url = format!("{}{path}/stream", server.url.replace("http", "ws"));
    let mut silent = Vec::new();
    for _ in 0..12 {
        let (mut stream, _) = tokio_tungstenite::connect_async(&url).await.unwrap();
        let subscribe = json!({"op": "subscribe", "id": 1, "max_rate": 60}).to_string();
        stream.send(Message::text(subscribe)).await.unwrap();
        silent.push(stream);
    }
    let unsent = &server.app.answers.unsent;
    let fall = async || {
        server.post(&format!("{path}/snowfalls"), json!({"depth": 0.01})).await.expect(200)
    };
    // The sockets take much before anything waits.
    until("messages wait", async || {
        fall().await;
        unsent.held() > BUDGET / 4
    })
    .await;
    for _ in 0..50 {
        fall().await;
    }
    drop(silent);
    until("it is given back", async || unsent.held() == 0).await;
    server.stop().await;
}
