//! The server is asked to stop.

use serde_json::json;

use crate::client::Client;
use crate::process::Process;
use crate::script::session;
use crate::support::wait::until;
use crate::support::{Server, slow, small};

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_is_asked_to_stop_saves_everything_in_time() {
    let data = tempfile::tempdir().unwrap();
    let options = ["--backend", "cpu", "--drain-timeout", "50s", "--checkpoint-interval", "1h"];
    let server = Process::ready(data.path(), &options).await;
    for i in 0..20 {
        let path = format!("/v1/sessions/s{i}");
        server.post("/v1/sessions", session(&format!("s{i}"))).await;
        server.post(&format!("{path}/snowfalls"), json!({"depth": 0.2})).await;
        server.post(&format!("{path}/step"), json!({"ticks": 30})).await;
    }
    let before = server.get("/v1/sessions/s7/digest").await;
    let mut stream =
        Client::try_open(&server.url, "/v1/sessions/s7", "firn.v1.json").await.expect("it opens");
    server.terminate();
    let end = loop {
        match stream.try_next().await {
            Ok(_) => {}
            Err(end) => break end,
        }
    };
    assert!(end.contains("1001") || end.contains("Away"), "{end}");
    drop(stream);
    let (success, log) = server.ended().await;
    assert!(success, "{log:#?}");
    assert!(log.iter().any(|line| line.contains("20 of 20 last checkpoints")), "{log:#?}");

    let server = Process::ready(data.path(), &options).await;
    let after = server.get("/v1/sessions/s7/digest").await;
    assert_eq!(after["digest"], before["digest"]);
    server.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_step_under_way_keeps_nobody_from_being_saved() {
    let data = tempfile::tempdir().unwrap();
    let options = ["--backend", "cpu", "--drain-timeout", "10s", "--checkpoint-interval", "1h"];
    let server = Process::ready(data.path(), &options).await;
    for i in 0..3 {
        server.post("/v1/sessions", session(&format!("s{i}"))).await;
    }
    // Its ticks are parted, and never come to an end by themselves.
    let mut busy = slow();
    busy["id"] = json!("busy");
    busy["time_scale"] = json!(1000);
    busy["tick_rate"] = json!(2);
    server.post("/v1/sessions", busy).await;
    let client = reqwest::Client::new();
    let step = client.post(format!("{}/v1/sessions/busy/step", server.url));
    let step = tokio::spawn(step.json(&json!({"ticks": 1_000_000})).send());
    let tick =
        async |server: &Process| server.get("/v1/sessions/busy").await["tick"].as_u64().unwrap();
    until("it is under way", async || tick(&server).await >= 3).await;
    let before = tick(&server).await;
    server.terminate();
    let (success, log) = server.ended().await;
    assert!(success, "{log:#?}");
    assert!(log.iter().any(|line| line.contains("4 of 4 last checkpoints")), "{log:#?}");
    drop(step);

    let server = Process::ready(data.path(), &options).await;
    assert!(tick(&server).await >= before);
    let mass = server.get("/v1/sessions/busy/mass").await;
    assert_eq!(mass["imbalance_quanta"], 0);
    server.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn no_session_begins_while_the_server_stops() {
    let server = Server::start(firn::config::BackendChoice::Cpu).await;
    server.sessions.close();
    server.post("/v1/sessions", small()).await.problem(503);
    server.stop().await;
}
