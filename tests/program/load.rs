//! The load tool against a real server.

use std::process::{Output, Stdio};
use std::time::Duration;

use firn::config::BackendChoice;
use serde_json::Value;
use tokio::process::Command;

use crate::on_each_backend;
use crate::support::Server;
use crate::support::wait::until;

on_each_backend!(
    a_run_is_reported,
    stalled_clients_catch_up,
    an_interrupted_run_cleans_up,
    durable_snowfalls_are_counted,
    samples_are_timed,
    a_neighbour_is_measured_beside_hostile_clients,
);

/// Beyond any run of these tests.
const PATIENCE: Duration = Duration::from_secs(120);

fn tool(server: &Server, options: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_firn"));
    command
        .args(["load", "--json", "--grid", "32x32", "--region", "16x16", "--url", &server.url])
        .args(options)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .kill_on_drop(true);
    command
}

#[track_caller]
fn report(output: &Output) -> Value {
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    serde_json::from_slice(&output.stdout).expect("a report is JSON")
}

async fn finished(mut command: Command) -> Output {
    tokio::time::timeout(PATIENCE, command.output()).await.expect("it ends").expect("it runs")
}

async fn sessions(server: &Server) -> usize {
    let list = server.get("/v1/sessions").await.expect(200);
    list["items"].as_array().expect("a list").len()
}

async fn a_run_is_reported(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let pid = std::process::id().to_string();
    let mut options = vec!["--clients", "20", "--colliders", "3", "--duration", "2s"];
    if cfg!(target_os = "linux") {
        options.extend(["--server-pid", &pid]);
    }
    let report = report(&finished(tool(&server, &options)).await);
    assert_eq!(report["clients"], 20, "{report}");
    assert_eq!(report["drops"], serde_json::json!({}), "{report}");
    assert_eq!(report["interrupted"], false);
    assert_eq!(report["batches_refused"], 0);
    for counted in ["messages", "delta_bytes", "delta_columns", "batches"] {
        assert!(report[counted].as_u64() > Some(0), "{counted}: {report}");
    }
    // Whole tiles of 64 columns, which the grid has only.
    assert_eq!(report["delta_columns"].as_u64().unwrap() % 64, 0);
    let per_column = report["bytes_per_column"].as_f64().unwrap();
    let bytes = report["delta_bytes"].as_f64().unwrap();
    assert!((per_column - bytes / report["delta_columns"].as_f64().unwrap()).abs() < 1e-9);
    // In JSON a column takes a digit and a comma at least.
    assert!(per_column >= 2.0, "{report}");
    let latency = &report["latency_ms"];
    let of = |name: &str| latency[name].as_f64().unwrap();
    assert!(of("p50") <= of("p90") && of("p90") <= of("p99") && of("p99") <= of("max"));
    assert!(of("p50") >= 0.0 && latency["count"].as_u64() > Some(0), "{report}");
    assert_eq!(report["server_memory"].is_object(), cfg!(target_os = "linux"));
    assert_eq!(sessions(&server).await, 0, "its sessions are deleted");
    server.stop().await;
}

async fn durable_snowfalls_are_counted(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let options = ["--durable", "--sessions", "3", "--clients", "5", "--changes", "20", "--keep"];
    let report = report(&finished(tool(&server, &options)).await);
    assert_eq!((&report["acknowledged"], &report["refused"]), (&60.into(), &0.into()), "{report}");
    assert_eq!(report["answer_ms"]["count"], 60);
    let list = server.get("/v1/sessions").await.expect(200);
    let each = 20.0 * 0.001 * 20.0 * 32.0 * 32.0 * 0.04 + 2.0 * 20.0 * 32.0 * 32.0 * 0.04;
    assert_eq!(list["items"].as_array().unwrap().len(), 3, "they are kept");
    for session in list["items"].as_array().unwrap() {
        let id = session["id"].as_str().unwrap();
        let mass = server.get(&format!("/v1/sessions/{id}/mass")).await.expect(200);
        let fallen = mass["fallen"].as_f64().unwrap();
        assert!((fallen - each).abs() < each * 1e-3, "{fallen} of {each} kg");
    }
    let options = ["--durable", "--sessions", "1", "--clients", "2", "--duration", "300ms"];
    let report = self::report(&finished(tool(&server, &options)).await);
    assert!(report["per_second"].as_f64() > Some(0.0), "{report}");
    assert_eq!(sessions(&server).await, 3, "its sessions are deleted");
    server.stop().await;
}

async fn samples_are_timed(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let report =
        report(&finished(tool(&server, &["--samples", "50", "--duration", "300ms"])).await);
    assert_eq!(report["points"], 50);
    let asked = report["asked"].as_array().expect("a list");
    assert_eq!(asked.len(), 4);
    for of in asked {
        assert!(of[1]["count"].as_u64() > Some(0), "{report}");
    }
    assert_eq!(sessions(&server).await, 0, "its session is deleted");
    server.stop().await;
}

