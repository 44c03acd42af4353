//! A server without memory for what a request asks.

use std::path::PathBuf;

use reqwest::StatusCode;
use rustix::process::{Resource, Rlimit, prlimit};
use serde_json::{Value, json};

use crate::running::{Running, serve};

/// Memory that the server is left with \[bytes\].
const LEFT: u64 = 160 << 20;

#[tokio::test(flavor = "multi_thread")]
async fn without_memory_a_request_gets_507_and_the_server_lives() {
    let server = Running::start(serve(&["--listen", "127.0.0.1:0"]));
    let sessions = format!("{}/v1/sessions", server.url);
    let client = reqwest::Client::new();
    let create = async |body: Value| client.post(&sessions).json(&body).send().await.unwrap();
    let small = json!({"id": "small", "initial_snow": [{"depth": 1}]});
    assert_eq!(create(small).await.status(), StatusCode::CREATED);
    let wide = json!({"id": "wide", "grid": {"width": 2048, "depth": 2048, "height": 2}});
    assert_eq!(create(wide).await.status(), StatusCode::CREATED);

    let status = std::fs::read_to_string(PathBuf::from(format!(
        "/proc/{}/status",
        server.pid().as_raw_nonzero()
    )));
    let status = status.unwrap();
    let size = status.lines().find_map(|line| line.strip_prefix("VmSize:")).unwrap();
    let kilobytes: u64 = size.trim().trim_end_matches(" kB").parse().unwrap();
    let most = Some(kilobytes * 1024 + LEFT);
    prlimit(Some(server.pid()), Resource::As, Rlimit { current: most, maximum: most }).unwrap();

    let huge = json!({"id": "huge", "grid": {"width": 4096, "depth": 4096, "height": 1}});
    let snapshot = format!("{sessions}/wide/snapshot");
    for answer in [create(huge).await, client.get(snapshot).send().await.unwrap()] {
        assert_eq!(answer.status(), StatusCode::INSUFFICIENT_STORAGE);
        let problem: Value = answer.json().await.unwrap();
        assert!(problem["type"].as_str().unwrap().ends_with("memory"), "{problem}");
    }

    // Others don't notice.
    let name = json!({"id": "another"});
    assert_eq!(create(name).await.status(), StatusCode::CREATED);
    let read = client.get(format!("{sessions}/small/heights")).send().await.unwrap();
    assert_eq!(read.status(), StatusCode::OK);
}
