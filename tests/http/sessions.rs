//! The life of sessions over HTTP.

use std::time::Instant;

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::wait::until;
use crate::support::{Options, Server, small};

on_each_backend!(
    snow_that_has_stopped_falling_is_settled_again,
    a_session_that_nobody_wants_is_deleted,
    a_session_is_created_read_and_deleted,
    names_are_the_clients_or_the_servers,
    sessions_are_listed_in_pages,
    settings_change_and_others_stay,
    a_pause_takes_no_ticks,
    a_reset_leads_back_to_the_beginning,
    totals_of_the_server_are_kept,
    full_device_memory_refuses_and_nothing_more,
);

/// Snow deep enough to settle under its own weight.
pub fn deep() -> Value {
    let mut spec = small();
    spec["initial_snow"] = json!([{"depth": 3.5}]);
    spec
}

async fn a_pause_takes_no_ticks(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let session = server.create(small()).await;
    // Time passes in which no ticks may be taken.
    server.beats(60).await;
    let running = Instant::now();
    let on = server.patch(&session, json!({"paused": false})).await.expect(200);
    let ticks = on["tick"].as_u64().unwrap() as f64;
    let most = running.elapsed().as_secs_f64() * 60.0 + 1.0;
    assert!(ticks <= most, "{ticks} ticks, of which at most {most:.0} fell after the pause");
    server.stop().await;
}

async fn a_session_is_created_read_and_deleted(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let created = server.send(reqwest::Method::POST, "/v1/sessions", &[], Vec::new()).await;
    let session = created.expect(201);
    let path = format!("/v1/sessions/{}", session["id"].as_str().unwrap());
    assert_eq!(created.header("location"), path);
    for secret in ["token", "viewer_token"] {
        assert!(session[secret].as_str().unwrap().len() >= 32, "{secret}");
    }
    assert_ne!(session["token"], session["viewer_token"]);
    assert_eq!(session["grid"], json!({"width": 50, "depth": 50, "height": 50, "cell_size": 0.2}));
    assert_eq!(session["material"]["hardness_law"], "calibrated");
    assert_eq!(session["material"]["load_distribution"], "two_to_one");
    assert_eq!(session["state"], "running");
    assert_eq!(session["terrain"], false);
    assert_eq!(session["idle_timeout_s"], Value::Null);
    assert_eq!(session["stream_url"], format!("{path}/stream"));
    assert_eq!(session["summary"]["tiles"], 49);
    assert_eq!(session["summary"]["mean_density"], 0.0);
    assert!(session.get("initial_snow").is_none());

    let read = server.get(&path).await.expect(200);
    assert!(read.get("token").is_none(), "tokens are told once");
    assert_eq!((&read["epoch"], &read["id"]), (&session["epoch"], &session["id"]));
    assert!(read["created_at"].as_str().unwrap().ends_with('Z'));

    assert_eq!(server.delete(&path).await.status, 204);
    server.get(&path).await.problem(404);
    server.delete(&path).await.problem(404);
    server.stop().await;
}

async fn names_are_the_clients_or_the_servers(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let named = json!({"id": "alp-7_A", "grid": {"width": 1, "depth": 1}, "paused": true});
    let first = server.post("/v1/sessions", named.clone()).await.expect(201);
    assert_eq!(first["id"], "alp-7_A");
    let again = server.post("/v1/sessions", named.clone()).await;
    assert!(again.problem(409)["detail"].as_str().unwrap().contains("alp-7_A"));
    assert_eq!(server.delete("/v1/sessions/alp-7_A").await.status, 204);
    let second = server.post("/v1/sessions", named).await.expect(201);
    assert_ne!(first["epoch"], second["epoch"], "a new life of the name");
    for wrong in ["", "a b", "ä", "a/b", &"x".repeat(65)] {
        let reply = server.post("/v1/sessions", json!({ "id": wrong })).await;
        assert_eq!(reply.pointers(422), ["/id"], "{wrong:?}");
    }
    server.stop().await;
}

