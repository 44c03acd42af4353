//! Files that are cut short, and files in which bits have flipped.

use std::fs;
use std::path::Path;
use std::time::Duration;

use firn::config::BackendChoice;
use firn::driver::Durability;
use firn::store::RedbStore;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use serde_json::{Value, json};

use crate::process::Process;
use crate::script::{history, session};
use crate::support::{Options, Server};

const SESSIONS: usize = 12;
const FILE: &str = "firn.redb";

async fn start(data: &Path) -> Server {
    let store = Box::new(RedbStore::in_directory(data).expect("the server starts all the same"));
    let durability =
        Durability { store, checkpoint_interval: Duration::from_secs(3600), accept_loss: true };
    Server::start_stored(BackendChoice::Cpu, Options::default(), durability).await
}

/// Sessions with a history, some of them with a checkpoint; returns the digests of all states that
/// each has been in, the last one last.
async fn prepare(data: &Path) -> Vec<Vec<Value>> {
    let mut server = start(data).await;
    let mut digests = vec![Vec::new(); SESSIONS];
    for (i, digests) in digests.iter_mut().enumerate() {
        let path = server.create(session(&format!("s{i}"))).await;
        for (method, at, body) in history(i as u64, 12) {
            let (at, body) = (format!("{path}{at}"), body.to_string().into_bytes());
            let headers = [("content-type", "application/json")];
            assert!(server.send(method, &at, &headers, body).await.status < 300);
            let digest = server.get(&format!("{path}/digest")).await.expect(200);
            digests.push(digest["digest"].clone());
        }
        if i == SESSIONS / 2 {
            server.stop().await;
            server = start(data).await;
        }
    }
    fs::copy(data.join(FILE), data.join("crashed")).unwrap();
    server.stop().await;
    digests
}

/// Starts a server on a damaged file; returns how many sessions came back as they were, and how
/// many in an earlier state. None is torn.
async fn back(bytes: &[u8], digests: &[Vec<Value>]) -> (usize, usize) {
    let data = tempfile::tempdir().unwrap();
    fs::write(data.path().join(FILE), bytes).unwrap();
    let server = start(data.path()).await;
    let (mut count, mut earlier) = (0, 0);
    for (i, digest) in digests.iter().enumerate() {
        let reply = server.get(&format!("/v1/sessions/s{i}/digest")).await;
        if reply.status != 200 {
            reply.problem(404);
        } else if reply.json()["digest"] == *digest.last().unwrap() {
            count += 1;
        } else {
            assert!(digest.contains(&reply.json()["digest"]), "s{i} is in no state it was in");
            earlier += 1;
        }
    }
    // Whatever happened, it goes on from here.
    let path = server.create(json!({"paused": true})).await;
    server.post(&format!("{path}/snowfalls"), json!({"depth": 1})).await.expect(200);
    server.stop().await;
    (count, earlier)
}

#[tokio::test(flavor = "multi_thread")]
async fn flipped_bits_cost_no_more_than_the_sessions_they_hit() {
    let data = tempfile::tempdir().unwrap();
    let digests = prepare(data.path()).await;
    let mut dice = SmallRng::seed_from_u64(1);
    let mut hit = 0;
    for file in [FILE, "crashed"] {
        let good = fs::read(data.path().join(file)).unwrap();
        assert_eq!(back(&good, &digests).await, (SESSIONS, 0));
        // Where something is written; most of the file is not.
        let used: Vec<usize> = (0..good.len()).filter(|&at| good[at] != 0).collect();
        for _ in 0..25 {
            let mut bad = good.clone();
            bad[used[dice.random_range(0..used.len())]] ^= 1 << dice.random_range(0..8);
            let (there, earlier) = back(&bad, &digests).await;
            assert_eq!(earlier, 0, "a session is whole or not there");
            assert!(there + 1 >= SESSIONS, "{there} of {SESSIONS} sessions after one flipped bit");
            hit += usize::from(there < SESSIONS);
        }
    }
    assert!(hit > 0, "no bit hit anything: the test shows nothing");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_file_cut_short_gives_back_what_is_whole_in_it() {
    let data = tempfile::tempdir().unwrap();
    let digests = prepare(data.path()).await;
    let good = fs::read(data.path().join(FILE)).unwrap();
    let last = good.iter().rposition(|&byte| byte != 0).unwrap();
    for length in [0, 10, 320, 4096, last / 4, last / 2, last, good.len() - 1] {
        let (there, earlier) = back(&good[..length], &digests).await;
        println!("{there} sessions, {earlier} of the past, in {length} of {} bytes", good.len());
        assert!(length < last || there == SESSIONS, "all is there but the end, which is empty");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_lost_is_named_and_what_is_damaged_is_kept() {
    let data = tempfile::tempdir().unwrap();
    prepare(data.path()).await;
    let path = data.path().join(FILE);
    let mut bytes = fs::read(&path).unwrap();
    // The newest checkpoint of a session: a row's frame, its name, the zstd frame within.
    let name = |i: u64| [b"FIRNROW2", &i.to_be_bytes()[..], &[3]].concat();
    let wanted = name(4);
    let found: Vec<usize> =
        (0..bytes.len() - 32).filter(|&at| bytes[at..].starts_with(&wanted)).collect();
    assert!(!found.is_empty());
    found.iter().for_each(|at| bytes[at + 200] ^= 1);
    fs::write(&path, &bytes).unwrap();
    let mut server = Process::ready(data.path(), &["--backend", "cpu"]).await;
    let (status, _) =
        server.send(reqwest::Method::GET, "/v1/sessions/s4", None).await.expect("it answers");
    assert_eq!(status, 404);
    server.get("/v1/sessions/s5").await;
    let line = server.read.iter().find(|line| line.contains("'s4'"));
    let line = match line {
        Some(line) => line.clone(),
        None => server.wait_for("'s4'").await,
    };
    assert!(line.contains("can't be brought back"), "{line}");
    let kept = fs::read_dir(data.path()).unwrap().filter_map(Result::ok);
    let kept: Vec<_> =
        kept.filter(|e| e.file_name().to_string_lossy().contains("damaged")).collect();
    assert_eq!(kept.len(), 1);
    assert_eq!(fs::read(kept[0].path()).unwrap(), bytes);
    server.kill().await;
}
