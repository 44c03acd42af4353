//! Snow that falls on objects.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::Server;

on_each_backend!(
    new_snow_lies_on_a_car_and_leaves_it_where_it_is,
    clearings_spare_what_is_under_objects,
    what_lies_on_an_object_is_laid_down_where_it_was,
    what_moves_lays_its_snow_down_behind_it,
    what_finds_no_room_stays_on_the_object,
    an_object_of_the_same_name_gets_nothing_of_the_one_before,
    objects_above_each_other_share_by_their_names,
);

const COLUMN: f64 = 0.1 * 0.1;

fn session(depth: f64, density: f64) -> Value {
    json!({
        "grid": {"width": 60, "depth": 40, "height": 30, "cell_size": 0.1},
        "preset": "game",
        "paused": true,
        "initial_snow": [{"depth": depth, "density": density}]
    })
}

/// A session whose columns are full of snow as dense as it gets.
fn full() -> Value {
    let mut body = session(3.0, 450.0);
    body["material"] = json!({"max_density": 450, "fresh_density": 60});
    body
}

fn plate(mass: f64, x: f64, z: f64, width: f64, depth: f64) -> Value {
    json!({"mass": mass, "position": {"x": x, "z": z},
        "shape": {"type": "box", "width": width, "depth": depth}})
}

/// The ledger, which has to be even; then fallen, refused, cleared, carried and present \[kg\].
async fn ledger(server: &Server, path: &str) -> [f64; 5] {
    let mass = server.get(&format!("{path}/mass")).await.expect(200);
    assert_eq!(mass["imbalance_quanta"], 0, "{mass}");
    ["fallen", "refused", "cleared", "carried", "present"].map(|it| mass[it].as_f64().unwrap())
}

async fn burden(server: &Server, one: &str) -> f64 {
    server.get(one).await.expect(200)["burden"].as_f64().unwrap()
}

async fn height_at(server: &Server, path: &str, x: usize, z: usize) -> f64 {
    server.heights(path).await[z * 60 + x]
}

async fn snow(server: &Server, path: &str, depth: f64, density: f64) {
    let fall = json!({"depth": depth, "density": density});
    server.post(&format!("{path}/snowfalls"), fall).await.expect(200);
}

#[track_caller]
fn near(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-3 * b.abs().max(1e-3), "{a} is not about {b}");
}

async fn new_snow_lies_on_a_car_and_leaves_it_where_it_is(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(session(0.5, 200.0)).await;
    let one = format!("{path}/colliders/car");
    server.put(&one, plate(1500.0, 3.0, 2.0, 1.8, 3.0)).await.expect(201);
    server.step(&path, 600).await;
    let before = server.get(&one).await.expect(200);
    assert_eq!(before["burden"], 0.0);
    snow(&server, &path, 0.3, 60.0).await;
    let snowed = server.get(&one).await.expect(200);
    near(snowed["burden"].as_f64().unwrap(), 0.3 * 60.0 * 18.0 * 30.0 * COLUMN);
    let contact = snowed["pressure"].as_f64().unwrap() * snowed["contact_area"].as_f64().unwrap();
    near(contact, 9.81 * (1500.0 + snowed["burden"].as_f64().unwrap()));
    server.step(&path, 600).await;
    let after = server.get(&one).await.expect(200);
    let sunk = before["bottom"].as_f64().unwrap() - after["bottom"].as_f64().unwrap();
    assert!((0.0..0.02).contains(&sunk), "its bottom has moved by {sunk} m");
    let [fallen, refused, _, carried, present] = ledger(&server, &path).await;
    assert_eq!(refused, 0.0);
    near(carried, snowed["burden"].as_f64().unwrap());
    near(fallen, present + carried);
    server.stop().await;
}

async fn clearings_spare_what_is_under_objects(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(session(0.5, 200.0)).await;
    let one = format!("{path}/colliders/car");
    server.put(&one, plate(20.0, 3.0, 2.0, 1.0, 1.0)).await.expect(201);
    let before = server.get(&one).await.expect(200)["bottom"].clone();
    server.post(&format!("{path}/clearings"), json!({"depth": 0})).await.expect(200);
    assert_eq!(server.get(&one).await.expect(200)["bottom"], before);
    assert!(height_at(&server, &path, 30, 20).await > 0.4);
    assert_eq!(height_at(&server, &path, 10, 20).await, 0.0);
    // What is held up does not stand there.
    server.patch(&one, json!({"airborne": true})).await.expect(200);
    server.post(&format!("{path}/clearings"), json!({"depth": 0})).await.expect(200);
    assert_eq!(height_at(&server, &path, 30, 20).await, 0.0);
    ledger(&server, &path).await;
    server.stop().await;
}

