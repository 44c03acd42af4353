//! A store is verified and compacted, beside a running server and without one; and `firn store` does it.

use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use firn::config::{AccessConfig, ApiKey, BackendChoice};
use firn::driver::Durability;
use firn::store::{RedbStore, Row, Store, Write};
use reqwest::Method;
use serde_json::{Value, json};
use tokio::process::Command;

use crate::backup::{CPU, FILE, are_there, fatten, files, prepare};
use crate::process::Process;
use crate::support::{Options, Server};

const OPERATOR: &str = "the-key-of-the-operator";
const ADMIN: &str = "the-key-of-alpine-that-administers";
const WRITER: &str = "the-key-of-alpine-that-writes";

/// The calls about the store.
const CALLS: [(Method, &str); 3] = [
    (Method::POST, "/v1/store/verify"),
    (Method::POST, "/v1/store/compact"),
    (Method::GET, "/v1/store/backup"),
];

/// Runs `firn store`; returns whether it succeeded, and all that it said.
async fn firn_store(arguments: &[&str], key: Option<&str>) -> (bool, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_firn"));
    command.arg("store").args(arguments).stdin(Stdio::null());
    for name in ["FIRN_API_KEY", "FIRN_API_KEY_FILE", "FIRN_DATA_DIR"] {
        command.env_remove(name);
    }
    if let Some(key) = key {
        command.env("FIRN_API_KEY", key);
    }
    let output = command.output().await.unwrap();
    let said = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    (output.status.success(), said.concat())
}

/// Flips a bit in every copy of a session's checkpoint that is in the file.
fn damage_checkpoint(data: &Path, session: u64) {
    let path = data.join(FILE);
    let mut bytes = fs::read(&path).unwrap();
    let name = [b"FIRNROW2", &session.to_be_bytes()[..], &[3]].concat();
    let found: Vec<usize> =
        (0..bytes.len() - 256).filter(|&at| bytes[at..].starts_with(&name)).collect();
    assert!(!found.is_empty(), "there is a checkpoint");
    found.iter().for_each(|at| bytes[at + 200] ^= 1);
    // In place: the server has the file open.
    use std::io::Write;
    fs::OpenOptions::new().write(true).open(path).unwrap().write_all(&bytes).unwrap();
}

