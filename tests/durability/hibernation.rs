//! Sessions that nobody asks for free their memory, and wake as they were.

use std::time::{Duration, Instant};

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::client::Client;
use crate::disk::Disk;
use crate::on_each_backend;
use crate::script::session;
use crate::support::wait::until;
use crate::support::{Options, Server};

on_each_backend!(
    a_session_that_nobody_wants_hibernates,
    a_session_that_somebody_watches_stays_awake,
    a_session_that_hibernates_is_deleted_in_the_end,
    a_session_that_hibernates_keeps_its_restore_points,
);

async fn servers(backend: BackendChoice) -> [Server; 2] {
    let durability = Disk::default().durability(Duration::from_secs(60));
    [
        Server::start(backend).await,
        Server::start_stored(backend, Options::default(), durability).await,
    ]
}

fn tired(id: &str) -> Value {
    let mut body = session(id);
    body["idle_timeout_s"] = json!(1);
    body
}

/// A session's entry in the list, which does not count as a request for it.
async fn listed(server: &Server, id: &str) -> Value {
    let list = server.get("/v1/sessions").await.expect(200);
    let items = list["items"].as_array().unwrap();
    items.iter().find(|item| item["id"] == id).cloned().unwrap_or_default()
}

async fn until_hibernating(server: &Server, id: &str) -> Value {
    until("it hibernates", async || listed(server, id).await["state"] == "hibernating").await;
    listed(server, id).await
}

async fn a_session_that_nobody_wants_hibernates(backend: BackendChoice) {
    for server in servers(backend).await {
        let empty = server.sessions.vitals().memory();
        let path = server.create(tired("bear")).await;
        server.create(tired("live")).await;
        server.step(&path, 100).await;
        server.patch("/v1/sessions/live", json!({"paused": false})).await.expect(200);
        let before = server.get(&format!("{path}/digest")).await.expect(200);
        let heights = server.get(&format!("{path}/heights")).await.expect(200);
        let epoch = server.get(&path).await.expect(200)["epoch"].clone();
        let asleep = until_hibernating(&server, "live").await;
        until_hibernating(&server, "bear").await;
        assert_eq!(server.sessions.vitals().memory(), empty, "all memory is free");
        assert_eq!(server.sessions.vitals().hibernating(), 2);

        // Time stands still.
        server.beats(20).await;
        assert_eq!(listed(&server, "live").await["tick"], asleep["tick"]);
        let woken = server.get("/v1/sessions/live/mass").await.expect(200);
        assert!(woken["tick"].as_u64().unwrap() < asleep["tick"].as_u64().unwrap() + 20);
        assert_eq!(woken["imbalance_quanta"], 0);

        // Whoever resumes where it fell asleep has missed nothing.
        let mut stream = Client::open(&server, &path).await;
        let resume = json!({"epoch": epoch, "seq": heights["seq"]});
        stream.send(json!({"op": "subscribe", "id": 1, "resume": resume})).await;
        let first = stream.told(1).await;
        assert_eq!((&first["recovered"], &first["tiles"]), (&json!(true), &json!([])));
        drop(stream);
        let after = server.get(&format!("{path}/digest")).await.expect(200);
        assert_eq!(after["digest"], before["digest"]);
        assert!(after["seq"].as_u64() >= before["seq"].as_u64());
        assert_ne!(listed(&server, "bear").await["state"], "hibernating");

        // It does so again, and is as alive as ever afterwards.
        until_hibernating(&server, "bear").await;
        let fallen = server.post(&format!("{path}/snowfalls"), json!({"depth": 0.1})).await;
        fallen.expect(200);
        server.step(&path, 10).await;
        server.stop().await;
    }
}

async fn a_session_that_somebody_watches_stays_awake(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(tired("watched")).await;
    let mut stream = Client::open(&server, &path).await;
    stream.send(json!({"op": "subscribe", "id": 1})).await;
    stream.heights_of(1).await;
    server.beats(150).await;
    assert_eq!(listed(&server, "watched").await["state"], "paused");
    drop(stream);
    until_hibernating(&server, "watched").await;
    // It is not idle before its time has passed since the last one left, less a frame or two.
    let visit = server.sessions.get("watched").unwrap();
    server.beats(150).await;
    assert_eq!(listed(&server, "watched").await["state"], "paused");
    let left = Instant::now();
    drop(visit);
    until_hibernating(&server, "watched").await;
    assert!(left.elapsed() > Duration::from_millis(900), "after {:?}", left.elapsed());
    server.stop().await;
}

async fn a_session_that_hibernates_is_deleted_in_the_end(backend: BackendChoice) {
    for server in servers(backend).await {
        let mut body = tired("gone");
        body["delete_after_s"] = json!(3);
        server.create(body).await;
        until_hibernating(&server, "gone").await;
        until("it is deleted", async || listed(&server, "gone").await == Value::Null).await;
        server.get("/v1/sessions/gone").await.problem(404);
        server.stop().await;
    }
}

async fn a_session_that_hibernates_keeps_its_restore_points(backend: BackendChoice) {
    for server in servers(backend).await {
        let path = server.create(tired("bear")).await;
        let points = format!("{path}/checkpoints");
        server.put(&format!("{points}/spring"), json!(null)).await.expect(201);
        server.step(&path, 50).await;
        until_hibernating(&server, "bear").await;
        let listed_points = server.get(&points).await.expect(200);
        assert_eq!(listed_points["items"][0]["name"], "spring");
        assert_eq!(listed(&server, "bear").await["state"], "hibernating", "it sleeps on");
        let kept = server.put(&format!("{points}/winter"), json!(null)).await.expect(201);
        assert_eq!(kept["tick"], 50);
        until_hibernating(&server, "bear").await;
        server.delete(&format!("{points}/winter")).await.expect(204);
        let spring = json!({"checkpoint": "spring"});
        let back = server.post(&format!("{path}/reset"), spring).await.expect(200);
        assert_eq!((&back["tick"], &back["state"]), (&json!(0), &json!("paused")));
        server.stop().await;
    }
}
