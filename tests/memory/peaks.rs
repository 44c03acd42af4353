//! The most memory that clients get a server to ask for who don't take answers, or send half of
//! what they announce. What a budget counts of that is no witness: it never counts more than it has.

use std::time::Duration;

use firn::config::{BackendChoice, RequestConfig};
use serde_json::json;
use tokio::io::AsyncWriteExt;

use crate::raw::{ask, reached};
use crate::support::wait::{PATIENCE, until};
use crate::support::{Options, Server, small};
use crate::{allocated, alone};

async fn server(requests: RequestConfig) -> Server {
    Server::start_with(BackendChoice::Cpu, Options { requests, ..Options::default() }).await
}

/// Checks that no more than so many bytes have been taken since there was `before`.
fn check(before: i64, most: u64) {
    let taken = allocated::peak() - before;
    println!("{taken} bytes at the peak, of {most}");
    assert!(taken <= most as i64, "{taken} bytes at the peak, of {most}");
}

#[test]
fn answers_that_nobody_takes_need_no_more_than_twice_their_budget() {
    alone(async {
        const BUDGET: u64 = 12 << 20;
        let request_timeout = Duration::from_millis(500);
        let limits = RequestConfig { max_unsent: BUDGET, request_timeout, ..Default::default() };
        let server = server(limits).await;
        // Heights of it take some 5.7 MB.
        let grid = json!({"width": 512, "depth": 512, "height": 2, "cell_size": 0.5});
        let spec = json!({"grid": grid, "paused": true, "initial_snow": [{"depth": 0.3}]});
        let spec = serde_json::from_value(spec).unwrap();
        // However long that takes.
        let (session, _tokens) = server.sessions.create(spec).await.unwrap();
        let before = allocated::watch();
        let mut silent = Vec::new();
        for _ in 0..30 {
            let request = format!("GET /v1/sessions/{}/heights", session.id);
            silent.push(ask(&server, &request, "").await);
        }
        until("the budget is used", async || reached(&server, "max-unsent").await > 0).await;
        check(before, 2 * BUDGET);
        drop(silent);
        server.stop().await;
    });
}

#[test]
fn half_sent_bodies_need_no_more_than_four_times_their_budget() {
    alone(async {
        const BUDGET: u64 = 4 << 20;
        let limits = RequestConfig {
            max_body_bytes: 2 << 20,
            max_bodies: BUDGET,
            request_timeout: PATIENCE,
            ..Default::default()
        };
        let server = server(limits).await;
        let request = format!("POST {}/snowfalls", server.create(small()).await);
        let half = [b"1e8480\r\n", &vec![b' '; 1_000_000][..]].concat();
        let before = allocated::watch();
        let mut silent = Vec::new();
        for _ in 0..40 {
            let headers = "content-type: application/json\r\ntransfer-encoding: chunked\r\n";
            let mut stream = ask(&server, &request, headers).await;
            // Those that find no room are closed.
            let _ = stream.write_all(&half).await;
            silent.push(stream);
        }
        until("the others are refused", async || reached(&server, "max-bodies").await == 36).await;
        // Each has room to grow, twice what it holds, and is moved there.
        check(before, 4 * BUDGET);
        drop(silent);
        server.stop().await;
    });
}
