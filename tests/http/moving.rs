//! Objects that move by themselves, over HTTP.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::Server;

on_each_backend!(
    an_object_moves_with_its_velocity_and_turns,
    an_object_follows_a_path_in_the_time_it_is_told,
    a_sweep_leaves_a_track_where_a_lift_leaves_none,
    what_moves_is_the_same_however_it_is_stepped,
    a_track_is_as_deep_at_any_tick_rate,
    what_has_turned_can_be_changed,
    heading_alone_is_swept_where_another_sweep_ends,
    what_moves_is_saved_with_all_of_its_way,
    an_object_stops_at_the_edge,
    a_way_that_can_not_be_taken_is_refused,
);

/// A session of 6 m × 2 m whose snow gives way at once.
fn soft() -> Value {
    json!({
        "grid": {"width": 60, "depth": 20, "height": 20, "cell_size": 0.1},
        "preset": "game",
        "pressing": 0,
        "paused": true,
        "tick_rate": 20,
        "initial_snow": [{"depth": 1.0}]
    })
}

fn ski(x: f64) -> Value {
    json!({"mass": 60, "shape": {"type": "box", "width": 0.2, "depth": 0.2},
        "position": {"x": x, "z": 1.0}})
}

fn with(mut collider: Value, fields: Value) -> Value {
    let more = fields.as_object().unwrap().clone();
    collider.as_object_mut().unwrap().extend(more);
    collider
}

fn at(collider: &Value) -> (f64, f64) {
    let along = |axis: &str| collider["position"][axis].as_f64().unwrap();
    (along("x"), along("z"))
}

fn is_near(collider: &Value, x: f64, z: f64) -> bool {
    let (own_x, own_z) = at(collider);
    (own_x - x).abs() < 1e-6 && (own_z - z).abs() < 1e-6
}

/// How deep the row of columns at z = 1 m is pressed, column by column.
async fn dents(server: &Server, path: &str) -> Vec<f64> {
    let heights = server.heights(path).await;
    let untouched = heights[0];
    heights[10 * 60..11 * 60].iter().map(|height| untouched - height).collect()
}

async fn an_object_moves_with_its_velocity_and_turns(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(soft()).await;
    let one = format!("{path}/colliders/ski");
    let motion = json!({"velocity": {"x": 2, "z": 0}, "turn_rate": 90});
    let put = server.put(&one, with(ski(0.55), motion)).await.expect(201);
    assert_eq!((at(&put), &put["turn_rate"]), ((0.55, 1.0), &json!(90.0)));
    assert_eq!(put["velocity"], json!({"x": 2.0, "z": 0.0}));

    server.step(&path, 20).await;
    let moved = server.get(&one).await.expect(200);
    assert!(is_near(&moved, 2.55, 1.0), "{moved}");
    assert!((moved["heading"].as_f64().unwrap() - 90.0).abs() < 1e-6);
    assert_eq!((&moved["velocity"], &moved["resting"]), (&put["velocity"], &json!(false)));
    assert_eq!(server.get(&path).await.expect(200)["settled"], false);
    let dents = dents(&server, &path).await;
    assert!(dents[7..25].iter().all(|dent| *dent > 0.05), "no gap: {dents:?}");
    assert!(dents[30..].iter().all(|dent| *dent < 0.01), "nothing ahead: {dents:?}");

    // Told otherwise, it stays.
    let still = json!({"velocity": {"x": 0, "z": 0}, "turn_rate": 0});
    let told = server.patch(&one, still).await.expect(200);
    assert!(told.get("velocity").is_none() && told.get("turn_rate").is_none(), "{told}");
    server.step(&path, 20).await;
    assert!(is_near(&server.get(&one).await.expect(200), 2.55, 1.0));
    server.stop().await;
}

