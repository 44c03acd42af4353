//! Kinds of snow that a session is created with.

use firn::config::BackendChoice;
use firn_snow::Preset;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::Server;

on_each_backend!(snow_of_each_preset_behaves_like_it, a_preset_fills_what_is_not_given);

/// What the contract calls a preset.
fn name(preset: Preset) -> Value {
    serde_json::to_value(preset).expect("it is a word")
}

/// How deep 80 kg on 0.03 m² sink in 1 m of it, and how high 8 m of it stand once settled, within limits \[m\].
fn expected(preset: Preset) -> ([f64; 2], [f64; 2]) {
    match preset {
        Preset::Thesis => ([0.7, 0.85], [5.7, 5.9]),
        Preset::Powder => ([0.3, 0.5], [7.6, 7.9]),
        Preset::Packed => ([0.0, 0.001], [7.99, 8.0]),
        Preset::Wet => ([0.08, 0.2], [7.4, 7.7]),
        Preset::Game => ([0.25, 0.35], [6.6, 6.9]),
    }
}

#[track_caller]
fn within(value: &Value, [least, most]: [f64; 2]) {
    let value = value.as_f64().expect("a number");
    assert!((least..=most).contains(&value), "{value} is not within {least} to {most}");
}

async fn snow_of_each_preset_behaves_like_it(backend: BackendChoice) {
    let server = Server::start(backend).await;
    for preset in Preset::ALL {
        let (sinks, stands) = expected(preset);
        let settled = async |depth: f64| {
            let grid = json!({"width": 8, "depth": 8, "height": 50, "cell_size": 0.2});
            let snow = json!([{ "depth": depth }]);
            let body = json!({"preset": name(preset), "grid": grid, "initial_snow": snow,
                "paused": true, "time_scale": 60});
            let path = server.create(body).await;
            let step = json!({"until_settled": true, "max_seconds": 20_000});
            let view = server.post(&format!("{path}/step"), step).await.expect(200);
            assert_eq!(view["settled"], true, "{preset:?}");
            (path, view)
        };
        let (path, _) = settled(1.0).await;
        let foot = json!({"probes": [{"x": 0.8, "z": 0.8, "mass": 80, "area": 0.03}]});
        let foot = server.post(&format!("{path}/probes"), foot).await.expect(200);
        within(&foot["probes"][0]["sink_depth"], sinks);
        let (path, view) = settled(8.0).await;
        within(&view["summary"]["mean_height"], stands);
        assert_eq!(server.get(&format!("{path}/mass")).await.expect(200)["imbalance_quanta"], 0);
    }
    server.stop().await;
}

async fn a_preset_fills_what_is_not_given(backend: BackendChoice) {
    let server = Server::start(backend).await;
    for preset in Preset::ALL {
        // On the grid that a session has by default.
        let body =
            json!({"preset": name(preset), "paused": true, "initial_snow": [{"depth": 0.1}]});
        let view = server.post("/v1/sessions", body).await.expect(201);
        assert_eq!(view["material"], serde_json::to_value(preset.material()).unwrap());
        assert_eq!(view["air_temperature"], preset.air_temperature());
        assert_eq!(view["pressing"], serde_json::to_value(preset.pressing()).unwrap());
        let path = format!("/v1/sessions/{}", view["id"].as_str().unwrap());
        let layers = server.get(&format!("{path}/columns/3/4")).await.expect(200)["layers"].clone();
        within(
            &layers[0]["density"],
            [0.99, 1.01].map(|part| part * preset.material().fresh_density),
        );
        assert_eq!(layers[0]["temperature"], preset.air_temperature());
        server.delete(&path).await;
    }
    let given = json!({"preset": "powder", "paused": true,
        "grid": {"width": 8, "depth": 8, "height": 5, "cell_size": 0.2},
        "material": {"max_density": 250, "hardness_law": "gold"}, "pressing": 1.5});
    let path = server.create(given).await;
    let powder = Preset::Powder.material();
    let mut wanted = serde_json::to_value(powder).unwrap();
    wanted["max_density"] = json!(250.0);
    wanted["hardness_law"] = json!("gold");
    let check = |view: &Value| {
        assert_eq!(view["material"], wanted);
        assert_eq!((&view["air_temperature"], &view["pressing"]), (&json!(-10.0), &json!(1.5)));
    };
    check(&server.get(&path).await.expect(200));
    check(&server.post(&format!("{path}/reset"), json!({})).await.expect(200));
    let snapshot = server.get(&format!("{path}/snapshot")).await.body;
    let media_type = "application/vnd.firn.snapshot";
    check(&server.post_bytes("/v1/sessions", media_type, snapshot).await.expect(201));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_preset_that_does_not_exist_is_refused_by_name() {
    let server = Server::start(BackendChoice::Cpu).await;
    let problem = server.post("/v1/sessions", json!({"preset": "slush"})).await.problem(422);
    let error = &problem["errors"][0];
    assert_eq!(error["pointer"], "/preset");
    for preset in Preset::ALL {
        let detail = error["detail"].as_str().unwrap();
        assert!(detail.contains(name(preset).as_str().unwrap()), "{detail}");
    }
    let below = json!({"preset": "powder", "material": {"fresh_density": 400}});
    assert_eq!(server.post("/v1/sessions", below).await.pointers(422), ["/material/fresh_density"]);
    server.stop().await;
}