async fn a_neighbour_is_measured_beside_hostile_clients(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let pid = std::process::id().to_string();
    let mut options = vec!["--hostile", "--scale", "0.02", "--duration", "300ms"];
    if cfg!(target_os = "linux") {
        options.extend(["--server-pid", &pid]);
    }
    let report = report(&finished(tool(&server, &options)).await);
    assert_eq!(report["interrupted"], false, "{report}");
    let beside = report["beside"].as_array().expect("a list");
    let all = ["ticks", "objects", "settling", "pictures", "unread", "snapshots", "bodies"];
    assert!(beside.iter().map(|beside| &beside["scenario"]).eq(all), "{report}");
    for got in beside.iter().map(|beside| &beside["neighbour"]).chain([&report["baseline"]]) {
        assert!(got["changes"].as_u64() > Some(0), "{report}");
        assert_eq!((&got["refused"], &got["change_ms"]["count"]), (&0.into(), &got["changes"]));
    }
    assert!(report["baseline"]["ticks_per_second"].as_f64() > Some(0.0), "{report}");
    // As many clients as there are at this scale, each with its last request still under way.
    for (place, clients, statuses) in [
        (0, 0, &[][..]),
        (1, 0, &[]),
        (2, 1, &["200"]),
        (3, 1, &["200"]),
        (4, 4, &["200"]),
        (5, 4, &["200"]),
        (6, 1, &[]),
    ] {
        let outcomes = beside[place]["outcomes"].as_object().expect("an object");
        let known = |what: &String| what == "under way" || statuses.contains(&&**what);
        assert!(outcomes.keys().all(known), "{report}");
        let count: u64 = outcomes.values().map(|count| count.as_u64().unwrap()).sum();
        assert!(count >= clients, "{report}");
        assert_eq!(clients == 0, count == 0, "{report}");
        assert_eq!(beside[place]["alone"].is_object(), place == 0, "{report}");
        assert_eq!(beside[place]["memory"].is_object(), cfg!(target_os = "linux"));
    }
    for got in [&beside[0]["alone"]["live"], &beside[0]["alone"]["stepped"]] {
        assert!(got["charged_share"].as_f64() > Some(0.0), "{report}");
        assert!(got["frame_share"].as_f64() > Some(0.0), "{report}");
    }
    assert_eq!(sessions(&server).await, 0, "its sessions are deleted");
    server.stop().await;
}

async fn stalled_clients_catch_up(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let options = [
        "--sessions",
        "2",
        "--clients",
        "6",
        "--slow-clients",
        "2",
        "--stall",
        "500ms",
        "--duration",
        "3s",
        "--settled",
    ];
    let report = report(&finished(tool(&server, &options)).await);
    assert_eq!((&report["sessions"], &report["slow_clients"]), (&2.into(), &2.into()));
    assert_eq!(report["caught_up"], 2, "{report}");
    assert!(report["catch_up_messages"].as_u64() >= Some(1), "{report}");
    assert_eq!(sessions(&server).await, 0);
    server.stop().await;
}

async fn an_interrupted_run_cleans_up(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut command = tool(&server, &["--clients", "5", "--duration", "10m"]);
    let child = command.spawn().expect("it runs");
    let pid = child.id().expect("it has not ended").to_string();
    until("it creates a session", async || sessions(&server).await > 0).await;
    let sent = Command::new("kill").args(["-INT", &pid]).status().await.expect("kill runs");
    assert!(sent.success());
    let ended = tokio::time::timeout(PATIENCE, child.wait_with_output()).await;
    let output = ended.expect("it ends").expect("it was waited for");
    // Whether it was still preparing or running already, it says so and leaves nothing behind.
    if output.status.success() {
        assert_eq!(report(&output)["interrupted"], true);
    } else {
        assert!(String::from_utf8_lossy(&output.stderr).contains("interrupted"));
    }
    assert_eq!(sessions(&server).await, 0, "its sessions are deleted");
    server.stop().await;
}

#[tokio::test]
async fn a_run_that_cannot_be_says_why() {
    for (options, expected) in [
        (&["--clients", "0"][..], "at least one session and one client"),
        (&["--slow-clients", "200"], "200 slow clients are more than all 100"),
        (&["--grid", "4x4", "--region", "4x4"], "at least 8x8 columns"),
        (&["--region", "200x1"], "larger than the grid"),
        (&["--tick-rate", "0"], "not within 0.1 to 1000 Hz"),
        (&["--url", "https://127.0.0.1"], "without TLS"),
        (&["--url", "http://127.0.0.1:1"], "can't be reached"),
        (&["--hostile", "--url", "http://192.0.2.1:8080"], "no server on this machine"),
        (&["--hostile", "--scale", "2"], "above 0 and at most 1"),
        (&["--hostile", "--scenario", "kindness"], "kindness"),
        (&["--hostile", "--durable"], "cannot be used with"),
        (&["--scenario", "ticks"], "--hostile"),
        (&["--region", "8"], "expected columns along x and z"),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_firn"));
        let output = command.arg("load").args(options).output().await.expect("it runs");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && errors.contains(expected), "{options:?}: {errors}");
    }
}