async fn an_object_follows_a_path_in_the_time_it_is_told(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(soft()).await;
    let one = format!("{path}/colliders/ski");
    let way = json!({"path": [[2.0, 1.0], [2.0, 1.5], [1.0, 1.5]], "over": 2.5});
    let put = server.put(&one, with(ski(1.0), way)).await.expect(201);
    assert_eq!(put["speed"], 1.0);
    server.step(&path, 30).await;
    let moved = server.get(&one).await.expect(200);
    assert!(is_near(&moved, 2.0, 1.5), "{moved}");
    server.step(&path, 20).await;
    let there = server.get(&one).await.expect(200);
    assert_eq!(at(&there), (1.0, 1.5), "{there}");
    assert!(there.get("path").is_none() && there.get("speed").is_none());

    let way = json!({"path": [[1.0, 0.5]], "over": 10, "velocity": {"x": 1, "z": 0}});
    server.patch(&one, way).await.expect(200);
    server.step(&path, 100).await;
    assert!(is_near(&server.get(&one).await.expect(200), 1.0, 1.0));
    // A new position ends the path; the velocity stays.
    let lifted = json!({"position": {"x": 3.0, "z": 1.0}});
    let lifted = server.patch(&one, lifted).await.expect(200);
    assert!(lifted.get("path").is_none());
    server.step(&path, 20).await;
    assert!(is_near(&server.get(&one).await.expect(200), 4.0, 1.0));
    server.stop().await;
}

async fn a_sweep_leaves_a_track_where_a_lift_leaves_none(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(soft()).await;
    let one = format!("{path}/colliders/ski");
    server.put(&one, ski(0.55)).await.expect(201);
    let to = |x: f64| json!({"position": {"x": x, "z": 1.0}, "heading": 90, "sweep": true});
    let swept = server.patch(&one, to(1.55)).await.expect(200);
    assert_eq!(at(&swept), (0.55, 1.0), "it is on its way");
    assert_eq!(swept["path"], json!([[1.55, 1.0]]));
    server.step(&path, 1).await;
    let there = server.get(&one).await.expect(200);
    assert_eq!((at(&there), &there["heading"]), ((1.55, 1.0), &json!(90.0)));
    assert!(there.get("path").is_none());
    // Two sweeps before a cycle are one way with a corner.
    server.patch(&one, to(2.05)).await.expect(200);
    let both = server.patch(&one, to(2.55)).await.expect(200);
    assert_eq!(both["path"], json!([[2.05, 1.0], [2.55, 1.0]]));
    server.step(&path, 1).await;
    assert_eq!(at(&server.get(&one).await.expect(200)), (2.55, 1.0));
    let lifted = json!({"position": {"x": 4.55, "z": 1.0}});
    server.patch(&one, lifted).await.expect(200);
    server.step(&path, 1).await;

    let dents = dents(&server, &path).await;
    assert!(dents[6..26].iter().all(|dent| *dent > 0.05), "no gap: {dents:?}");
    assert!(dents[28..43].iter().all(|dent| *dent < 0.01), "it was lifted: {dents:?}");
    server.stop().await;
}

async fn what_moves_is_the_same_however_it_is_stepped(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut states = Vec::new();
    for portions in [vec![36], vec![1; 36], vec![5, 20, 1, 10]] {
        let path = server.create(soft()).await;
        let motion = json!({"velocity": {"x": 3, "z": 0.3}, "turn_rate": 77});
        server.put(&format!("{path}/colliders/a"), with(ski(0.5), motion)).await.expect(201);
        let way = json!({"path": [[3.0, 0.5], [2.0, 0.5]], "over": 1.5});
        server.put(&format!("{path}/colliders/b"), with(ski(1.5), way)).await.expect(201);
        server.put(&format!("{path}/colliders/c"), ski(3.5)).await.expect(201);
        server.post(&format!("{path}/snowfalls"), json!({"depth": 0.1})).await.expect(200);
        for ticks in portions {
            server.step(&path, ticks).await;
        }
        let digest = server.get(&format!("{path}/digest")).await.expect(200)["digest"].clone();
        let mut all = server.get(&format!("{path}/colliders")).await.expect(200)["items"].clone();
        // What was told of rest depends on which cycles were looked at.
        all.as_array_mut().unwrap().iter_mut().for_each(|it| it["resting"] = Value::Null);
        states.push((digest, all, server.heights(&path).await));
    }
    assert_eq!(states[0], states[1]);
    assert_eq!(states[0], states[2]);
    server.stop().await;
}

