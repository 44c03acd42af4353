//! Snow that falls all the time: how much of it lies where, and when.

use firn::config::BackendChoice;
use serde_json::{Value, json};

use crate::on_each_backend;
use crate::support::{Server, numbers, skips_gpu, small};

on_each_backend!(
    snow_keeps_falling_at_a_rate,
    on_a_large_world_snow_is_laid_little_by_little_with_the_same_sum,
    in_the_middle_of_being_laid_snow_is_the_same_however_it_got_there,
    when_it_stops_snowing_what_has_fallen_lies_everywhere,
);

/// Columns of a large world, which has its snow in 8 bands of 64 rows of columns.
const WIDTH: usize = 64;
const DEPTH: usize = 512;

/// Ticks in which h/256 falls, at 1 m/h.
const PERIOD: u64 = 169;

/// A large world without snow, on which a metre falls in an hour.
fn large() -> Value {
    json!({
        "grid": {"width": WIDTH, "depth": DEPTH, "height": 4, "cell_size": 0.2},
        "paused": true, "snowfall_rate": 1,
    })
}

/// Depths of the first column of each row, in quanta of thickness.
async fn depths(server: &Server, path: &str) -> Vec<u64> {
    let heights = server.get(&format!("{path}/heights")).await.expect(200);
    let heights = numbers(&heights["heights"]);
    let quanta = |metres: f64| (metres / 0.2 * f64::from(1 << 24)).round() as u64;
    for row in heights.chunks_exact(WIDTH) {
        assert!(row.iter().all(|height| *height == row[0]), "{row:?}");
    }
    heights.iter().step_by(WIDTH).map(|metres| quanta(*metres)).collect()
}

/// All mass that has fallen, in quanta of 2⁻¹⁸ kg/m² on columns of 0.04 m².
fn mass_quanta(mass: &Value) -> u64 {
    (mass["fallen"].as_f64().expect("a mass") / 0.04 * f64::from(1 << 18)).round() as u64
}

async fn digest(server: &Server, path: &str) -> Value {
    server.get(&format!("{path}/digest")).await.expect(200)["digest"].clone()
}

async fn snow_keeps_falling_at_a_rate(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let mut spec = small();
    spec["initial_snow"] = json!([]);
    spec["snowfall_rate"] = json!(72);
    let path = server.create(spec).await;
    // 72 m/h for 10 s are 0.2 m, of 20 kg/m³ on 2.8 m².
    let stepped = server.step(&path, 600).await;
    assert_eq!(stepped["settled"], false);
    let mass = server.get(&format!("{path}/mass")).await.expect(200);
    let fallen = mass["fallen"].as_f64().unwrap();
    assert!((fallen - 0.2 * 20.0 * 2.8).abs() < 0.02 * 11.2, "{mass}");
    assert_eq!(mass["imbalance_quanta"], 0);
    server.stop().await;
}

async fn on_a_large_world_snow_is_laid_little_by_little_with_the_same_sum(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(large()).await;
    let mut same = small();
    (same["snowfall_rate"], same["initial_snow"]) = (json!(1), json!([]));
    let same = server.create(same).await;
    // What the columns of a small world have at the same tick, and had a period before.
    let (mut now, mut before, mut masses) = (0, 0, (0, 0));
    let mut uneven = 0;
    for period in 0..4 {
        for _ in 0..PERIOD {
            server.step(&path, 1).await;
            server.step(&same, 1).await;
            let whole = server.get(&format!("{same}/heights")).await.expect(200);
            let whole = (numbers(&whole["heights"])[0] / 0.2 * f64::from(1 << 24)).round() as u64;
            if whole > now {
                (now, before) = (whole, now);
                let mass = server.get(&format!("{same}/mass")).await.expect(200);
                masses = (mass_quanta(&mass) / 70, masses.0);
            }
            let depths = depths(&server, &path).await;
            let laid = depths.partition_point(|depth| *depth == now);
            assert!(depths[laid..].iter().all(|depth| *depth == before), "{depths:?}");
            assert!(now == 0 || laid >= 64, "the first band has it at once");
            uneven += u32::from(laid < DEPTH);
            let mass = server.get(&format!("{path}/mass")).await.expect(200);
            assert_eq!(mass["imbalance_quanta"], 0);
            assert_eq!((&mass["refused"], &mass["present"]), (&json!(0.0), &mass["fallen"]));
            let rows = laid as u64 * masses.0 + (DEPTH - laid) as u64 * masses.1;
            assert_eq!(mass_quanta(&mass), rows * WIDTH as u64, "to the quantum");
        }
        assert!(period == 0 || now > before);
    }
    assert!(u64::from(uneven) > 2 * PERIOD, "it is laid little by little");
    server.stop().await;
}

