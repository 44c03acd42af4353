//! Streams that were cut off by a restart: what they are told is never a guess.

use std::time::Duration;

use firn::config::BackendChoice;
use firn::driver::Fault;
use serde_json::{Value, json};

use crate::client::Client;
use crate::disk::Disk;
use crate::on_each_backend;
use crate::script::session;
use crate::support::wait::until;
use crate::support::{Options, Server};

on_each_backend!(
    seqs_go_on_above_what_was_published,
    a_clean_stop_is_not_noticed_by_who_resumes,
    who_resumes_is_told_what_has_changed_whatever_happened,
);

async fn start(backend: BackendChoice, disk: &Disk, interval: Duration) -> Server {
    Server::start_stored(backend, Options::default(), disk.durability(interval)).await
}

/// What a client is told first that resumes somewhere.
async fn resume(server: &Server, path: &str, epoch: &Value, seq: u64) -> Value {
    let mut stream = Client::open(server, path).await;
    let resume = json!({"epoch": epoch, "seq": seq});
    stream.send(json!({"op": "subscribe", "id": 1, "resume": resume})).await;
    stream.told(1).await
}

fn fall(x: f64) -> Value {
    json!({"depth": 0.1, "region": {"x": x, "z": 0.0, "width": 1.0, "depth": 1.0}})
}

fn places(told: &Value) -> Vec<u64> {
    let tiles = told["tiles"].as_array().unwrap();
    let mut places: Vec<u64> = tiles.iter().map(|t| t["column_x"].as_u64().unwrap()).collect();
    places.sort_unstable();
    places.dedup();
    places
}

async fn seqs_go_on_above_what_was_published(backend: BackendChoice) {
    // Whether there are checkpoints in between makes no difference to what is true.
    for interval in [Duration::from_millis(1), Duration::from_secs(3600)] {
        let disk = Disk::default();
        let server = start(backend, &disk, interval).await;
        let path = server.create(session("a")).await;
        let epoch = server.get(&path).await.expect(200)["epoch"].clone();
        let mut seqs = Vec::new();
        for x in [0.0, 1.7, 3.3, 0.0] {
            let answer = server.post(&format!("{path}/snowfalls"), fall(x)).await.expect(200);
            seqs.push(answer["seq"].as_u64().unwrap());
            // What is written by itself is written meanwhile, which nothing tells.
            server.beats(42).await;
        }
        // Snow falls and is cleared again: the heights are as before, but some saw others.
        let all = json!({"depth": 3.9, "region": {"x": 3.3, "z": 0, "width": 1, "depth": 1}});
        server.post(&format!("{path}/snowfalls"), fall(3.3)).await.expect(200);
        let cleared = server.post(&format!("{path}/clearings"), all).await.expect(200);
        let last = cleared["seq"].as_u64().unwrap();

        let server_after = start(backend, &disk.cut(1), interval).await;
        let there = server_after.get(&format!("{path}/heights")).await.expect(200);
        let now = there["seq"].as_u64().unwrap();
        assert!(now > last, "{now} after {last}");
        for (nth, &seq) in seqs.iter().chain([&last]).enumerate() {
            let told = resume(&server_after, &path, &epoch, seq).await;
            assert_eq!(told["recovered"], true, "seq {seq} was durable: {told}");
            // At least what has changed since is told.
            let later: &[u64] = [&[0, 8, 16][..], &[0, 16], &[0, 16], &[16], &[]][nth];
            let told = places(&told);
            assert!(later.iter().all(|x| told.contains(x)), "{told:?} after seq {seq}");
        }
        for unknown in [now + 1, now - 1, last + 1000] {
            let told = resume(&server_after, &path, &epoch, unknown).await;
            assert_eq!((&told["recovered"], &told["op"]), (&json!(false), &json!("snapshot")));
            assert_eq!(places(&told), [0, 8, 16], "seq {unknown}");
        }
        let told = resume(&server_after, &path, &json!("other"), last).await;
        assert_eq!(told["recovered"], false);
        let more = server_after.post(&format!("{path}/snowfalls"), fall(0.0)).await.expect(200);
        let more = more["seq"].as_u64().unwrap();
        assert!(more > now);

        // A second cut: what was lost in the first stays lost, what was durable stays known.
        server_after.stop().await;
        server.stop().await;
    }
}

async fn a_clean_stop_is_not_noticed_by_who_resumes(backend: BackendChoice) {
    let disk = Disk::default();
    let interval = Duration::from_secs(3600);
    let server = start(backend, &disk, interval).await;
    let path = server.create(session("a")).await;
    server.post(&format!("{path}/snowfalls"), fall(0.0)).await.expect(200);
    let session = server.get(&path).await.expect(200);
    let seq = session["seq"].as_u64().unwrap();
    server.stop().await;
    let server = start(backend, &disk, interval).await;
    let told = resume(&server, &path, &session["epoch"], seq).await;
    assert_eq!((&told["recovered"], &told["tiles"]), (&json!(true), &json!([])), "{told}");
    let now = server.get(&path).await.expect(200)["seq"].as_u64().unwrap();
    assert!(now >= seq, "{now} after {seq}");
    let told = resume(&server, &path, &session["epoch"], seq + 1000).await;
    assert_eq!(told["recovered"], false);
    server.stop().await;
}

