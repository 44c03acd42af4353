//! Restore points, and resets to them and to snapshots.

use firn::config::BackendChoice;
use reqwest::Method;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::{Server, small};

on_each_backend!(
    a_session_goes_back_to_what_is_kept,
    there_are_no_more_restore_points_than_may_be,
    a_session_becomes_what_a_snapshot_holds,
    a_snapshot_of_another_grid_is_refused,
    a_snapshot_brings_its_ground_along,
);

const SNAPSHOT: &str = "application/vnd.firn.snapshot";

async fn digest(server: &Server, path: &str) -> Value {
    server.get(&format!("{path}/digest")).await.expect(200)["digest"].clone()
}

async fn snapshot(server: &Server, path: &str) -> Vec<u8> {
    server.get(&format!("{path}/snapshot")).await.body
}

/// A session with a history and an object.
async fn eventful(server: &Server) -> String {
    let path = server.create(small()).await;
    server.step(&path, 50).await;
    let object = json!({"mass": 70, "shape": {"type": "disk", "radius": 0.3},
        "position": {"x": 1.1, "z": 0.7}});
    server.put(&format!("{path}/colliders/a"), object).await.expect(201);
    server.patch(&path, json!({"snowfall_rate": 2, "stiffness_exponent": 3.4})).await.expect(200);
    server.step(&path, 61).await;
    path
}

async fn a_session_goes_back_to_what_is_kept(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = eventful(&server).await;
    let points = format!("{path}/checkpoints");
    let point = format!("{points}/before");
    let reset = format!("{path}/reset");
    assert_eq!(server.get(&points).await.expect(200), json!({"items": []}));
    server.get(&point).await.problem(404);
    server.delete(&point).await.problem(404);
    server.post(&reset, json!({"checkpoint": "before"})).await.problem(404);

    let before = digest(&server, &path).await;
    let created = server.put(&point, json!(null)).await;
    assert_eq!(created.header("location"), point);
    let kept = created.expect(201);
    assert_eq!((&kept["name"], &kept["tick"]), (&json!("before"), &json!(111)));
    assert!((kept["sim_time"].as_f64().unwrap() - 111.0 / 60.0).abs() < 1e-9);
    assert_eq!(server.get(&point).await.expect(200), kept);
    assert_eq!(server.get(&points).await.expect(200)["items"], json!([kept]));
    let bytes = server.get_as(&point, SNAPSHOT).await;
    assert_eq!((bytes.status, bytes.header("content-type")), (200, SNAPSHOT));
    assert_eq!(kept["bytes"], bytes.body.len());
    assert_eq!(bytes.body, snapshot(&server, &path).await);
    server.get_as(&point, "image/png").await.problem(406);
    let held = server.get(&format!("{path}/usage")).await.expect(200)["memory_bytes"]["journal"]
        .as_u64()
        .unwrap();
    assert!(held >= kept["bytes"].as_u64().unwrap(), "nothing else keeps it: {held}");

    // What it becomes next is the same each time.
    let mut after = Value::Null;
    for _ in 0..2 {
        server.post(&format!("{path}/snowfalls"), json!({"depth": 0.4})).await.expect(200);
        server.delete(&format!("{path}/colliders/a")).await;
        server.step(&path, 70).await;
        let now = digest(&server, &path).await;
        assert!(after == Value::Null || after == now);
        after = now;
        let seq = server.get(&path).await.expect(200)["seq"].as_u64();
        let back = server.post(&reset, json!({"checkpoint": "before"})).await.expect(200);
        assert_eq!((&back["tick"], &back["summary"]["colliders"]), (&json!(111), &json!(1)));
        assert!(back["seq"].as_u64() > seq, "seqs go on");
        assert_eq!(digest(&server, &path).await, before);
    }
    let mass = server.get(&format!("{path}/mass")).await.expect(200);
    assert_eq!(mass["imbalance_quanta"], 0);

    server.step(&path, 9).await;
    let replaced = server.put(&point, json!(null)).await.expect(200);
    assert_eq!(replaced["tick"], 120);
    server.post(&reset, json!({})).await.expect(200);
    assert_eq!(server.get(&points).await.expect(200)["items"], json!([replaced]), "resets keep it");
    let back = server.post(&reset, json!({"checkpoint": "before"})).await.expect(200);
    assert_eq!(back["tick"], 120);
    server.delete(&point).await.expect(204);
    server.get(&point).await.problem(404);
    server.post(&reset, json!({"checkpoint": "before"})).await.problem(404);
    let wrong = server.post(&reset, json!({"restore_point": "before"})).await;
    assert_eq!(wrong.pointers(422), ["/restore_point"]);
    server.stop().await;
}

