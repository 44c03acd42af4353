//! The golden cases on the GPU: heights within 2 mm, masses to the quantum.

use std::path::Path;

use firn::session::Clock;
use firn_engine::frame::{Backend, Work};
use firn_protocol::SessionSpec;
use firn_snow::{Grid, Shape};
use serde_json::Value;

use crate::support::*;

/// Largest difference in height [m].
const TOLERANCE: f64 = 0.002;

fn load(case: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/{case}.json"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Applies what is scheduled. A plain load stands for a plate over all columns, so a plate of the
/// same width and pressure is put on a grid that holds it.
fn apply(
    gpu: &mut dyn Backend,
    grid: &Grid,
    spec: &SessionSpec,
    entry: &Value,
    plates: &mut Plates,
) {
    let number = |name: &str| entry[name].as_f64();
    let edits = match entry["op"].as_str().unwrap() {
        "snowfall" => {
            let density = number("density").unwrap_or(spec.material.fresh_density);
            let celsius = number("temperature").unwrap_or(spec.air_temperature);
            vec![snow(grid, grid.all(), number("depth").unwrap(), density, celsius)]
        }
        "load" => {
            let side = number("b").unwrap();
            let mass = number("q").unwrap() * side * side / firn_snow::GRAVITY;
            let shape = Shape::Box { width: side, depth: side };
            vec![put(grid, "plate", mass, shape, 2.5, 2.5)]
        }
        "put" => {
            let id = entry["id"].as_str().unwrap().to_owned();
            let shape = serde_json::from_value(entry["shape"].clone()).unwrap();
            plates.push((id, number("mass").unwrap(), shape));
            vec![plates.put(grid, entry)]
        }
        "move" => vec![plates.put(grid, entry)],
        other => panic!("unknown operation {other}"),
    };
    edit(gpu, 0, edits);
}

#[derive(Default)]
struct Plates(Vec<(String, f64, Shape)>);

impl Plates {
    fn push(&mut self, plate: (String, f64, Shape)) {
        self.0.push(plate);
    }

    fn put(&self, grid: &Grid, entry: &Value) -> firn_engine::frame::Edit {
        let id = entry["id"].as_str().unwrap();
        let (_, mass, shape) = self.0.iter().find(|(name, ..)| name == id).unwrap();
        let (x, z) = (&entry["position"]["x"], &entry["position"]["z"]);
        put(grid, id, *mass, shape.clone(), x.as_f64().unwrap(), z.as_f64().unwrap())
    }
}

fn check(case: &str) {
    let Some(mut gpu) = gpu(false) else { return };
    let file = load(case);
    let mut spec: SessionSpec = serde_json::from_value(file["session"].clone()).unwrap();
    let schedule = file["schedule"].as_array().unwrap();
    let loaded = schedule.iter().any(|entry| entry["op"] == "load");
    if loaded {
        (spec.grid.width, spec.grid.depth) = (25, 25);
    }
    let grid = spec.grid;
    gpu.create(0, &level(grid, spec.material)).unwrap();
    for layer in &spec.initial_snow {
        let density = layer.density.unwrap_or(spec.material.fresh_density);
        let celsius = layer.temperature.unwrap_or(spec.air_temperature);
        edit(&mut gpu, 0, vec![snow(&grid, grid.all(), layer.depth, density, celsius)]);
    }

    let mut clock = Clock::new(spec.tick_rate, spec.time_scale);
    let mut schedule = schedule.iter().peekable();
    let mut plates = Plates::default();
    for expected in file["expect"].as_array().unwrap() {
        let tick = expected["tick"].as_u64().unwrap();
        loop {
            // At tick 0 the state is expected after what is scheduled, later before it.
            let next = schedule.peek().map(|entry| entry["at"].as_u64().unwrap());
            let until =
                next.filter(|&at| at < tick || at == 0).map_or(tick, |at| at.max(clock.tick()));
            while clock.tick() < until {
                let advance = clock.advance(until - clock.tick(), 1000);
                let run = advance.run;
                work(&mut gpu, Work { slot: 0, run, wake: run.cycles > 0, ..Work::default() });
            }
            match next {
                Some(at) if at < tick || at == 0 => {
                    apply(&mut gpu, &grid, &spec, schedule.next().unwrap(), &mut plates);
                }
                _ => break,
            }
        }
        compare_state(case, &mut gpu, &grid, expected, loaded);
    }
}

fn compare_state(case: &str, gpu: &mut dyn Backend, grid: &Grid, expected: &Value, loaded: bool) {
    let tick = &expected["tick"];
    let tiles = cells(gpu, 0, grid);
    let found = heights(&tiles, grid);
    if let Some(heights) = expected["heights"].as_array() {
        assert_eq!(found.len(), heights.len());
        for (i, (found, height)) in found.iter().zip(heights).enumerate() {
            let height = height.as_f64().unwrap();
            let apart = (found - height).abs();
            assert!(apart <= 0.004, "{case}, tick {tick}, column {i}: {found} m for {height} m");
        }
    }
    let Some(height) = expected["height"].as_f64() else { return };
    let (tile, column) = grid.locate(grid.width / 2, grid.depth / 2);
    let at_centre = found[(grid.depth / 2 * grid.width + grid.width / 2) as usize];
    for &found in if loaded { std::slice::from_ref(&at_centre) } else { &found } {
        assert!(
            (found - height).abs() <= TOLERANCE,
            "{case}, tick {tick}: {found} m for {height} m"
        );
    }
    let mass: u64 = tiles[tile as usize].column(column).map(|cell| u64::from(cell.mass)).sum();
    let wanted = expected["mass_per_area"].as_f64().unwrap() * firn_snow::MASS_QUANTA;
    assert_eq!(mass, wanted.round() as u64, "{case}, tick {tick}: mass");
}

macro_rules! cases {
    ($($name:ident: $case:literal),* $(,)?) => {
        $(#[test] fn $name() { check($case); })*
    };
}

cases! {
    experiment_1a: "1a",
    experiment_1b: "1b",
    experiment_2: "2",
    experiment_3: "3",
    half_cell: "half-cell",
    fast: "fast",
    slow: "slow",
    gold: "gold",
    regression: "regression",
    collider_1: "collider-1",
    collider_2: "collider-2",
    collider_3: "collider-3",
    track: "track",
}