async fn sessions_are_listed_in_pages(backend: BackendChoice) {
    let server = Server::start(backend).await;
    assert_eq!(
        server.get("/v1/sessions").await.expect(200),
        json!({"items": [], "next_cursor": null})
    );
    for id in ["c", "a", "e", "b", "d"] {
        let grid = json!({"width": 2, "depth": 2, "height": 2});
        server.create(json!({"id": id, "grid": grid, "paused": true})).await;
    }
    let mut found = Vec::new();
    let mut path = "/v1/sessions?limit=2".to_owned();
    let mut pages = 0;
    loop {
        let page = server.get(&path).await.expect(200);
        let items = page["items"].as_array().unwrap();
        found.extend(items.iter().map(|item| item["id"].as_str().unwrap().to_owned()));
        pages += 1;
        let Some(cursor) = page["next_cursor"].as_str() else { break };
        path = format!("/v1/sessions?limit=2&cursor={cursor}");
    }
    assert_eq!((found.join(""), pages), ("abcde".to_owned(), 3));
    let all = server.get("/v1/sessions?limit=5").await.expect(200);
    assert_eq!(all["next_cursor"], Value::Null);
    for (query, pointer) in
        [("limit=0", "limit"), ("limit=1001", "limit"), ("limit=ten", "limit"), ("size=2", "size")]
    {
        let reply = server.get(&format!("/v1/sessions?{query}")).await;
        assert_eq!(reply.pointers(422), [pointer]);
    }
    server.stop().await;
}

async fn settings_change_and_others_stay(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let before = server.get(&path).await.expect(200);
    let patch = json!({"air_temperature": -7.5, "idle_timeout_s": 600, "stiffness_exponent": 4});
    let after = server.patch(&path, patch).await.expect(200);
    assert_eq!(after["air_temperature"], -7.5);
    assert_eq!(after["idle_timeout_s"], 600.0);
    assert_eq!(after["material"]["stiffness_exponent"], 4.0);
    for field in ["time_scale", "tick_rate", "paused", "snowfall_rate", "delete_after_s", "epoch"] {
        assert_eq!(after[field], before[field], "{field}");
    }
    assert!(after["seq"].as_u64() > before["seq"].as_u64(), "a change has a seq");
    let back = server.patch(&path, json!({"idle_timeout_s": null})).await.expect(200);
    assert_eq!(back["idle_timeout_s"], Value::Null);
    assert_eq!(back["air_temperature"], -7.5);
    assert_eq!(back["pressing"], "creep");
    for pressing in [json!(0.25), json!("creep"), json!(0.0), json!(10.0)] {
        let view = server.patch(&path, json!({ "pressing": pressing })).await.expect(200);
        assert_eq!(view["pressing"], pressing);
        assert_eq!(server.get(&path).await.expect(200)["pressing"], pressing);
    }

    let running = server.patch(&path, json!({"paused": false})).await.expect(200);
    assert_eq!(running["state"], "running");
    // It runs by itself now: the tick grows sooner or later.
    let tick = running["tick"].as_u64().unwrap();
    while server.get(&path).await.expect(200)["tick"].as_u64().unwrap() <= tick {
        tokio::task::yield_now().await;
    }
    server.stop().await;
}

async fn a_session_that_nobody_wants_is_deleted(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut spec = small();
    spec["delete_after_s"] = json!(1);
    let forsaken = server.create(spec.clone()).await;
    let wanted = server.create(spec).await;
    let name = wanted.rsplit('/').next().unwrap();
    let held = server.sessions.get(name).unwrap();
    // Looks through the list, which is no request for a session.
    let listed = || async {
        let page = server.get("/v1/sessions").await.expect(200);
        page["items"].as_array().unwrap().len()
    };
    until("one of them is deleted", async || listed().await <= 1).await;
    server.get(&forsaken).await.problem(404);
    assert!(!held.gone().is_cancelled(), "whoever holds a session wants it");
    drop(held);
    server.get(&wanted).await.expect(200);
    server.stop().await;
}