async fn in_the_middle_of_being_laid_snow_is_the_same_however_it_got_there(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let ticks = PERIOD + 70;
    let at_once = server.create(large()).await;
    server.step(&at_once, ticks).await;
    let uneven = depths(&server, &at_once).await;
    assert!(uneven[0] > 0 && uneven[DEPTH - 1] == 0, "{uneven:?}");
    let in_parts = server.create(large()).await;
    for part in [PERIOD - 1, 1, 1, 40, 29] {
        server.step(&in_parts, part).await;
    }
    assert_eq!(digest(&server, &in_parts).await, digest(&server, &at_once).await);

    let media_type = "application/vnd.firn.snapshot";
    let saved = server.get(&format!("{at_once}/snapshot")).await.body;
    let restored = server.post_bytes("/v1/sessions?id=again", media_type, saved).await.expect(201);
    assert_eq!(restored["id"], "again");
    let again = "/v1/sessions/again";
    assert_eq!(digest(&server, again).await, digest(&server, &at_once).await);
    // Snow that is still to be laid is as cold as it was when it fell.
    for path in [&at_once, again] {
        let air = json!({"celsius": -9});
        server.put(&format!("{path}/air-temperature"), air).await.expect(200);
        server.step(path, 500).await;
    }
    assert_eq!(digest(&server, again).await, digest(&server, &at_once).await);
    let column = server.get(&format!("{again}/columns/3/{}", DEPTH - 1)).await.expect(200);
    assert_eq!(column["layers"][0]["temperature"], -3.0, "{column}");
    server.stop().await;
}

async fn when_it_stops_snowing_what_has_fallen_lies_everywhere(backend: BackendChoice) {
    let server = Server::start(backend).await;
    let path = server.create(large()).await;
    let view = server.step(&path, PERIOD + 70).await;
    assert_eq!(view["settled"], false);
    server.patch(&path, json!({"snowfall_rate": 0})).await.expect(200);
    let depths = depths(&server, &path).await;
    assert!(depths[0] > 0 && depths.iter().all(|depth| *depth == depths[0]), "{depths:?}");
    let mass = server.get(&format!("{path}/mass")).await.expect(200);
    assert_eq!(mass["imbalance_quanta"], 0);
    let step = json!({"until_settled": true, "max_seconds": 10});
    let settled = server.post(&format!("{path}/step"), step).await.expect(200);
    assert_eq!(settled["settled"], true, "{settled}");
    server.stop().await;
}

/// Nothing gives way in so thin a snowpack: all of it are integers.
#[tokio::test(flavor = "multi_thread")]
async fn both_backends_lay_the_same_quanta() {
    if skips_gpu() {
        eprintln!("SKIPPED: FIRN_SKIP_GPU_TESTS=1");
        return;
    }
    let mut found = Vec::new();
    for backend in [BackendChoice::Cpu, BackendChoice::Gpu] {
        let server = Server::start(backend).await;
        let path = server.create(large()).await;
        let mut states = Vec::new();
        for ticks in [PERIOD, 1, 30, 101, 600] {
            server.step(&path, ticks).await;
            let mass = server.get(&format!("{path}/mass")).await.expect(200);
            states.push((depths(&server, &path).await, mass["fallen"].clone()));
        }
        states.push((Vec::new(), digest(&server, &path).await));
        found.push(states);
        server.stop().await;
    }
    assert_eq!(found[0], found[1]);
}
