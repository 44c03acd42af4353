//! The same history for several servers, so that their snowpacks can be compared.

use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use reqwest::Method;
use serde_json::{Value, json};

/// Something that is done to a session: method, path below the session's, body.
pub type Step = (Method, String, Value);

/// A session of 21 × 18 columns that stands still.
pub fn session(id: &str) -> Value {
    json!({
        "id": id,
        "grid": {"width": 21, "depth": 18, "height": 20, "cell_size": 0.2},
        "paused": true,
        "tick_rate": 45,
        "initial_snow": [{"depth": 1.5}, {"depth": 0.7, "temperature": -14, "density": 33}]
    })
}

/// A history of some length, the same for the same seed. Every kind of change is in it.
pub fn history(seed: u64, length: usize) -> Vec<Step> {
    let mut dice = SmallRng::seed_from_u64(seed);
    (0..length).map(|_| step(&mut dice)).collect()
}

fn step(dice: &mut SmallRng) -> Step {
    let place = |dice: &mut SmallRng| json!({"x": dice.random_range(0.6..3.6), "z": dice.random_range(0.6..3.0)});
    let region = json!({
        "x": dice.random_range(0.0..2.0), "z": dice.random_range(0.0..2.0),
        "width": dice.random_range(0.3..2.0), "depth": dice.random_range(0.3..2.0)
    });
    let post = |path: &str, body| (Method::POST, path.to_owned(), body);
    match dice.random_range(0..13) {
        0..3 => post("/snowfalls", json!({"depth": dice.random_range(0.01..0.2)})),
        3 | 4 => {
            let depth = dice.random_range(0.01..0.4);
            let density = dice.random_range(20.0..60.0);
            post("/snowfalls", json!({"depth": depth, "density": density, "region": region}))
        }
        5 => post("/clearings", json!({"depth": dice.random_range(1.0..2.5), "region": region})),
        6 => {
            let id = ["crate", "boot", "sledge"][dice.random_range(0..3)];
            let mut body = json!({"mass": dice.random_range(5.0..90.0), "position": place(dice),
                "shape": {"type": "box", "width": dice.random_range(0.1..0.5), "depth": 0.9},
                "shelters": dice.random_bool(0.8), "airborne": dice.random_bool(0.2)});
            match dice.random_range(0..3) {
                0 => {
                    let along = |dice: &mut SmallRng| dice.random_range(-1.0..1.0);
                    body["velocity"] = json!({"x": along(dice), "z": along(dice)});
                    body["turn_rate"] = json!(dice.random_range(-90.0..90.0));
                }
                1 => {
                    let point = |dice: &mut SmallRng| json!([dice.random_range(0.0..4.0), 1.0]);
                    body["path"] = json!([point(dice), point(dice)]);
                    body["over"] = json!(dice.random_range(0.5..3.0));
                }
                _ => {}
            }
            (Method::PUT, format!("/colliders/{id}"), body)
        }
        7 => {
            let put = json!([{"id": "boot", "mass": 40, "position": place(dice),
                "shape": {"type": "box", "width": 0.4, "depth": 0.6}}]);
            post("/colliders:batch", json!({"put": put, "delete": []}))
        }
        8 => {
            let celsius = dice.random_range(-20.0..0.0);
            (Method::PUT, "/air-temperature".to_owned(), json!({ "celsius": celsius }))
        }
        9 => {
            let ways = [json!("creep"), json!(0), json!(0.25), json!(4)];
            let patch = json!({"snowfall_rate": dice.random_range(0.0..4.0),
                "stiffness_exponent": dice.random_range(3.2..3.8),
                "pressing": ways[dice.random_range(0..4)],
                "time_scale": dice.random_range(0.5..3.0)});
            (Method::PATCH, String::new(), patch)
        }
        _ => post("/step", json!({"ticks": dice.random_range(1..80)})),
    }
}