/// What happens between two streams.
#[derive(Clone, Copy, Debug)]
enum Break {
    Crash,
    CleanStop,
    Hibernation,
    LostDevice,
}

/// The same for both kinds of messages: a state that was told before is known after it, and no tile is told
/// that has not changed since.
async fn who_resumes_is_told_what_has_changed_whatever_happened(backend: BackendChoice) {
    for kind in [Break::Crash, Break::CleanStop, Break::Hibernation, Break::LostDevice] {
        let disk = Disk::default();
        let interval = Duration::from_secs(3600);
        let mut server = start(backend, &disk, interval).await;
        let path = server.create(session("a")).await;
        server.post(&format!("{path}/snowfalls"), fall(0.0)).await.expect(200);
        let view = server.get(&path).await.expect(200);
        let (epoch, seq) = (view["epoch"].clone(), view["seq"].as_u64().unwrap());
        let falls = format!("{path}/snowfalls");
        let later = server.post(&falls, fall(1.7)).await.expect(200)["seq"].as_u64().unwrap();
        match kind {
            Break::Crash => {
                // It goes on, and what it does is lost.
                let twin = start(backend, &disk.cut(1), interval).await;
                server.stop().await;
                server = twin;
            }
            Break::CleanStop => {
                server.stop().await;
                server = start(backend, &disk, interval).await;
            }
            Break::Hibernation => {
                server.patch(&path, json!({"idle_timeout_s": 1})).await.expect(200);
                let asleep = async || server.sessions.vitals().hibernating() == 1;
                until("it hibernates", asleep).await;
            }
            Break::LostDevice => {
                server.sessions.sabotage(Fault::LoseDevice).await;
                server.get_once_back(&format!("{path}/mass")).await;
            }
        }
        let now = server.get(&path).await.expect(200);
        let same = now["epoch"] == epoch;
        assert_eq!(same, matches!(kind, Break::Hibernation | Break::LostDevice), "{kind:?}");
        for protocol in ["firn.v1.json", "firn.v1.bin"] {
            for (seq, tiles) in [(seq, &[8][..]), (later, &[])] {
                let mut stream = Client::open_as(&server, &path, protocol).await;
                let resume = json!({"epoch": epoch, "seq": seq});
                stream.send(json!({"op": "subscribe", "id": 1, "resume": resume})).await;
                let told = stream.told(1).await;
                assert_eq!(told["recovered"], true, "{kind:?}, {protocol}: {told}");
                let there = places(&told);
                // After a crash what is gone through again is told again.
                let same = matches!(kind, Break::Crash) || there == tiles;
                assert!(same && tiles.iter().all(|x| there.contains(x)), "{kind:?}: {told}");
            }
            let mut stream = Client::open_as(&server, &path, protocol).await;
            let resume = json!({"epoch": epoch, "seq": later + 1_000_000});
            stream.send(json!({"op": "subscribe", "id": 1, "resume": resume})).await;
            let told = stream.told(1).await;
            assert_eq!((&told["recovered"], &told["op"]), (&json!(false), &json!("snapshot")));
        }
        server.stop().await;
    }
}

/// A server that goes on, and a backup of it that is put back, have different pasts from then on.
#[tokio::test(flavor = "multi_thread")]
async fn a_backup_knows_nothing_of_what_came_after_it() {
    let disk = Disk::default();
    let interval = Duration::from_secs(3600);
    let server = start(BackendChoice::Cpu, &disk, interval).await;
    let path = server.create(session("a")).await;
    let epoch = server.get(&path).await.expect(200)["epoch"].clone();
    server.stop().await;
    let backup = disk.cut(1);
    let mut ends = Vec::new();
    for disk in [&disk, &backup] {
        let server = start(BackendChoice::Cpu, disk, interval).await;
        for _ in 0..5 {
            server.post(&format!("{path}/snowfalls"), fall(0.0)).await.expect(200);
        }
        ends.push((server.get(&path).await.expect(200)["seq"].as_u64().unwrap(), server));
    }
    for (seen, there) in [(0, 1), (1, 0)] {
        let (seq, server) = (ends[seen].0, &ends[there].1);
        let told = resume(server, &path, &epoch, seq).await;
        assert_eq!(told["recovered"], false, "seq {seq} was another server's: {told}");
    }
    for (_, server) in ends {
        server.stop().await;
    }
}