async fn a_track_is_as_deep_at_any_tick_rate(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut depths = Vec::new();
    for tick_rate in [20, 240] {
        let mut session = soft();
        session["tick_rate"] = json!(tick_rate);
        session["pressing"] = json!(0.25);
        let path = server.create(session).await;
        let skier = json!({"mass": 80, "shape": {"type": "box", "width": 0.1, "depth": 1.8},
            "position": {"x": 1.05, "z": 1.0}, "heading": 90, "velocity": {"x": 10, "z": 0}});
        server.put(&format!("{path}/colliders/ski"), skier).await.expect(201);
        server.step(&path, tick_rate * 9 / 20).await;
        let dents = dents(&server, &path).await;
        let track = &dents[24..42];
        let mean = track.iter().sum::<f64>() / track.len() as f64;
        assert!(track.iter().all(|dent| *dent > 0.8 * mean), "{tick_rate} Hz: {track:?}");
        depths.push(mean);
    }
    assert!(depths[0] > 0.03 && (depths[0] / depths[1] - 1.0).abs() < 0.1, "{depths:?}");
    server.stop().await;
}

/// The rows that are reserved for it do not depend on its heading.
async fn what_has_turned_can_be_changed(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(soft()).await;
    let one = format!("{path}/colliders/ski");
    for (width, ticks) in [(0.2, 10), (0.1, 13)] {
        let mut long = ski(3.0);
        long["shape"] = json!({"type": "box", "width": width, "depth": 1.6});
        server.put(&one, with(long, json!({"turn_rate": 90}))).await;
        server.step(&path, ticks).await;
        server.patch(&one, json!({"turn_rate": 0})).await.expect(200);
        server.patch(&one, json!({"turn_rate": 20, "heading": 0})).await.expect(200);
        server.step(&path, ticks).await;
        assert_eq!(server.delete(&one).await.status, 204);
    }
    server.stop().await;
}

async fn heading_alone_is_swept_where_another_sweep_ends(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(soft()).await;
    let one = format!("{path}/colliders/ski");
    server.put(&one, with(ski(1.0), json!({"velocity": {"x": 1, "z": 0}}))).await.expect(201);
    let to = json!({"position": {"x": 2.0, "z": 1.0}, "sweep": true});
    server.patch(&one, to).await.expect(200);
    server.patch(&one, json!({"heading": 90, "sweep": true})).await.expect(200);
    for _ in 0..40 {
        let to = json!({"position": {"x": 2.0, "z": 1.0}, "sweep": true});
        let swept = server.patch(&one, to).await.expect(200);
        assert!(swept["path"].as_array().unwrap().len() <= 16, "they do not pile up");
    }
    server.step(&path, 1).await;
    let there = server.get(&one).await.expect(200);
    assert_eq!((at(&there), &there["heading"]), ((2.0, 1.0), &json!(90.0)));
    server.step(&path, 20).await;
    assert!(is_near(&server.get(&one).await.expect(200), 3.0, 1.0), "its velocity goes on");
    server.stop().await;
}

