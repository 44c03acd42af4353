//! Stores of another format: that of Firn 0.1 is taken over, an older program does not touch what is newer,
//! and this one does not touch what it doesn't know.
//!
//! `first-format.redb.zst` is the store of a server of Firn 0.1 that was killed: sessions that were changed in
//! all ways, that were reset, made from a snapshot, deleted, that hibernate, and that are at rest.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use firn::store::{Format, Kind, RedbStore, Row, Store, Write};
use redb::{Database, TableDefinition};
use reqwest::{Client, Method};
use serde_json::{Value, json};

use crate::client::{Client as Stream, request_to};
use crate::disk::Disk;
use crate::process::Process;

const FIRST_FORMAT: &[u8] = include_bytes!("first-format.redb.zst");

/// What the server of Firn 0.1 told before it was killed: ticks, seqs, epochs, and masses fallen and present.
const TOLD: [(&str, u64, u64, &str, [f64; 2]); 4] = [
    ("changes", 100, 28, "01M8PGRWYCP7789CQWGE8MSQX3", [78.78399169921876, 63.157551879882824]),
    ("reset", 15, 6, "01M8PGRWZEAY43B3KCS8DP715Z", [69.12000000000002, 69.12000000000002]),
    ("restored", 105, 5, "01M8PGRX00C32ZK694W9DY01DG", [84.67199340820314, 69.04555358886721]),
    ("asleep", 12, 3, "01M8PGRX0ENHXXP5PJP4KQCVZ0", [80.64000000000001, 80.64000000000001]),
];

/// Hash of the session whose cells are stored as they were, in the present version of snapshots.
const ASLEEP: &str = "e92baca3779c9b4cb08aa2cac98d32913b200d318a9ba1a6428fa07b62f0a914";

/// A data directory of Firn 0.1.
fn first_format() -> tempfile::TempDir {
    let data = tempfile::tempdir().unwrap();
    let bytes = zstd::decode_all(FIRST_FORMAT).unwrap();
    fs::write(data.path().join("firn.redb"), bytes).unwrap();
    data
}

/// What `firn store check` says, and whether all is well.
fn check(data: &Path) -> (String, bool) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_firn"));
    let output = command.args(["store", "check", "--data-dir"]).arg(data).output().unwrap();
    let said = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    (said.concat(), output.status.success())
}

fn files(data: &Path) -> Vec<PathBuf> {
    fs::read_dir(data).unwrap().map(|entry| entry.unwrap().path()).collect()
}

