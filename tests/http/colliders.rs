//! Objects on the snow over HTTP.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::{Options, Server, small};

on_each_backend!(
    a_collider_is_created_changed_and_removed,
    put_creates_and_replaces,
    a_batch_is_applied_whole_or_not_at_all,
    a_batch_may_skip_what_is_in_error,
    colliders_are_listed_in_pages,
    what_can_not_stand_there_is_refused,
    a_session_has_room_for_so_many,
    an_object_sinks_and_leaves_a_dent,
    what_is_removed_and_put_again_sinks_from_where_it_stands,
    an_object_rests_on_settled_snow_however_it_was_stepped,
);

pub fn plate(side: f64, x: f64, z: f64) -> Value {
    json!({"mass": 100, "shape": {"type": "box", "width": side, "depth": side},
        "position": {"x": x, "z": z}})
}

pub fn foot(x: f64) -> Value {
    json!({"shape": {"type": "box", "width": 0.2, "depth": 0.4}, "offset": {"x": x, "z": 0}})
}

/// A body that stands on several footprints.
pub fn feet(footprints: Value) -> Value {
    json!({"mass": 80, "footprints": footprints, "position": {"x": 1.1, "z": 0.7}})
}

fn named(id: &str, mut collider: Value) -> Value {
    collider["id"] = json!(id);
    collider
}

async fn a_collider_is_created_changed_and_removed(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let before = server.get(&path).await.expect(200);
    let all = format!("{path}/colliders");

    let created = server.post(&all, named("sledge", plate(0.6, 1.0, 0.7))).await;
    let body = created.expect(201);
    assert_eq!(created.header("location"), format!("{all}/sledge"));
    assert!(body["seq"].as_u64() > before["seq"].as_u64());
    assert_eq!(body["shape"], json!({"type": "box", "width": 0.6, "depth": 0.6}));
    assert_eq!(body["position"], json!({"x": 1.0, "z": 0.7}));
    for field in ["bottom", "sink_depth", "contact_area", "pressure"] {
        assert!(body[field].is_f64(), "{field}: {body}");
    }
    assert!(body["resting"].is_boolean());
    assert!((body["bottom"].as_f64().unwrap() - 1.0).abs() < 1e-6, "it lies on the snow");
    assert!((body["contact_area"].as_f64().unwrap() - 0.36).abs() < 1e-4);
    assert!((body["pressure"].as_f64().unwrap() - 100.0 * 9.81 / 0.36).abs() < 1.0);

    let one = format!("{all}/sledge");
    let read = server.get(&one).await.expect(200);
    assert_eq!(read, body, "the change is visible to the next read");
    server.post(&all, named("sledge", plate(0.2, 1.0, 0.7))).await.problem(409);

    let patched = server.patch(&one, json!({"mass": 10})).await.expect(200);
    assert_eq!((&patched["mass"], &patched["shape"]), (&json!(10.0), &body["shape"]));

    let gone = server.delete(&one).await;
    assert_eq!((gone.status, gone.body.len()), (204, 0));
    assert!(gone.header("firn-seq").parse::<u64>().unwrap() > patched["seq"].as_u64().unwrap());
    for reply in [
        server.get(&one).await,
        server.delete(&one).await,
        server.patch(&one, json!({"mass": 1})).await,
    ] {
        assert!(reply.problem(404)["detail"].as_str().unwrap().contains("sledge"));
    }
    let unnamed = server.post(&all, plate(0.2, 1.0, 0.7)).await.expect(201);
    assert_eq!(unnamed["id"].as_str().unwrap().len(), 26, "the server's ULID");
    server.stop().await;
}

async fn put_creates_and_replaces(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let one = format!("{path}/colliders/plate");
    let created = server.put(&one, plate(0.2, 1.0, 0.7)).await;
    assert_eq!(created.expect(201)["id"], "plate");
    assert_eq!(created.header("location"), one);
    let replaced = server.put(&one, named("plate", plate(0.4, 0.5, 0.5))).await.expect(200);
    assert_eq!(replaced["shape"]["width"], 0.4);
    assert_eq!(server.get(&path).await.expect(200)["summary"]["colliders"], 1);
    let reply = server.put(&one, named("other", plate(0.2, 1.0, 0.7))).await;
    assert_eq!(reply.pointers(422), ["/id"]);
    let wrong = format!("{path}/colliders/a%20b");
    assert_eq!(server.put(&wrong, plate(0.2, 1.0, 0.7)).await.pointers(422), ["/id"]);
    server.stop().await;
}