async fn what_moves_is_saved_with_all_of_its_way(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(soft()).await;
    let one = format!("{path}/colliders/ski");
    let points: Vec<[f64; 2]> = (0..100).map(|i| [1.0 + 0.04 * f64::from(i), 1.0]).collect();
    let way = json!({"path": points, "over": 8, "turn_rate": 30});
    server.put(&one, with(ski(1.0), way)).await.expect(201);
    server.post(&format!("{path}/snowfalls"), json!({"depth": 0.2})).await.expect(200);
    server.step(&path, 30).await;
    let moving = server.get(&one).await.expect(200);
    assert_eq!(moving["path"].as_array().unwrap().len(), 16, "its next points are told");
    assert!(moving["burden"].as_f64().unwrap() > 0.0);

    let saved = server.get(&format!("{path}/snapshot")).await;
    assert_eq!(saved.status, 200);
    let created = server
        .post_bytes("/v1/sessions", "application/vnd.firn.snapshot", saved.body.clone())
        .await
        .expect(201);
    let copy = format!("/v1/sessions/{}", created["id"].as_str().unwrap());
    let mut states = Vec::new();
    for path in [&path, &copy] {
        server.step(path, 100).await;
        let object = server.get(&format!("{path}/colliders/ski")).await.expect(200);
        let mass = server.get(&format!("{path}/mass")).await.expect(200);
        assert_eq!(mass["imbalance_quanta"], 0);
        states.push((
            server.get(&format!("{path}/digest")).await.expect(200)["digest"].clone(),
            (object["position"].clone(), object["burden"].clone(), mass["carried"].clone()),
        ));
    }
    assert_eq!(states[0], states[1]);
    server.stop().await;
}

async fn an_object_stops_at_the_edge(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(soft()).await;
    let one = format!("{path}/colliders/ski");
    let motion = json!({"velocity": {"x": 10, "z": 0}});
    server.put(&one, with(ski(5.0), motion)).await.expect(201);
    server.step(&path, 20).await;
    let stopped = server.get(&one).await.expect(200);
    let (x, z) = at(&stopped);
    assert!(x > 5.95 && x < 6.15 && z == 1.0, "{stopped}");
    assert!(stopped.get("velocity").is_none());
    assert!(dents(&server, &path).await[51..].iter().all(|dent| *dent > 0.05), "to the very edge");
    server.stop().await;
}

async fn a_way_that_can_not_be_taken_is_refused(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(soft()).await;
    let one = format!("{path}/colliders/ski");
    server.put(&one, ski(1.0)).await.expect(201);
    let points = |count: usize| vec![[1.0, 1.0]; count];
    for (motion, pointers) in [
        (json!({"velocity": {"x": 80, "z": 80}}), vec!["/velocity"]),
        (json!({"velocity": {"x": "fast", "z": 0}}), vec!["/velocity/x"]),
        (json!({"turn_rate": 721}), vec!["/turn_rate"]),
        (json!({"path": [[2.0, 1.0]]}), vec!["/over"]),
        (json!({"over": 2}), vec!["/path"]),
        (json!({"path": [], "over": 2}), vec!["/path"]),
        (json!({"path": [[2.0, 1.0]], "over": 0}), vec!["/over"]),
        (json!({"path": [[900.0, 1.0]], "over": 2}), vec!["/over"]),
        (json!({"path": [[1.0, 1.0], [1e7, 1.0]], "over": 2}), vec!["/path/1"]),
        (json!({"path": points(4097), "over": 2}), vec!["/path"]),
    ] {
        let whole = server.put(&one, with(ski(1.0), motion.clone())).await;
        assert_eq!(whole.pointers(422), pointers, "{motion}");
        assert_eq!(server.patch(&one, motion.clone()).await.pointers(422), pointers, "{motion}");
    }
    server.put(&one, with(ski(1.0), json!({"path": points(4096), "over": 2}))).await.expect(200);
    for (patch, pointer) in [
        (json!({"sweep": true}), "/sweep"),
        (json!({"sweep": true, "heading": 1, "path": [[2.0, 1.0]], "over": 1}), "/path"),
    ] {
        assert_eq!(server.patch(&one, patch).await.pointers(422), [pointer]);
    }
    let skipped =
        json!({"put": [with(ski(1.0), json!({"id": "a", "over": 1}))], "on_error": "skip"});
    let reply = server.post(&format!("{path}/colliders:batch"), skipped).await.expect(200);
    assert_eq!(reply["results"]["put"][0]["errors"][0]["pointer"], "/put/0/path");
    server.stop().await;
}