/// A request with the key that one had in the other server.
async fn repeat(server: &Process) -> (bool, Value) {
    let url = format!("{}/v1/sessions/changes/snowfalls", server.url);
    let request = Client::new().request(Method::POST, url).header("idempotency-key", "kept");
    let request = request.header("content-type", "application/json");
    let answer = request.body(r#"{"depth": 0.05}"#).send().await.unwrap();
    let replayed = answer.headers().contains_key("idempotent-replayed");
    (replayed, answer.json().await.unwrap())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_store_of_the_first_format_is_taken_over_with_all_that_is_in_it() {
    let data = first_format();
    for _ in 0..2 {
        let (said, sound) = check(data.path());
        assert!(sound && said.starts_with("format 1"), "{said}");
        assert!(said.contains("'reset': tick 15") && said.contains("brought back: 5"), "{said}");
    }
    assert_eq!(files(data.path()).len(), 1, "it has changed nothing");

    let server = Process::ready(data.path(), &["--backend", "cpu"]).await;
    for (id, tick, seq, epoch, [fallen, present]) in TOLD {
        let path = format!("/v1/sessions/{id}");
        let mass = server.get(&format!("{path}/mass")).await;
        assert_eq!([&mass["fallen"], &mass["present"]], [&json!(fallen), &json!(present)], "{id}");
        let session = server.get(&path).await;
        assert_eq!(session["tick"], tick, "{id}");
        assert!(session["seq"].as_u64().unwrap() > seq && session["epoch"] != epoch, "{session}");
        // Streams go on from where they were.
        for (seq, recovered) in [(seq, true), (seq + 1, false)] {
            let mut stream = Stream::begin(request_to(&server.url, &path, "firn.v1.json")).await;
            assert_eq!(stream.next().await["op"], "welcome");
            let resume = json!({"epoch": epoch, "seq": seq});
            stream.send(json!({"op": "subscribe", "id": 1, "resume": resume})).await;
            assert_eq!(stream.told(1).await["recovered"], recovered, "{id} at {seq}");
        }
    }
    assert_eq!(server.get("/v1/sessions/asleep/digest").await["digest"], ASLEEP);
    let colliders = server.get("/v1/sessions/changes/colliders").await;
    let ids: Vec<&Value> =
        colliders["items"].as_array().unwrap().iter().map(|it| &it["id"]).collect();
    assert_eq!(ids, ["boot", "sledge"]);
    let changes = server.get("/v1/sessions/changes").await;
    let settings = ["air_temperature", "snowfall_rate", "tick_rate", "time_scale"];
    assert_eq!(settings.map(|name| &changes[name]), [-9.0, 3.0, 45.0, 20.0]);
    assert_eq!(changes["material"]["stiffness_exponent"], 4.5);
    assert_eq!(changes["pressing"], "creep", "there was nothing else then");
    let (replayed, again) = repeat(&server).await;
    assert!(replayed && again["tick"] == 90 && again["seq"] == 25, "{again}");
    assert!(server.get("/v1/sessions/running").await["tick"].as_u64().unwrap() >= 100);
    equals_its_twin(&server).await;
    server.kill().await;

    // The old file is kept, and the new one is one like all others.
    let kept =
        files(data.path()).into_iter().filter(|path| path.to_string_lossy().contains("format-1"));
    assert_eq!(kept.count(), 1);
    let (said, sound) = check(data.path());
    assert!(sound && said.starts_with("format 2") && said.contains("'reset': tick 15"), "{said}");
    let server = Process::ready(data.path(), &["--backend", "cpu"]).await;
    assert_eq!(server.get("/v1/sessions/asleep/digest").await["digest"], ASLEEP);
    let (status, _) = server.send(Method::GET, "/v1/sessions/gone", None).await.unwrap();
    assert_eq!(status, 404, "what was deleted stays deleted");
    assert!(repeat(&server).await.0);
    server.kill().await;
}

/// What came out of entries of the first format equals what the same requests make now.
async fn equals_its_twin(server: &Process) {
    let grid = json!({"width": 9, "depth": 8, "height": 20, "cell_size": 0.2});
    let spec =
        json!({"id": "twin", "grid": grid, "paused": true, "initial_snow": [{"depth": 1.0}]});
    server.post("/v1/sessions", spec).await;
    let air = json!({"celsius": -20});
    let path = "/v1/sessions/twin";
    server.send(Method::PUT, &format!("{path}/air-temperature"), Some(&air)).await.unwrap();
    server.post(&format!("{path}/snowfalls"), json!({"depth": 0.2})).await;
    server.post(&format!("{path}/step"), json!({"ticks": 15})).await;
    let ours = server.get("/v1/sessions/reset/digest").await;
    assert_eq!(ours["digest"], server.get(&format!("{path}/digest")).await["digest"]);
}

/// Firn 0.1 opens this table before any other.
#[test]
fn an_older_program_is_told_that_it_is_too_old() {
    let data = tempfile::tempdir().unwrap();
    let mut store = RedbStore::in_directory(data.path()).unwrap();
    assert_eq!(store.load().unwrap().format, Format::Present);
    store.commit(&[]).unwrap();
    drop(store);
    let database = Database::open(data.path().join("firn.redb")).unwrap();
    let rows: TableDefinition<&[u8], &[u8]> = TableDefinition::new("rows");
    let transaction = database.begin_write().unwrap();
    let refused = transaction.open_table(rows).map(drop).unwrap_err().to_string();
    assert!(refused.contains("needs Firn 0.2 or later"), "{refused}");
}

#[test]
fn a_newer_store_is_not_touched() {
    let disk = Disk::default();
    let store = || disk.durability(std::time::Duration::from_secs(60)).store;
    let format = Row { session: u64::MAX, kind: Kind::Format, number: 0 };
    let mut newer = store();
    newer.load().unwrap();
    newer.commit(&[Write::Put(format, 3u32.to_le_bytes().to_vec())]).unwrap();
    drop(newer);
    let refused = store().load().unwrap_err().to_string();
    assert!(refused.contains("format 3") && refused.contains("up to 2"), "{refused}");
}

#[test]
fn a_directory_without_a_store_is_not_made_one() {
    let data = tempfile::tempdir().unwrap();
    let (said, sound) = check(data.path());
    assert!(!sound && said.contains("no store in"), "{said}");
    assert!(files(data.path()).is_empty());
}
