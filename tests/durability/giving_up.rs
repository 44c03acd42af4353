//! The engine fails over and over: the server waits longer each time, and ends for a supervisor to
//! start it again.

use std::path::Path;
use std::process::{ExitCode, Stdio};
use std::time::{Duration, Instant};

use clap::{Args, Command as Arguments, FromArgMatches};
use firn::cli::{Serve, serve_on};
use firn::driver::Durability;
use firn_engine::cpu::CpuBackend;
use firn_engine::frame::{Backend, EngineError, Frame};
use reqwest::Method;
use serde_json::json;
use tokio::process::Command;

use crate::process::Process;
use crate::support::device::{Watch, Watched};
use crate::support::wait::until;
use crate::support::{Options, Server, small};

/// Names the file after which the device fails, where this program is to be the server.
const FAILS: &str = "FIRN_TEST_DEVICE_FAILS";

/// A device is lost, and never comes back, once there is a certain file.
struct Fragile(String);

impl Fragile {
    fn open(file: &str) -> Result<Box<dyn Backend + Send>, EngineError> {
        let (device, watch) = (Box::new(CpuBackend::new(None, false)), Fragile(file.to_owned()));
        watch.check().map(|()| Box::new(Watched { device, watch }) as _)
    }

    fn check(&self) -> Result<(), EngineError> {
        match Path::new(&self.0).exists() {
            true => Err(EngineError::DeviceFailed("it was unplugged".to_owned())),
            false => Ok(()),
        }
    }
}

impl Watch for Fragile {
    fn submitted(&mut self, _: &Frame) -> Result<(), EngineError> {
        self.check()
    }
}

/// Serves on a device that a file makes fail, until the server ends; then this process does.
fn serve(file: String) -> ! {
    let data = std::env::var("FIRN_DATA_DIR").expect("it is given");
    let arguments = Serve::augment_args(Arguments::new("firn")).get_matches_from([
        "firn",
        "--listen",
        "127.0.0.1:0",
        "--data-dir",
        &data,
    ]);
    let options = Serve::from_arg_matches(&arguments).expect("they are right");
    let code = serve_on(&options, Box::new(move || Fragile::open(&file)));
    // A test that returns says nothing about what came of it.
    std::process::exit(i32::from(code != ExitCode::SUCCESS));
}

/// Starts this program again, as a server.
async fn start(data: &Path, fails: &Path) -> Process {
    let mut command = Command::new(std::env::current_exe().unwrap());
    let test = "giving_up::an_engine_that_does_not_come_back_ends_the_server";
    command.args(["--exact", test, "--nocapture"]);
    command.env(FAILS, fails).env("FIRN_DATA_DIR", data).stdin(Stdio::null());
    let server = Process::spawn(command).await;
    server.recover().await;
    server
}

#[test]
fn an_engine_that_does_not_come_back_ends_the_server() {
    match std::env::var(FAILS) {
        Ok(file) => serve(file),
        Err(_) => tokio::runtime::Runtime::new().unwrap().block_on(unplug()),
    }
}

async fn unplug() {
    let directory = tempfile::tempdir().unwrap();
    let (data, fails) = (directory.path().join("data"), directory.path().join("unplugged"));
    let server = start(&data, &fails).await;
    let session = server.post("/v1/sessions", small()).await;
    let path = format!("/v1/sessions/{}", session["id"].as_str().unwrap());
    let (falls, fall) = (format!("{path}/snowfalls"), json!({"depth": 0.1}));
    server.post(&falls, fall.clone()).await;
    let mass = server.get(&format!("{path}/mass")).await;

    // A fault that is over soon: it goes on by itself.
    std::fs::write(&fails, "").unwrap();
    let refused = server.send(Method::POST, &falls, Some(&fall)).await.unwrap();
    assert_eq!(refused.0, 503, "{}", refused.1);
    until("it has tried again and again", async || {
        server.metric("firn_engine_rebuilds_total").await >= 3.0
    })
    .await;
    assert_eq!(server.metric("firn_engine_healthy").await, 0.0);
    let (status, _) = server.send(Method::GET, "/livez", None).await.unwrap();
    assert_eq!(status, 200, "it has not given up yet");
    std::fs::remove_file(&fails).unwrap();
    until("it comes back", async || server.metric("firn_engine_healthy").await >= 1.0).await;
    assert_eq!(server.get(&format!("{path}/mass")).await["fallen"], mass["fallen"]);

    // One that is not.
    std::fs::write(&fails, "").unwrap();
    server.send(Method::POST, &falls, Some(&fall)).await.unwrap();
    let began = Instant::now();
    let (code, log) = server.exit_code().await;
    assert_eq!(code, Some(1), "{log:#?}");
    assert!(began.elapsed() > Duration::from_secs(2), "the attempts were used up at once");
    let last = log.iter().rfind(|line| line.starts_with("error:")).expect("it says why");
    assert!(last.contains("start the server again"), "{last}");
    assert!(log.iter().any(|line| line.contains("it was unplugged")), "{log:#?}");

    std::fs::remove_file(&fails).unwrap();
    let server = start(&data, &fails).await;
    let back = server.get(&format!("{path}/mass")).await;
    assert_eq!(back["fallen"], mass["fallen"], "what was acknowledged is there");
    server.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn who_watches_is_told_that_only_a_restart_helps() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("unplugged").to_string_lossy().into_owned();
    let fails = file.clone();
    let open = Box::new(move || Fragile::open(&file));
    let server = Server::start_on(open, Options::default(), Durability::ephemeral()).await;
    server.create(small()).await;
    server.get("/livez").await.expect(200);
    std::fs::write(&fails, "").unwrap();
    server.post("/v1/sessions", small()).await.problem(503);
    until("it gives up", async || server.get("/livez").await.status != 200).await;
    let problem = server.get("/livez").await.problem(503);
    assert!(problem["detail"].as_str().unwrap().contains("restart"), "{problem}");
    assert_eq!(server.get("/readyz").await.expect(503)["status"], "failed");
    let metrics = String::from_utf8(server.get("/metrics").await.body).unwrap();
    assert!(metrics.contains("firn_engine_gave_up 1\n"), "{metrics}");
    server.stop().await;
}

/// Where threads are refused, the server says so at the start and not in some later frame.
#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn threads_that_are_refused_are_told_at_the_start() {
    let output = Command::new("sh")
        .args([
            "-c",
            "ulimit -v 1000000; exec \"$0\" serve --backend cpu --ephemeral --listen 127.0.0.1:0",
        ])
        .arg(env!("CARGO_BIN_EXE_firn"))
        .env("RAYON_NUM_THREADS", "3000")
        .stdin(Stdio::null())
        .kill_on_drop(true)
        .output();
    let output = tokio::time::timeout(Duration::from_secs(60), output).await;
    let output = output.expect("it started although it has no threads").unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("error: starting threads for the snowpacks"), "{text}");
}
