//! What comes back after the server was stopped, cleanly or not.

use std::time::Duration;

use firn::config::BackendChoice;
use reqwest::Method;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::process::Process;
use crate::script::{Step, history, session};
use crate::support::wait::until;

on_each_backend!(
    a_session_that_came_back_equals_its_twin,
    a_live_session_comes_back_to_a_state_of_its_own_past,
    what_lived_through_a_kill_equals_a_twin_that_was_stepped,
    changes_in_the_frames_of_ticks_come_back_where_they_were,
    a_clean_stop_loses_nothing_at_all,
    changes_beside_long_ticks_come_back_where_they_were,
);

fn name(backend: BackendChoice) -> &'static str {
    if backend == BackendChoice::Cpu { "cpu" } else { "gpu" }
}

async fn carry_out(server: &Process, id: &str, steps: &[Step]) {
    for (method, path, body) in steps {
        let path = format!("/v1/sessions/{id}{path}");
        let answered = server.send(method.clone(), &path, Some(body)).await;
        let (status, answer) = answered.expect("it answers");
        assert!((200..300).contains(&status), "{path} {body}: {answer}");
    }
}

async fn digest(server: &Process, id: &str) -> (Value, Value) {
    let answer = server.get(&format!("/v1/sessions/{id}/digest")).await;
    (answer["digest"].clone(), answer["tick"].clone())
}

/// Kills the server again and again in the middle of a history.
async fn a_session_that_came_back_equals_its_twin(backend: BackendChoice) {
    let (ours, theirs) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    // Checkpoints lie anywhere, or nowhere.
    for (seed, interval) in [(1, "50ms"), (2, "1h")] {
        let options = ["--backend", name(backend), "--checkpoint-interval", interval];
        let id = &format!("twin-{seed}");
        let twin = Process::ready(theirs.path(), &["--backend", name(backend)]).await;
        twin.post("/v1/sessions", session(id)).await;
        let mut server = Process::ready(ours.path(), &options).await;
        let created = server.post("/v1/sessions", session(id)).await;
        for steps in history(seed, 60).chunks(15) {
            carry_out(&twin, id, steps).await;
            carry_out(&server, id, steps).await;
            server.kill().await;
            server = Process::ready(ours.path(), &options).await;
            assert_eq!(digest(&server, id).await, digest(&twin, id).await, "seed {seed}");
        }
        let back = server.get(&format!("/v1/sessions/{id}")).await;
        for field in ["id", "created_at"] {
            assert_eq!(back[field], created[field]);
        }
        assert_ne!(back["epoch"], created["epoch"], "each start begins another one");
        // A reset leads to the same beginning in both.
        for process in [&twin, &server] {
            carry_out(process, id, &[(Method::POST, "/reset".to_owned(), json!({}))]).await;
            carry_out(process, id, &history(seed + 10, 5)).await;
        }
        server.kill().await;
        let server = Process::ready(ours.path(), &options).await;
        assert_eq!(digest(&server, id).await, digest(&twin, id).await);
        server.kill().await;
        twin.kill().await;
    }
}

/// What a live session was at the tick that it comes back at, a twin is at that tick too.
async fn a_live_session_comes_back_to_a_state_of_its_own_past(backend: BackendChoice) {
    let data = tempfile::tempdir().unwrap();
    let options = ["--backend", name(backend), "--checkpoint-interval", "300ms"];
    let server = Process::ready(data.path(), &options).await;
    server.post("/v1/sessions", session("live")).await;
    let running = json!({"paused": false});
    server.send(Method::PATCH, "/v1/sessions/live", Some(&running)).await.unwrap();
    until("it has lived through checkpoints", async || {
        server.metric("firn_store_checkpoints_total").await >= 4.0
            && server.get("/v1/sessions/live").await["tick"].as_u64() >= Some(75)
    })
    .await;
    let before = server.get("/v1/sessions/live").await;
    server.kill().await;

    let server = Process::ready(data.path(), &options).await;
    let paused = json!({"paused": true});
    server.send(Method::PATCH, "/v1/sessions/live", Some(&paused)).await.unwrap();
    let after = server.get("/v1/sessions/live").await;
    let (then, now) = (before["tick"].as_u64().unwrap(), after["tick"].as_u64().unwrap());
    assert!(now + 45 >= then, "back at tick {now}, was at {then} at 45 Hz");
    let (ours, _) = digest(&server, "live").await;
    server.post("/v1/sessions", session("twin")).await;
    server.post("/v1/sessions/twin/step", json!({ "ticks": now })).await;
    assert_eq!(digest(&server, "twin").await.0, ours);
    server.kill().await;
}