async fn there_are_no_more_restore_points_than_may_be(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let point = |name: &str| format!("{path}/checkpoints/{name}");
    for number in (0..16).rev() {
        server.put(&point(&format!("p{number:02}")), json!(null)).await.expect(201);
    }
    let refused = server.put(&point("more"), json!(null)).await.problem(409);
    assert!(refused["detail"].as_str().unwrap().contains("delete one"), "{refused}");
    server.put(&point("p07"), json!(null)).await.expect(200);
    server.delete(&point("p03")).await.expect(204);
    server.put(&point("more"), json!(null)).await.expect(201);
    let listed = server.get(&format!("{path}/checkpoints")).await.expect(200);
    let names = listed["items"].as_array().unwrap().iter().map(|item| item["name"].as_str());
    let names: Vec<_> = names.map(Option::unwrap).collect();
    assert_eq!((names.len(), names[0], names[15]), (16, "more", "p15"));
    assert_eq!(server.put(&point("a.b"), json!(null)).await.pointers(422), ["name"]);

    // Another session has none of them.
    let other = server.create(small()).await;
    assert_eq!(server.get(&format!("{other}/checkpoints")).await.expect(200)["items"], json!([]));
    server.stop().await;
}

async fn a_session_becomes_what_a_snapshot_holds(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let source = eventful(&server).await;
    let bytes = snapshot(&server, &source).await;
    let mut body = small();
    body["id"] = json!("target");
    body["material"] = json!({"fresh_density": 60, "max_density": 450});
    let created = server.post("/v1/sessions", body).await.expect(201);
    let (path, token) = ("/v1/sessions/target", created["token"].as_str().unwrap());
    server.post(&format!("{path}/snowfalls"), json!({"depth": 0.2})).await.expect(200);

    let reset = format!("{path}/reset");
    let view = server.post_bytes(&reset, SNAPSHOT, bytes.clone()).await.expect(200);
    assert_eq!((&view["id"], &view["tick"]), (&json!("target"), &json!(111)));
    assert_eq!(view["material"]["fresh_density"], 20.0, "its material comes along");
    assert_eq!(view["snowfall_rate"], 2.0);
    assert_eq!(server.heights(path).await, server.heights(&source).await);
    for session in [path, &source] {
        server.post(&format!("{session}/snowfalls"), json!({"depth": 0.3})).await.expect(200);
        server.step(session, 200).await;
    }
    assert_eq!(server.heights(path).await, server.heights(&source).await, "they go on alike");
    let answer = server.send_as(token, Method::GET, &format!("{path}/mass"), &Value::Null).await;
    assert_eq!(answer.expect(200)["imbalance_quanta"], 0, "its token stays");
    // What it is now can be saved and restored again.
    let twin = server.post_bytes("/v1/sessions?id=twin", SNAPSHOT, snapshot(&server, path).await);
    twin.await.expect(201);
    assert_eq!(digest(&server, "/v1/sessions/twin").await, digest(&server, path).await);

    let first = server.post(&reset, json!({})).await.expect(200);
    assert_eq!((&first["tick"], &first["material"]["fresh_density"]), (&json!(0), &json!(60.0)));
    server.stop().await;
}

async fn a_snapshot_of_another_grid_is_refused(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = eventful(&server).await;
    let before = digest(&server, &path).await;
    let reset = format!("{path}/reset");
    let mut wide = small();
    wide["grid"]["width"] = json!(12);
    let other = server.create(wide).await;
    let bytes = snapshot(&server, &other).await;
    let problem = server.post_bytes(&reset, SNAPSHOT, bytes).await.problem(422);
    let detail = problem["errors"][0]["detail"].as_str().unwrap();
    assert!(detail.contains("12 × 7 × 20 cells of 0.2 m"), "{problem}");
    let mut damaged = snapshot(&server, &path).await;
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    for bytes in [damaged, b"snow".to_vec(), Vec::new()] {
        server.post_bytes(&reset, SNAPSHOT, bytes).await.problem(422);
    }
    assert_eq!(digest(&server, &path).await, before, "nothing has changed");
    server.stop().await;
}

async fn a_snapshot_brings_its_ground_along(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let (flat, mut hilly) = (server.create(small()).await, small());
    let hill: Vec<f64> = (0..70).map(|column| f64::from(column) * 0.01).collect();
    hilly["terrain"] = json!({ "heights": hill });
    let hilly = server.create(hilly).await;
    let taken = [snapshot(&server, &flat).await, snapshot(&server, &hilly).await];
    let ground = async |path: &str| {
        server.get(&format!("{path}/terrain")).await.expect(200)["heights"].clone()
    };
    for (path, bytes, expected) in
        [(&flat, &taken[1], json!(hill)), (&hilly, &taken[0], json!(vec![0.0; 70]))]
    {
        let reset = format!("{path}/reset");
        server.post_bytes(&reset, SNAPSHOT, bytes.clone()).await.expect(200);
        assert_eq!(ground(path).await, expected);
        let again = snapshot(&server, path).await;
        server.post_bytes(&reset, SNAPSHOT, again).await.expect(200);
        assert_eq!(ground(path).await, expected);
    }
    server.stop().await;
}