async fn a_batch_is_applied_whole_or_not_at_all(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let batch = format!("{path}/colliders:batch");
    let ids = async || {
        let list = server.get(&format!("{path}/colliders")).await.expect(200);
        let items = list["items"].as_array().unwrap().clone();
        items.iter().map(|item| item["id"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let put = json!([named("a", plate(0.2, 0.5, 0.5)), named("b", plate(0.2, 1.5, 0.5))]);
    let first = server.post(&batch, json!({ "put": put })).await.expect(200);
    assert!(first["tick"].is_u64() && first["seq"].is_u64());
    assert_eq!(ids().await, ["a", "b"]);

    let before = server.get(&path).await.expect(200);
    for (body, pointer) in [
        (
            json!({"put": [named("c", plate(0.2, 1.0, 0.7)), named("d", plate(0.2, 9.0, 0.7))],
                "on_error": "refuse"}),
            "/put/1/position",
        ),
        (json!({"put": [plate(0.2, 1.0, 0.7)]}), "/put/0/id"),
        (
            json!({"put": [named("c", plate(0.2, 1.0, 0.7)), named("c", plate(0.4, 1.0, 0.7))]}),
            "/put/1/id",
        ),
        (json!({"put": [], "on_error": "ignore"}), "/on_error"),
        (json!({"put": [{"id": "c", "mass": "heavy"}]}), "/put/0/mass"),
        (json!({"puts": []}), "/puts"),
    ] {
        let reply = server.post(&batch, body.clone()).await;
        assert_eq!(reply.pointers(422), [pointer], "{body}");
    }
    let many: Vec<String> = (0..4097).map(|i| format!("c{i}")).collect();
    server.post(&batch, json!({ "delete": many })).await.problem(422);
    assert_eq!(server.get(&path).await.expect(200), before, "nothing changed");

    // What is not there needs no removal.
    let body = json!({"put": [named("c", plate(0.2, 1.0, 0.7))], "delete": ["a", "nobody"]});
    let reply = server.post(&batch, body).await.expect(200);
    assert!(reply.get("results").is_none(), "{reply}");
    assert_eq!(ids().await, ["b", "c"]);
    server.stop().await;
}

async fn a_batch_may_skip_what_is_in_error(backend: BackendChoice) {
    let mut options = Options::default();
    options.limits.colliders_per_session = 3;
    let server = Server::start_with(backend, options).await;
    let path = server.create(small()).await;
    server.put(&format!("{path}/colliders/a"), plate(0.2, 0.5, 0.5)).await.expect(201);
    server.put(&format!("{path}/colliders/b"), plate(0.2, 0.5, 0.5)).await.expect(201);
    let body = json!({
        "put": [
            named("a", plate(0.4, 0.5, 0.5)),
            named("c", plate(0.2, 9.0, 0.7)),
            plate(0.2, 1.0, 0.7),
            named("b", plate(0.2, 1.0, 0.7)),
            named("a", plate(0.2, 1.0, 0.7)),
            named("c", plate(0.2, 1.0, 0.7)),
            named("d", plate(0.2, 1.0, 0.7)),
        ],
        "delete": ["b", "nobody"],
        "on_error": "skip",
    });
    let reply = server.post(&format!("{path}/colliders:batch"), body).await.expect(200);
    let results = |list: &str| -> Vec<Value> {
        let entries = reply["results"][list].as_array().unwrap().iter();
        entries.map(|entry| entry["result"].clone()).collect()
    };
    assert_eq!(results("delete"), ["removed", "absent"]);
    assert_eq!(
        results("put"),
        ["replaced", "skipped", "skipped", "created", "skipped", "created", "skipped"]
    );
    let put = &reply["results"]["put"];
    for (i, pointer) in [(1, "/put/1/position"), (2, "/put/2/id"), (4, "/put/4/id"), (6, "/put/6")]
    {
        assert_eq!(put[i]["errors"][0]["pointer"], pointer, "{put}");
    }
    assert_eq!((&put[5]["id"], put[5].get("errors")), (&json!("c"), None));
    let list = server.get(&format!("{path}/colliders")).await.expect(200);
    let stands = |i: usize| (&list["items"][i]["id"], &list["items"][i]["position"]["x"]);
    assert_eq!(stands(0), (&json!("a"), &json!(0.5)));
    assert_eq!(stands(1), (&json!("b"), &json!(1.0)));
    assert_eq!(stands(2), (&json!("c"), &json!(1.0)));
    server.stop().await;
}

async fn colliders_are_listed_in_pages(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    for id in ["b", "a", "c"] {
        server.put(&format!("{path}/colliders/{id}"), plate(0.2, 1.0, 0.7)).await.expect(201);
    }
    let page = server.get(&format!("{path}/colliders?limit=2")).await.expect(200);
    assert_eq!((&page["items"][0]["id"], &page["items"][1]["id"]), (&json!("a"), &json!("b")));
    assert_eq!(page["next_cursor"], "b");
    assert!(page["seq"].is_u64());
    let rest = server.get(&format!("{path}/colliders?limit=2&cursor=b")).await.expect(200);
    assert_eq!(rest["items"].as_array().unwrap().len(), 1);
    assert_eq!((&rest["items"][0]["id"], &rest["next_cursor"]), (&json!("c"), &Value::Null));
    server.stop().await;
}

async fn what_can_not_stand_there_is_refused(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let all = format!("{path}/colliders");
    let with = |field: &str, value: Value| {
        let mut collider = plate(0.2, 1.0, 0.7);
        collider[field] = value;
        collider
    };
    for (body, pointer) in [
        (plate(0.4, -0.2, 0.7), "/position"),
        (plate(0.4, 2.3, 0.7), "/position"),
        (with("position", json!({"x": -1, "z": 0})), "/position"),
        (with("heading", json!("north")), "/heading"),
        (with("heading", json!(1e9)), "/heading"),
        (with("airborne", json!(1)), "/airborne"),
        (with("footprints", json!([foot(0.1)])), "/footprints"),
        (with("shape", Value::Null), "/shape"),
        (feet(json!([])), "/shape"),
        (feet(json!(vec![foot(0.1); 17])), "/footprints"),
        (feet(json!([{"shape": {"type": "disk", "radius": 0.1}}])), "/footprints/0/offset"),
        (
            feet(json!([{"shape": {"type": "disk", "radius": -1}, "offset": {"x": 0, "z": 0}}])),
            "/footprints/0/shape/radius",
        ),
        (
            feet(json!([foot(0.1), {"shape": {"type": "disk", "radius": 1},
                "offset": {"x": 1e5, "z": 0}}])),
            "/footprints/1/offset/x",
        ),
        (with("shape", json!({"type": "capsule", "length": 0.1, "radius": 0.1})), "/shape/length"),
        (with("shape", json!({"type": "capsule", "length": 1})), "/shape/radius"),
        (with("shape", json!({"type": "wheel", "width": 0.1, "radius": 9})), "/shape/radius"),
        (
            with("shape", json!({"type": "box", "width": 1, "depth": 1, "radius": 1})),
            "/shape/radius",
        ),
        (with("shape", json!({"type": "polygon", "corners": [[0, 0], [1, 0]]})), "/shape/corners"),
        (
            with("shape", json!({"type": "polygon", "corners": [[0, 0], [1, 0], [2, 0]]})),
            "/shape/corners",
        ),
        (
            with(
                "shape",
                json!({"type": "polygon",
                "corners": [[0, 0], [1, 0], [0.1, 0.1], [0, 1]]}),
            ),
            "/shape/corners",
        ),
        (
            with("shape", json!({"type": "polygon", "corners": [[0, 0], [1e9, 0], [0, 1]]})),
            "/shape/corners/1/0",
        ),
        (with("position", json!({"x": 1})), "/position/z"),
        (with("position", json!({"x": 1, "z": 0.7, "y": 2})), "/position/y"),
        (with("mass", json!(0)), "/mass"),
        (with("mass", json!(-5)), "/mass"),
        (with("mass", json!(2e9)), "/mass"),
        (with("mass", json!("100")), "/mass"),
        (with("mass", Value::Null), "/mass"),
        (with("shape", json!({"type": "cone", "radius": 1})), "/shape/type"),
        (with("shape", json!({"type": "disk"})), "/shape/radius"),
        (with("shape", json!({"type": "disk", "radius": "wide"})), "/shape/radius"),
        (with("shape", json!({"type": "disk", "radius": 0})), "/shape/radius"),
        (with("shape", json!({"type": "box", "width": -1, "depth": 1})), "/shape/width"),
        (with("shape", json!({"radius": 1})), "/shape/type"),
        (with("color", json!("red")), "/color"),
        (with("id", json!("no spaces")), "/id"),
        (json!({"shape": {"type": "disk", "radius": 0.2}, "position": {"x": 1, "z": 1}}), "/mass"),
    ] {
        let reply = server.post(&all, body.clone()).await;
        assert_eq!(reply.pointers(422), [pointer], "{body}");
    }
    let list = server.get(&all).await.expect(200);
    assert_eq!(list["items"], json!([]), "nothing changed");
    server.stop().await;
}

async fn a_session_has_room_for_so_many(backend: BackendChoice) {
    let mut options = Options::default();
    options.limits.colliders_per_session = 2;
    let server = Server::start_with(backend, options).await;
    let path = server.create(small()).await;
    for id in ["a", "b"] {
        server.put(&format!("{path}/colliders/{id}"), plate(0.2, 1.0, 0.7)).await.expect(201);
    }
    server.put(&format!("{path}/colliders/c"), plate(0.2, 1.0, 0.7)).await.problem(422);
    server.put(&format!("{path}/colliders/b"), plate(0.4, 1.0, 0.7)).await.expect(200);
    assert_eq!(server.get(&path).await.expect(200)["summary"]["colliders"], 2);
    server.stop().await;
}

async fn an_object_sinks_and_leaves_a_dent(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let one = format!("{path}/colliders/stone");
    // It covers 3 × 3 columns around column (5, 3).
    server.put(&one, plate(0.6, 1.1, 0.7)).await.expect(201);
    server.step(&path, 1200).await;
    let at = |heights: &[f64], x: usize, z: usize| heights[z * 10 + x];
    let heights = server.heights(&path).await;
    let beside = at(&heights, 0, 0);
    assert!(at(&heights, 5, 3) < beside - 0.05, "{heights:?}");
    assert_eq!(at(&heights, 4, 2), at(&heights, 6, 4));
    let stone = server.get(&one).await.expect(200);
    assert!((stone["bottom"].as_f64().unwrap() - at(&heights, 5, 3)).abs() < 1e-3);
    assert!(stone["sink_depth"].as_f64().unwrap() > 0.1, "{stone}");
    // Force balance: pressure times area carries the weight.
    let force = stone["pressure"].as_f64().unwrap() * stone["contact_area"].as_f64().unwrap();
    assert!((force / 981.0 - 1.0).abs() < 1e-4, "{stone}");

    assert_eq!(server.delete(&one).await.status, 204);
    server.step(&path, 60).await;
    let after = server.heights(&path).await;
    assert!(at(&after, 5, 3) < at(&after, 0, 0) - 0.05, "the dent stays");
    server.stop().await;
}

async fn what_is_removed_and_put_again_sinks_from_where_it_stands(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(small()).await;
    let stone = named("stone", plate(0.6, 1.0, 0.7));
    server.post(&format!("{path}/colliders"), stone.clone()).await.expect(201);
    server.step(&path, 400).await;
    let at = format!("{path}/colliders/stone");
    let sunk = server.get(&at).await.expect(200);
    assert!(sunk["sink_depth"].as_f64().unwrap() > 0.05, "{sunk}");
    let batch = json!({"put": [stone], "delete": ["stone"]});
    server.post(&format!("{path}/colliders:batch"), batch).await.expect(200);
    let again = server.get(&at).await.expect(200);
    assert_eq!(again["sink_depth"], 0.0, "{again}");
    server.stop().await;
}

async fn an_object_rests_on_settled_snow_however_it_was_stepped(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut ends = Vec::new();
    for steps in [vec![1; 9], vec![9]] {
        let mut hard = small();
        hard["initial_snow"] = json!([{"depth": 1, "density": 100, "temperature": -20}]);
        let path = server.create(hard).await;
        let one = format!("{path}/colliders/plate");
        let put = server.put(&one, plate(0.6, 1.0, 0.7)).await.expect(201);
        assert_eq!(put["resting"], false, "no cycle has shown that it does");
        for ticks in steps {
            server.post(&format!("{path}/step"), json!({ "ticks": ticks })).await.expect(200);
        }
        let session = server.get(&path).await.expect(200);
        assert_eq!(session["settled"], true);
        assert_eq!(server.get(&one).await.expect(200)["resting"], true);
        ends.push(server.get(&format!("{path}/digest")).await.expect(200)["digest"].clone());
    }
    assert_eq!(ends[0], ends[1]);
    server.stop().await;
}
