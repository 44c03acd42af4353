//! The wall clock is set while no server runs: what is stored does not grow older by it. Nor does it
//! stay for ever where the store's own clock is lost.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use firn::config::BackendChoice;
use firn::driver::Durability;
use firn::store::{Kind, Loaded, RedbStore, Row, Store, StoreClock, StoreError, Write};
use reqwest::{Client, Method};
use serde_json::{Value, json};

use crate::process::Process;
use crate::support::{Options, Server, small};

/// Sets the wall clock of a program forward, and leaves the monotonic one alone.
const SHIM: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <time.h>
int clock_gettime(clockid_t clock, struct timespec *time) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(clock, time);
    const char *ahead = getenv("WALL_CLOCK_AHEAD");
    if (result == 0 && clock == CLOCK_REALTIME && ahead) time->tv_sec += atol(ahead);
    return result;
}
"#;

/// Compiles it; Rust needs a C compiler to link anyway.
fn shim(directory: &Path) -> PathBuf {
    let (source, library) = (directory.join("clock.c"), directory.join("clock.so"));
    std::fs::write(&source, SHIM).unwrap();
    let compiled = Command::new("cc")
        .args(["-shared", "-fPIC", "-o"])
        .args([&library, &source])
        .arg("-ldl")
        .status()
        .expect("there is a C compiler");
    assert!(compiled.success());
    library
}

/// Starts a server whose wall clock is ahead by so many seconds.
async fn start(shim: &Path, data: &Path, ahead: i64) -> Process {
    let mut command = Process::command(data, &["--backend", "cpu"]);
    command.env("LD_PRELOAD", shim).env("WALL_CLOCK_AHEAD", ahead.to_string());
    let server = Process::spawn(command).await;
    server.recover().await;
    server
}

async fn once(server: &Process, path: &str, body: &Value) -> (bool, Value) {
    let request = Client::new().request(Method::POST, format!("{}{path}", server.url));
    let request = request.header("idempotency-key", "the same").json(body);
    let answer = request.send().await.expect("it answers");
    let replayed = answer.headers().contains_key("idempotent-replayed");
    assert_eq!(answer.status(), 200);
    (replayed, answer.json().await.unwrap())
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn a_step_of_the_wall_clock_carries_no_keyed_change_out_twice() {
    let directory = tempfile::tempdir().unwrap();
    let (shim, data) = (shim(directory.path()), directory.path().join("data"));
    let fall = json!({"depth": 0.1});
    let server = start(&shim, &data, 0).await;
    let session = server.post("/v1/sessions", small()).await;
    let path = format!("/v1/sessions/{}", session["id"].as_str().unwrap());
    let falls = format!("{path}/snowfalls");
    let (replayed, first) = once(&server, &falls, &fall).await;
    assert!(!replayed);
    let fallen = server.get(&format!("{path}/mass")).await["fallen"].clone();
    server.kill().await;

    // Eleven minutes, a day, and back again to before the change.
    for ahead in [660, 86_400, -86_400] {
        let server = start(&shim, &data, ahead).await;
        let later = server.post("/v1/sessions", small()).await;
        let made = later["created_at"].as_str().unwrap().to_owned();
        let before = session["created_at"].as_str().unwrap().to_owned();
        assert_eq!(made > before, ahead > 0, "the clock is set: {before}, {made}");
        let (replayed, again) = once(&server, &falls, &fall).await;
        assert!(replayed, "it was carried out again, with the clock ahead by {ahead} s");
        assert_eq!(again, first);
        assert_eq!(server.get(&format!("{path}/mass")).await["fallen"], fallen);
        server.kill().await;
    }
}

/// A store whose clock goes on from some time, whatever is stored of it.
#[derive(Debug)]
struct Clocked {
    store: RedbStore,
    from: Duration,
    /// When requests with a key were done \[ms\].
    done_at: Arc<Mutex<Vec<u64>>>,
}

impl Store for Clocked {
    fn load(&mut self) -> Result<Loaded, StoreError> {
        let clock = StoreClock::going_on_from(self.from);
        Ok(Loaded { clock, ..self.store.load()? })
    }

    fn commit(&mut self, writes: &[Write]) -> Result<(), StoreError> {
        for write in writes {
            if let Write::Put(Row { kind: Kind::Answer, .. }, content) = write {
                let done: Value = serde_json::from_slice(content).unwrap();
                self.done_at.lock().unwrap().push(done["at_ms"].as_u64().unwrap());
            }
        }
        self.store.commit(writes)
    }
}

/// Without the clock's row, which a damaged file may have lost, it would begin at 0, and what is done
/// then would only be forgotten after what was done before.
#[tokio::test(flavor = "multi_thread")]
async fn a_clock_that_was_lost_goes_on_from_what_is_stored() {
    let data = tempfile::tempdir().unwrap();
    let done_at = Arc::<Mutex<Vec<u64>>>::default();
    let mut path = String::new();
    for (from, key) in [(Duration::from_secs(1000), "first"), (Duration::ZERO, "second")] {
        let store = RedbStore::in_directory(data.path()).unwrap();
        let store = Box::new(Clocked { store, from, done_at: done_at.clone() });
        let checkpoint_interval = Duration::from_secs(3600);
        let durability = Durability { store, checkpoint_interval, accept_loss: false };
        let server = Server::start_stored(BackendChoice::Cpu, Options::default(), durability).await;
        if path.is_empty() {
            path = server.create(small()).await;
        }
        let headers = [("content-type", "application/json"), ("idempotency-key", key)];
        let fall = json!({"depth": 0.1}).to_string().into_bytes();
        let falls = format!("{path}/snowfalls");
        server.send(Method::POST, &falls, &headers, fall).await.expect(200);
        server.stop().await;
    }
    let done_at = done_at.lock().unwrap();
    assert!(done_at.len() == 2 && done_at.is_sorted() && done_at[0] >= 1_000_000, "{done_at:?}");
}