async fn a_reset_leads_back_to_the_beginning(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let before = server.get(&path).await.expect(200);
    let heights = server.heights(&path).await;
    assert_eq!(heights, vec![1.0; 70]);
    let collider = json!({"mass": 50, "shape": {"type": "disk", "radius": 0.3},
        "position": {"x": 1, "z": 0.7}});
    server.post(&format!("{path}/colliders"), collider).await.expect(201);
    server.post(&format!("{path}/snowfalls"), json!({"depth": 0.5})).await.expect(200);
    server.patch(&path, json!({"tick_rate": 30, "stiffness_exponent": 5})).await.expect(200);
    server.step(&path, 60).await;
    assert_ne!(server.heights(&path).await, heights);

    let nothing = server.post(&format!("{path}/reset"), Value::Null).await;
    assert_eq!(nothing.pointers(422), [""], "null is no object");
    let after = server.post(&format!("{path}/reset"), json!({})).await.expect(200);
    assert_eq!(server.heights(&path).await, heights);
    assert!(after["seq"].as_u64() > before["seq"].as_u64(), "seqs go on");
    for field in ["epoch", "tick", "sim_time", "tick_rate", "material", "paused"] {
        assert_eq!(after[field], before[field], "{field}");
    }
    assert_eq!(after["summary"]["colliders"], 0);
    let mass = server.get(&format!("{path}/mass")).await.expect(200);
    assert_eq!(mass["imbalance_quanta"], 0);
    assert!((mass["fallen"].as_f64().unwrap() - 20.0 * 2.8).abs() < 0.01, "{mass}");
    server.stop().await;
}

async fn totals_of_the_server_are_kept(backend: BackendChoice) {
    let mut options = Options::default();
    options.limits.sessions = 2;
    // Of whole tiles: 10 × 10 columns lie in 16 × 16.
    options.limits.cells = 256 * 30;
    options.limits.cells_per_session = 256 * 20;
    options.limits.columns_per_session = 512;
    let server = Server::start_with(backend, options).await;
    let cells = |id: &str, height: u32| json!({"id": id, "grid": {"width": 10, "depth": 10, "height": height}, "paused": true});
    let reply = server.post("/v1/sessions", cells("a", 21)).await;
    assert_eq!(reply.pointers(422), ["/grid"]);
    assert!(reply.json()["detail"].as_str().unwrap().contains("5120"), "the limit is named");
    // One cell high, it would take 64 times what it says.
    let thin = json!({"grid": {"width": 65, "depth": 1, "height": 1}});
    let reply = server.post("/v1/sessions", thin).await;
    assert_eq!(reply.pointers(422), ["/grid"]);
    assert!(reply.json()["detail"].as_str().unwrap().contains("512"), "the limit is named");
    let endless = json!({"grid": {"width": u32::MAX, "depth": u32::MAX, "height": 255}});
    assert_eq!(server.post("/v1/sessions", endless).await.pointers(422), ["/grid", "/grid"]);

    server.create(cells("a", 20)).await;
    let full = server.post("/v1/sessions", cells("b", 11)).await;
    full.problem(429);
    assert!(full.header("retry-after").parse::<u32>().unwrap() > 0);
    server.create(cells("b", 10)).await;
    let full = server.post("/v1/sessions", cells("c", 1)).await;
    full.problem(429);
    let ready = server.get("/readyz").await.expect(200);
    assert_eq!((&ready["sessions"], &ready["schedulable"]), (&json!(2), &json!(false)));
    assert_eq!(server.delete("/v1/sessions/a").await.status, 204);
    server.create(cells("c", 20)).await;
    server.stop().await;
}

async fn full_device_memory_refuses_and_nothing_more(backend: BackendChoice) {
    let options = Options { device_memory: Some(256 << 20), ..Options::default() };
    let server = Server::start_with(backend, options).await;
    let path = server.create(small()).await;
    let grid = json!({"width": 1000, "depth": 1000, "height": 100, "cell_size": 0.2});
    let reply = server.post("/v1/sessions", json!({"id": "big", "grid": grid})).await;
    reply.problem(507);
    server.get("/v1/sessions/big").await.problem(404);
    assert_eq!(server.get("/v1/sessions").await.expect(200)["items"].as_array().unwrap().len(), 1);
    assert_eq!(server.step(&path, 10).await["tick"], 10, "the others live on");
    server.create(json!({"id": "big", "grid": {"width": 9}, "paused": true})).await;
    server.stop().await;
}

async fn snow_that_has_stopped_falling_is_settled_again(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(deep()).await;
    let until = json!({"until_settled": true, "max_seconds": 3600});
    server.post(&format!("{path}/step"), until.clone()).await.expect(200);
    let settled = |session: Value| session["settled"].as_bool().unwrap();
    let snowing = server.patch(&path, json!({"snowfall_rate": 0.01})).await.expect(200);
    assert!(!settled(snowing), "while snow falls it is not");
    assert!(settled(server.patch(&path, json!({"snowfall_rate": 0})).await.expect(200)));
    let stepped = server.post(&format!("{path}/step"), until).await.expect(200);
    assert!(settled(stepped));
    server.stop().await;
}