/// Objects on snow that settles, and on snow that falls by itself, with a change in a pause.
/// The frames of such a session are cut wherever a beat or the kill comes, those of its twin are long.
async fn what_lived_through_a_kill_equals_a_twin_that_was_stepped(backend: BackendChoice) {
    let data = tempfile::tempdir().unwrap();
    let options = ["--backend", name(backend), "--checkpoint-interval", "300ms"];
    let spec = |id: &str, i: usize| {
        let mut spec = session(id);
        spec["tick_rate"] = json!([60, 45, 13][i % 3]);
        spec["snowfall_rate"] = json!([60, 0, 3, 100][i % 4]);
        if i % 4 == 2 {
            // Large enough to have its snow in two bands.
            spec["grid"]["depth"] = json!(400);
        }
        spec
    };
    let paused = |paused: bool| (Method::PATCH, String::new(), json!({ "paused": paused }));
    let put = async |server: &Process, id: &str, i: usize, object: &str| {
        let path = format!("/v1/sessions/{id}/colliders/{object}");
        let body = json!({"mass": 3 + 12 * i, "position": {"x": 2, "z": 1.8},
            "shape": {"type": "disk", "radius": 0.5}});
        let answered = server.send(Method::PUT, &path, Some(&body)).await;
        answered.expect("it answers").1["tick"].as_u64().expect("a tick")
    };
    // Waits until each has gone through some ticks since a certain one.
    let lived = async |server: &Process, since: &[u64]| {
        for (i, since) in since.iter().enumerate() {
            let path = format!("/v1/sessions/live-{i}");
            until("ticks pass", async || {
                server.get(&path).await["tick"].as_u64() >= Some(since + 9)
            })
            .await;
        }
    };
    let sessions = 0..12;
    let server = Process::ready(data.path(), &options).await;
    for i in sessions.clone() {
        let id = &format!("live-{i}");
        server.post("/v1/sessions", spec(id, i)).await;
        put(&server, id, i, "crate").await;
        carry_out(&server, id, &[paused(false)]).await;
    }
    lived(&server, &[0; 12]).await;
    let mut changed = Vec::new();
    for i in sessions.clone() {
        let id = &format!("live-{i}");
        // A change to a session whose time goes on is answered once its frame has gone on as well.
        carry_out(&server, id, &[paused(true)]).await;
        changed.push(put(&server, id, i, "sledge").await);
        carry_out(&server, id, &[paused(false)]).await;
    }
    lived(&server, &changed).await;
    server.kill().await;

    let server = Process::ready(data.path(), &options).await;
    for (i, changed) in sessions.zip(changed) {
        let (live, twin) = (&format!("live-{i}"), &format!("twin-{i}"));
        carry_out(&server, live, &[paused(true)]).await;
        let (ours, tick) = digest(&server, live).await;
        let now = tick.as_u64().expect("a tick");
        let step = |ticks: u64| (Method::POST, "/step".to_owned(), json!({ "ticks": ticks }));
        server.post("/v1/sessions", spec(twin, i)).await;
        put(&server, twin, i, "crate").await;
        carry_out(&server, twin, &[step(changed)]).await;
        put(&server, twin, i, "sledge").await;
        carry_out(&server, twin, &[step(now - changed)]).await;
        assert_eq!(digest(&server, twin).await.0, ours, "session {i} at tick {now}");
    }
    server.kill().await;
}

/// Changes to sessions whose time goes on: it stands still only when they are compared.
async fn changes_in_the_frames_of_ticks_come_back_where_they_were(backend: BackendChoice) {
    let data = tempfile::tempdir().unwrap();
    for interval in ["1h", "50ms"] {
        let options = ["--backend", name(backend), "--checkpoint-interval", interval];
        let mut server = Process::ready(data.path(), &options).await;
        let ids: Vec<String> = (0..6).map(|i| format!("busy-{i}-{interval}")).collect();
        for (i, id) in ids.iter().enumerate() {
            let mut spec = session(id);
            spec["paused"] = json!(false);
            spec["snowfall_rate"] = json!([0, 30][i % 2]);
            server.post("/v1/sessions", spec).await;
        }
        let histories: Vec<_> = (20..26).map(|seed| history(seed, 30)).collect();
        for at in 0..30 {
            for (id, steps) in ids.iter().zip(&histories) {
                // None that wants a pause.
                let (method, path, body) = &steps[at];
                if !path.contains("step") && !path.contains("reset") {
                    carry_out(&server, id, &[(method.clone(), path.clone(), body.clone())]).await;
                }
            }
        }
        let mut before = Vec::new();
        for id in &ids {
            let pause = (Method::PATCH, String::new(), json!({"paused": true}));
            carry_out(&server, id, &[pause]).await;
            before.push(digest(&server, id).await);
        }
        server.kill().await;
        server = Process::ready(data.path(), &options).await;
        for (id, before) in ids.iter().zip(before) {
            assert_eq!(digest(&server, id).await, before, "{id}");
        }
        server.kill().await;
    }
}