/// A directory with sessions that all have a checkpoint.
async fn stopped() -> (tempfile::TempDir, Vec<(String, Value)>) {
    let data = tempfile::tempdir().unwrap();
    let server = Process::ready(data.path(), &CPU).await;
    let digests = prepare(&server, 3).await;
    server.terminate();
    assert!(server.ended().await.0);
    (data, digests)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flipped_bit_is_found_and_the_session_is_named() {
    let (data, digests) = stopped().await;
    let directory = data.path().to_str().unwrap();
    let verify = ["verify", "--data-dir", directory];
    let (sound, said) = firn_store(&verify, None).await;
    assert!(sound && said.contains("brought back: 3"), "{said}");

    // Beside a server, whose memory holds the row as it was.
    let server = Process::ready(data.path(), &CPU).await;
    let found = server.post("/v1/store/verify", Value::Null).await;
    assert_eq!((&found["sound"], &found["sessions"]), (&json!(true), &json!(3)), "{found}");
    let (bytes, length) = (found["bytes"].as_u64().unwrap(), found["file_bytes"].as_u64().unwrap());
    assert!(found["rows"].as_u64().unwrap() > 20 && 1000 < bytes && bytes < length, "{found}");
    damage_checkpoint(data.path(), 1);
    let found = server.post("/v1/store/verify", Value::Null).await;
    let damage = found["damage"].to_string();
    assert_eq!(found["sound"], false, "{found}");
    assert!(damage.contains("'s1'") && damage.contains("Checkpoint"), "{found}");
    assert!(!damage.contains("'s0'") && !damage.contains("'s2'"), "{found}");
    let (sound, said) = firn_store(&["verify", "--server", &server.url], None).await;
    assert!(!sound && said.contains("'s1'"), "{said}");
    are_there(&server, &digests).await;
    server.kill().await;

    // Without one.
    let (sound, said) = firn_store(&verify, None).await;
    assert!(!sound && said.contains("the session 's1'"), "{said}");
    assert!(said.contains("brought back: 2"), "{said}");
    let backup = data.path().join("copy");
    let backup = ["backup", "--data-dir", directory, "--output", backup.to_str().unwrap()];
    let (done, said) = firn_store(&backup, None).await;
    assert!(!done && said.contains("is damaged"), "{said}");
    assert_eq!(files(data.path()), [FILE], "nothing is left of the attempt");
}

#[tokio::test(flavor = "multi_thread")]
async fn compaction_shrinks_the_file_and_keeps_everything() {
    for running in [true, false] {
        let (data, digests) = stopped().await;
        let path = data.path().join(FILE);
        let length = || fs::metadata(&path).unwrap().len();
        // What stays lies all over the file, so that closing it does not give the rest back.
        let rows = fatten(data.path(), 20);
        let (stay, go): (Vec<Row>, Vec<Row>) = rows.iter().partition(|row| row.number % 5 == 4);
        let mut store = RedbStore::in_directory(data.path()).unwrap();
        let kept = store.load().unwrap().rows;
        store.commit(&go.into_iter().map(Write::Remove).collect::<Vec<_>>()).unwrap();
        drop(store);
        let server = if running { Some(Process::ready(data.path(), &CPU).await) } else { None };
        let before = length();
        let (done, said) = match &server {
            Some(server) => firn_store(&["compact", "--server", &server.url], None).await,
            None => {
                firn_store(&["compact", "--data-dir", data.path().to_str().unwrap()], None).await
            }
        };
        assert!(done && said.contains("the file had"), "{said}");
        assert!(length() * 2 < before, "{before} bytes, and {} after: {said}", length());
        if let Some(server) = server {
            are_there(&server, &digests).await;
            server.post("/v1/sessions/s0/snowfalls", json!({"depth": 0.1})).await;
            let found = server.post("/v1/store/verify", Value::Null).await;
            assert_eq!(found["sound"], true, "{found}");
            server.kill().await;
        }
        let server = Process::ready(data.path(), &CPU).await;
        are_there(&server, &digests[1..]).await;
        assert_eq!(server.get("/readyz").await["store"], "sound");
        server.kill().await;
        let rows = RedbStore::in_directory(data.path()).unwrap().load().unwrap().rows;
        assert!(stay.iter().all(|row| rows[row] == kept[row]));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn only_an_administrator_reaches_the_store() {
    let data = tempfile::tempdir().unwrap();
    let keys = tempfile::NamedTempFile::new().unwrap();
    let entry = |key: &str, scopes: &str| {
        format!("[[tenants.alpine.keys]]\nkey = \"{key}\"\nscopes = [{scopes}]\n")
    };
    let entries = entry(ADMIN, "\"admin\"") + &entry(WRITER, "\"read\", \"write\"");
    fs::write(keys.path(), entries).unwrap();
    let access = AccessConfig {
        api_key: Some(ApiKey::from(OPERATOR)),
        api_keys_file: Some(keys.path().to_owned()),
        ..AccessConfig::default()
    };
    let store = Box::new(RedbStore::in_directory(data.path()).unwrap());
    let checkpoint_interval = Duration::from_secs(3600);
    let durability = Durability { store, checkpoint_interval, accept_loss: false };
    let options = Options { access, ..Options::default() };
    let server = Server::start_stored(BackendChoice::Cpu, options, durability).await;
    for (method, path) in CALLS {
        server.send(method.clone(), path, &[], Vec::new()).await.problem(401);
        let refused = server.send_as(WRITER, method.clone(), path, &Value::Null).await;
        let problem = refused.problem(403);
        assert!(problem["detail"].as_str().unwrap().contains("`admin`"), "{path}: {problem}");
        for key in [ADMIN, OPERATOR] {
            let reply = server.send_as(key, method.clone(), path, &Value::Null).await;
            assert_eq!(reply.status, 200, "{path}: {:?}", String::from_utf8_lossy(&reply.body));
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_keeps_nothing_has_no_store() {
    let server = Server::start(BackendChoice::Cpu).await;
    for (method, path) in CALLS {
        let problem = server.send(method, path, &[], Vec::new()).await.problem(409);
        assert!(problem["detail"].as_str().unwrap().contains("no store"), "{problem}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_program_backs_up_a_running_server_and_a_stopped_directory() {
    let (data, digests) = stopped().await;
    let copies = tempfile::tempdir().unwrap();
    let place = |name: &str| {
        let directory = copies.path().join(name);
        fs::create_dir(&directory).unwrap();
        directory.join(FILE).to_str().unwrap().to_owned()
    };
    let (stopped, running) = (place("stopped"), place("running"));
    let directory = ["--data-dir", data.path().to_str().unwrap()];
    let backup = |to: &[&str], output: &str| {
        let all = [&["backup", "--output", output], to].concat();
        all.into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    let run = async |arguments: Vec<String>, key| {
        firn_store(&arguments.iter().map(|a| &**a).collect::<Vec<_>>(), key).await
    };
    let (done, said) = run(backup(&directory, &stopped), None).await;
    assert!(done, "{said}");

    let key = tempfile::NamedTempFile::new().unwrap();
    fs::write(key.path(), OPERATOR).unwrap();
    let key = key.path().to_str().unwrap();
    let options = ["--backend", "cpu", "--api-key-file", key];
    let server = Process::start(data.path(), &options).await;
    server.recover().await;
    let url = ["--server", &*server.url];
    let (done, said) = run(backup(&url, &running), None).await;
    assert!(!done && said.contains("401") && said.contains("FIRN_API_KEY"), "{said}");
    let (done, said) = run(backup(&url, &running), Some(OPERATOR)).await;
    assert!(done, "{said}");
    // Over no file, whatever it is.
    let (done, said) = run(backup(&url, &running), Some(OPERATOR)).await;
    assert!(!done && said.contains("is there already"), "{said}");
    let with_file = [&url[..], &["--api-key-file", key]].concat();
    let (done, said) = run(backup(&with_file, &format!("{running}.2")), None).await;
    assert!(done, "{said}");
    // Another process can't have the directory meanwhile.
    for command in ["backup", "verify", "compact", "check"] {
        let output = format!("{running}.3");
        let mut arguments = [&[command], &directory[..]].concat();
        if command == "backup" {
            arguments.extend(["--output", &output]);
        }
        let (done, said) = firn_store(&arguments, None).await;
        assert!(!done && said.contains("a running server uses"), "{command}: {said}");
        assert!(said.contains("--server"), "{command}: {said}");
    }
    server.kill().await;
    assert_eq!(files(&copies.path().join("running")), [FILE, "firn.redb.2"]);
    assert_eq!(files(&copies.path().join("stopped")), [FILE]);
    for name in ["stopped", "running"] {
        let twin = Process::ready(&copies.path().join(name), &CPU).await;
        are_there(&twin, &digests).await;
        twin.kill().await;
    }
}
