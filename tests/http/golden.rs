//! The golden cases and the experiments, over HTTP.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::{Server, numbers};

on_each_backend!(
    golden_cases_hold,
    a_track_is_left_where_an_object_stood,
    experiment_1a_settles_everywhere_alike,
    experiment_1b_settles_less,
    three_plates_sink_by_their_pressure,
);

const MASS_QUANTA: f64 = 262_144.0;

fn case(name: &str) -> Value {
    let path = format!("{}/tests/golden/{name}.json", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    serde_json::from_str(&text).expect("a golden case is JSON")
}

/// Does what a case has scheduled at a tick.
async fn act(server: &Server, path: &str, entry: &Value) {
    let mut body = entry.clone();
    let fields = body.as_object_mut().unwrap();
    fields.remove("at");
    match fields.remove("op").unwrap().as_str().unwrap() {
        "snowfall" => {
            server.post(&format!("{path}/snowfalls"), body).await.expect(200);
        }
        "put" => {
            server.post(&format!("{path}/colliders"), body).await.expect(201);
        }
        "move" => {
            let id = fields.remove("id").unwrap();
            let url = format!("{path}/colliders/{}", id.as_str().unwrap());
            server.patch(&url, body).await.expect(200);
        }
        other => panic!("a case over HTTP can't '{other}'"),
    }
}

/// Runs a case, and has what it expects checked at each of its ticks.
async fn run(server: &Server, case: &Value, check: impl AsyncFn(&Server, &str, &Value) -> ()) {
    let path = server.create(case["session"].clone()).await;
    let schedule = case["schedule"].as_array().unwrap();
    let expect = case["expect"].as_array().unwrap();
    let tick_of = |entry: &Value, field: &str| entry[field].as_u64().unwrap();
    let mut ticks: Vec<u64> = schedule.iter().map(|entry| tick_of(entry, "at")).collect();
    ticks.extend(expect.iter().map(|entry| tick_of(entry, "tick")));
    ticks.sort_unstable();
    ticks.dedup();
    let mut now = 0;
    for tick in ticks {
        if tick > now {
            server.step(&path, tick - now).await;
            now = tick;
        }
        for entry in expect.iter().filter(|entry| tick_of(entry, "tick") == tick && tick > 0) {
            check(server, &path, entry).await;
        }
        for entry in schedule.iter().filter(|entry| tick_of(entry, "at") == tick) {
            act(server, &path, entry).await;
        }
        for entry in expect.iter().filter(|entry| tick_of(entry, "tick") == tick && tick == 0) {
            check(server, &path, entry).await;
        }
    }
    assert_eq!(server.delete(&path).await.status, 204);
}

#[track_caller]
fn near(what: &str, found: &Value, expected: &Value, tolerance: &Value) {
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{what}: {value}"));
    let (found, expected, tolerance) = (number(found), number(expected), number(tolerance));
    assert!((found - expected).abs() <= tolerance, "{what}: {found} instead of {expected}");
}

async fn golden_cases_hold(backend: BackendChoice) {
    let server = Server::start(backend).await;
    // The other cases put bare loads on the snow, which only the reference and the kernels know.
    for name in ["1a", "1b", "2", "3", "half-cell", "fast", "slow", "gold"] {
        let case = case(name);
        let tolerance = &case["tolerance"];
        run(&server, &case, async |server, path, expected| {
            let at = |what: &str| format!("{name} at tick {}: {what}", expected["tick"]);
            let session = server.get(path).await.expect(200);
            let columns = (session["grid"]["width"].as_u64().unwrap()
                * session["grid"]["depth"].as_u64().unwrap()) as f64;
            let area = session["grid"]["cell_size"].as_f64().unwrap().powi(2) * columns;
            let column = server.get(&format!("{path}/columns/5/2")).await.expect(200);
            near(&at("height"), &column["height"], &expected["height"], &tolerance["height"]);
            for height in server.heights(path).await {
                assert_eq!(column["height"], height, "{}", at("all columns are equal"));
            }
            let mass = server.get(&format!("{path}/mass")).await.expect(200);
            assert_eq!(mass["imbalance_quanta"], 0);
            for (field, expected_field) in
                [("present", "mass_per_area"), ("refused", "refused_per_area")]
            {
                let quanta = |kilograms: f64| (kilograms * MASS_QUANTA).round();
                let found = quanta(mass[field].as_f64().unwrap() / area);
                let per_area = expected[expected_field].as_f64().unwrap();
                assert_eq!(found, quanta(per_area), "{}", at(field));
            }
            let layers = column["layers"].as_array().unwrap();
            let expected_layers = expected["layers_bottom_up"].as_array().unwrap();
            assert_eq!(layers.len(), expected_layers.len(), "{}", at("layers"));
            for (i, (found, expected)) in layers.iter().zip(expected_layers).enumerate() {
                for field in ["thickness", "density", "temperature"] {
                    let what = at(&format!("{field} of layer {i}"));
                    near(&what, &found[field], &expected[field], &tolerance[field]);
                }
            }
        })
        .await;
    }
    server.stop().await;
}

async fn a_track_is_left_where_an_object_stood(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let case = case("track");
    let tolerance = &case["tolerance"];
    run(&server, &case, async |server, path, expected| {
        let tick = &expected["tick"];
        let found = server.heights(path).await;
        let heights = numbers(&expected["heights"]);
        assert_eq!(found.len(), heights.len());
        for (i, (found, expected)) in found.iter().zip(heights).enumerate() {
            let what = format!("column {i} at tick {tick}");
            near(&what, &json!(found), &json!(expected), &tolerance["height"]);
        }
        for (id, touch) in expected["colliders"].as_object().unwrap() {
            let collider = server.get(&format!("{path}/colliders/{id}")).await.expect(200);
            let what = |field: &str| format!("{field} of {id} at tick {tick}");
            near(&what("bottom"), &collider["bottom"], &touch["bottom"], &tolerance["height"]);
            for field in ["pressure", "contact_area"] {
                let relative = collider[field].as_f64().unwrap() / touch[field].as_f64().unwrap();
                let tolerance = &tolerance["pressure_relative"];
                near(&what(field), &json!(relative), &json!(1.0), tolerance);
            }
        }
    })
    .await;
    server.stop().await;
}

fn experiment(celsius: f64) -> Value {
    json!({
        "grid": {"width": 50, "depth": 50, "height": 50, "cell_size": 0.2},
        "air_temperature": -3, "paused": true,
        "initial_snow": [{"depth": 5.8, "temperature": celsius}]
    })
}

async fn experiment_1a_settles_everywhere_alike(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(experiment(-3.0)).await;
    assert_eq!(server.step(&path, 7200).await["tick"], 7200);
    let heights = server.heights(&path).await;
    assert_eq!(heights.len(), 2500);
    for height in heights {
        assert!((height - 4.685).abs() <= 0.002, "{height}");
    }
    let mass = server.get(&format!("{path}/mass")).await.expect(200);
    assert_eq!(mass["imbalance_quanta"], 0);
    server.stop().await;
}

async fn experiment_1b_settles_less(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(experiment(-10.0)).await;
    server.step(&path, 7200).await;
    for height in server.heights(&path).await {
        assert!((height - 5.408).abs() <= 0.002, "{height}");
    }
    server.stop().await;
}

/// 100 kg on 4 m, 1 m and 0.3162 m, aligned with the columns and not.
async fn three_plates_sink_by_their_pressure(backend: BackendChoice) {
    let server = Server::start(backend).await;
    for shift in [0.0, 0.07] {
        let mut spec = experiment(-3.0);
        spec["grid"]["width"] = json!(40);
        spec["grid"]["depth"] = json!(25);
        let path = server.create(spec).await;
        let plates = [(4.0, 2.4, 2.5, 4.636), (1.0, 6.1, 1.5, 4.117), (0.3162, 6.1, 3.7, 3.063)];
        let put: Vec<Value> = plates
            .iter()
            .map(|&(side, x, z, _)| {
                json!({"id": format!("plate-{side}").replace('.', "_"), "mass": 100,
                    "shape": {"type": "box", "width": side, "depth": side},
                    "position": {"x": x + shift, "z": z - shift}})
            })
            .collect();
        server.post(&format!("{path}/colliders:batch"), json!({ "put": put })).await.expect(200);
        server.step(&path, 7200).await;
        let heights = server.heights(&path).await;
        for (side, x, z, expected) in plates {
            let (x, z) = (x + shift, z - shift);
            let mut covered = 0;
            for (i, height) in heights.iter().enumerate() {
                let centre = |column: usize| (column as f64 + 0.5) * 0.2;
                let inside = |at: f64, middle: f64| (at - middle).abs() <= side / 2.0 + 1e-6;
                if inside(centre(i % 40), x) && inside(centre(i / 40), z) {
                    covered += 1;
                    let what = format!("{side} m shifted by {shift}: column {i}");
                    assert!((height - expected).abs() <= 0.005, "{what}: {height}");
                }
            }
            assert!(covered > 0, "{side} m shifted by {shift} covers no column");
        }
    }
    server.stop().await;
}
