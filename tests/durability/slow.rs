//! A disk that is slower than everything else: much is committed together, and what belongs together
//! must be told apart.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use firn::config::BackendChoice;
use reqwest::{Client, Method};
use serde_json::{Value, json};
use tokio::task::JoinHandle;

use crate::disk::Disk;
use crate::process::send;
use crate::support::wait::until;
use crate::support::{Options, Server, small};

/// Time that a sync takes.
const SYNC: Duration = Duration::from_millis(60);

async fn start(disk: &Disk) -> Server {
    disk.slow_down(SYNC);
    let durability = disk.durability(Duration::from_millis(100));
    Server::start_stored(BackendChoice::Cpu, Options::default(), durability).await
}

/// Has snow fall on a session until it is over, or the session is gone; counts how often.
fn snow(
    server: &Server,
    path: &str,
    over: &Arc<AtomicBool>,
    falls: &Arc<AtomicUsize>,
) -> JoinHandle<()> {
    let (url, path) = (server.url.clone(), format!("{path}/snowfalls"));
    let (over, falls) = (over.clone(), falls.clone());
    tokio::spawn(async move {
        let client = Client::new();
        while !over.load(Ordering::Relaxed) {
            let fall = json!({"depth": 0.001});
            let answered = send(&client, &url, Method::POST, &path, Some(&fall)).await;
            let (status, answer) = answered.expect("it answers");
            match status {
                200 => falls.fetch_add(1, Ordering::Relaxed),
                404 | 503 => return,
                _ => panic!("{status}: {answer}"),
            };
        }
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn checkpoints_are_made_while_changes_never_cease() {
    let disk = Disk::default();
    let server = start(&disk).await;
    let path = server.create(small()).await;
    let (over, falls) = (Arc::default(), Arc::default());
    let clients: Vec<_> = (0..16).map(|_| snow(&server, &path, &over, &falls)).collect();
    until("there are checkpoints", async || {
        assert!(falls.load(Ordering::Relaxed) < 10_000, "no checkpoints beside so many changes");
        server.sessions.vitals().store.checkpoints() >= 3
    })
    .await;
    over.store(true, Ordering::Relaxed);
    for client in clients {
        client.await.unwrap();
    }
    let mass = server.get(&format!("{path}/mass")).await.expect(200);
    // Before a clean stop would save everything once more.
    let cut = disk.cut(1);
    server.stop().await;
    let server = start(&cut).await;
    let back = server.get(&format!("{path}/mass")).await.expect(200);
    assert_eq!(back["fallen"], mass["fallen"]);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_is_left_of_what_was_deleted() {
    let disk = Disk::default();
    let server = start(&disk).await;
    let mut clients = Vec::new();
    for i in 0..12 {
        let mut body = small();
        // Running ones are marked all the time.
        body["paused"] = Value::Bool(i % 2 == 0);
        let path = server.create(body).await;
        let (over, falls) = (Arc::default(), Arc::default());
        for _ in 0..4 {
            clients.push(snow(&server, &path, &over, &falls));
        }
        until("snow falls", async || falls.load(Ordering::Relaxed) >= 4).await;
        assert_eq!(server.delete(&path).await.status, 204);
    }
    for client in clients {
        client.await.unwrap();
    }
    let kept = server.create(small()).await;
    server.stop().await;
    let server = start(&disk.cut(2)).await;
    assert_eq!(server.sessions.vitals().store.lost_sessions(), 0, "rows without a session");
    assert_eq!(server.get(&kept).await.status, 200);
    assert_eq!(server.sessions.count(), 1);
    server.stop().await;
}