async fn a_clean_stop_loses_nothing_at_all(backend: BackendChoice) {
    let data = tempfile::tempdir().unwrap();
    let options = ["--backend", name(backend)];
    let server = Process::ready(data.path(), &options).await;
    let id = "kept";
    server.post("/v1/sessions", session(id)).await;
    carry_out(&server, id, &history(5, 40)).await;
    let mut live = session("live");
    live["paused"] = json!(false);
    server.post("/v1/sessions", live).await;
    let paths = ["", "/colliders", "/heights", "/digest", "/mass"];
    let read = async |server: &Process| {
        let mut answers = Vec::new();
        for path in paths {
            answers.push(server.get(&format!("/v1/sessions/{id}{path}")).await);
        }
        answers
    };
    let mut before = read(&server).await;
    let tick = server.get("/v1/sessions/live").await["tick"].as_u64().unwrap();
    server.terminate();
    let (success, log) = server.ended().await;
    assert!(success, "{log:#?}");

    let server = Process::ready(data.path(), &options).await;
    let mut after = read(&server).await;
    for answers in [&mut before, &mut after] {
        // Which tiles are awake is looked into anew, and that nothing moved is published.
        answers[0]["summary"]["active_tiles"] = Value::Null;
        answers.iter_mut().for_each(|answer| answer["seq"] = Value::Null);
        // Each start begins another one.
        answers[0]["epoch"] = Value::Null;
    }
    assert_eq!(after, before);
    assert!(server.get("/v1/sessions/live").await["tick"].as_u64().unwrap() >= tick);
    server.kill().await;
}

/// Changes arrive before, in and after ticks of thousands of cycles, with checkpoints in between.
async fn changes_beside_long_ticks_come_back_where_they_were(backend: BackendChoice) {
    let data = tempfile::tempdir().unwrap();
    for interval in ["1h", "20ms"] {
        let options = ["--backend", name(backend), "--checkpoint-interval", interval];
        let mut server = Process::ready(data.path(), &options).await;
        let id = &format!("long-{interval}");
        let long = json!({"id": id, "paused": true, "tick_rate": 1, "time_scale": 200,
            "grid": {"width": 24, "depth": 24, "height": 20, "cell_size": 0.2},
            "initial_snow": [{"depth": 2.0}]});
        server.post("/v1/sessions", long).await;
        let path = format!("/v1/sessions/{id}");
        let sledge = json!({"mass": 200, "position": {"x": 2.4, "z": 2.4},
            "shape": {"type": "box", "width": 2.0, "depth": 2.0}});
        server.send(Method::PUT, &format!("{path}/colliders/sledge"), Some(&sledge)).await;
        for round in 0..3 {
            let (snowfalls, step) = (format!("{path}/snowfalls"), format!("{path}/step"));
            let crate_at = format!("{path}/colliders/crate-{round}");
            let crate_ = json!({"mass": 50, "position": {"x": 1.0, "z": 1.0 + 0.5 * f64::from(round)},
                "shape": {"type": "disk", "radius": 0.3}});
            let (fall, ticks) = (json!({"depth": 0.15}), json!({"ticks": 1}));
            let later = async |milliseconds, method, path: &str, body: &Value| {
                tokio::time::sleep(Duration::from_millis(milliseconds)).await;
                server.send(method, path, Some(body)).await.expect("it answers").0
            };
            let answers = tokio::join!(
                later(0, Method::POST, &snowfalls, &fall),
                later(0, Method::POST, &step, &ticks),
                later(4, Method::POST, &snowfalls, &fall),
                later(6, Method::PUT, &crate_at, &crate_),
                later(8, Method::POST, &snowfalls, &fall),
            );
            assert_eq!(answers, (200, 200, 200, 201, 200));
            let before = digest(&server, id).await;
            server.kill().await;
            server = Process::ready(data.path(), &options).await;
            assert_eq!(digest(&server, id).await, before, "round {round}, {interval}");
            let mass = server.get(&format!("{path}/mass")).await;
            assert_eq!(mass["imbalance_quanta"], 0, "round {round}, {interval}");
        }
        server.kill().await;
    }
}