async fn what_lies_on_an_object_is_laid_down_where_it_was(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(session(0.2, 200.0)).await;
    let one = format!("{path}/colliders/plate");
    server.put(&one, plate(10.0, 1.0, 1.0, 1.0, 1.0)).await.expect(201);
    snow(&server, &path, 0.3, 60.0).await;
    near(height_at(&server, &path, 10, 10).await, 0.2);
    near(height_at(&server, &path, 30, 10).await, 0.5);
    let all = burden(&server, &one).await;
    near(all, 18.0);

    // By half its length: half of the columns are left, and half of the snow is laid there.
    let move_by = json!({"position": {"x": 1.5, "z": 1.0}});
    server.patch(&one, move_by).await.expect(200);
    near(burden(&server, &one).await, all / 2.0);
    near(height_at(&server, &path, 7, 10).await, 0.5);
    near(height_at(&server, &path, 12, 10).await, 0.2);
    let [fallen, _, _, carried, present] = ledger(&server, &path).await;
    near(carried, all / 2.0);
    near(fallen, present + carried);

    server.delete(&one).await;
    let [fallen, refused, _, carried, present] = ledger(&server, &path).await;
    assert_eq!(carried, 0.0);
    assert!(refused < 0.001, "at most a quantum a column: {refused} kg");
    near(fallen, present + refused);

    // What lets snow through carries none.
    let mut fence = plate(10.0, 1.0, 3.0, 1.0, 1.0);
    fence["shelters"] = json!(false);
    server.put(&one, fence).await.expect(201);
    let under = height_at(&server, &path, 10, 30).await;
    snow(&server, &path, 0.1, 60.0).await;
    near(height_at(&server, &path, 10, 30).await, under + 0.1);
    assert_eq!(burden(&server, &one).await, 0.0);
    server.stop().await;
}

async fn what_moves_lays_its_snow_down_behind_it(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(session(0.2, 300.0)).await;
    let one = format!("{path}/colliders/sledge");
    server.put(&one, plate(1.0, 1.0, 1.0, 0.5, 0.5)).await.expect(201);
    snow(&server, &path, 0.2, 60.0).await;
    let all = burden(&server, &one).await;
    server.patch(&one, json!({"velocity": {"x": 2, "z": 0}})).await.expect(200);
    server.step(&path, 60).await;
    let left = burden(&server, &one).await;
    assert!(left < 0.1 * all, "{left} kg of {all} kg");
    let [fallen, refused, _, carried, present] = ledger(&server, &path).await;
    assert_eq!(refused, 0.0);
    near(carried, left);
    near(fallen, present + carried);
    server.stop().await;
}

async fn what_finds_no_room_stays_on_the_object(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(full()).await;
    let one = format!("{path}/colliders/plate");
    server.put(&one, plate(10.0, 1.0, 1.0, 1.0, 1.0)).await.expect(201);
    snow(&server, &path, 0.2, 60.0).await;
    let all = burden(&server, &one).await;
    near(all, 12.0);
    let [_, refused_by_others, ..] = ledger(&server, &path).await;
    server.patch(&one, json!({"position": {"x": 3.0, "z": 1.0}})).await.expect(200);
    near(burden(&server, &one).await, all);
    server.step(&path, 3).await;
    let view = server.get(&one).await.expect(200);
    near(view["burden"].as_f64().unwrap(), all);
    let weight = view["pressure"].as_f64().unwrap() * view["contact_area"].as_f64().unwrap();
    near(weight, 9.81 * (10.0 + all));
    let [_, refused, _, carried, _] = ledger(&server, &path).await;
    assert_eq!(refused, refused_by_others);
    near(carried, all);
    server.delete(&one).await;
    let [_, refused, _, carried, _] = ledger(&server, &path).await;
    assert_eq!(carried, 0.0);
    near(refused, refused_by_others + all);
    server.stop().await;
}

async fn an_object_of_the_same_name_gets_nothing_of_the_one_before(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(full()).await;
    let one = format!("{path}/colliders/plate");
    server.put(&one, plate(10.0, 1.0, 1.0, 1.0, 1.0)).await.expect(201);
    let fall = json!({"depth": 0.2, "density": 60});
    let reply = server.post(&format!("{path}/snowfalls"), fall).await.expect(200);
    let all = burden(&server, &one).await;
    let (fallen, refused) = (reply["fallen_mass"].as_f64().unwrap(), &reply["refused_mass"]);
    near(refused.as_f64().unwrap(), fallen - all);
    let mut again = plate(10.0, 3.0, 1.0, 1.0, 1.0);
    again["id"] = json!("plate");
    let batch = json!({"delete": ["plate"], "put": [again]});
    server.post(&format!("{path}/colliders:batch"), batch).await.expect(200);
    server.step(&path, 3).await;
    assert_eq!(burden(&server, &one).await, 0.0);
    let [_, refused, _, carried, _] = ledger(&server, &path).await;
    assert_eq!(carried, 0.0);
    near(refused, fallen);
    server.stop().await;
}

async fn objects_above_each_other_share_by_their_names(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(session(0.2, 300.0)).await;
    let (a, b) = (format!("{path}/colliders/a"), format!("{path}/colliders/b"));
    server.put(&b, plate(1.0, 1.0, 1.0, 1.0, 1.0)).await.expect(201);
    server.put(&a, plate(1.0, 1.0, 1.0, 0.6, 0.6)).await.expect(201);
    snow(&server, &path, 0.1, 100.0).await;
    near(burden(&server, &a).await, 10.0 * 36.0 * COLUMN);
    near(burden(&server, &b).await, 10.0 * 64.0 * COLUMN);
    ledger(&server, &path).await;
    server.stop().await;
}
