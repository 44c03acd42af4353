//! The reference snowpack reproduces every golden case.

use std::collections::BTreeMap;
use std::sync::Arc;

use firn::session::Clock;
use firn_snow::{
    Column, Contact, Cover, Footprint, Grid, MASS_QUANTA, Material, Position, Shape, Snowpack,
    SurfaceLoad, Turn,
};
use serde::Deserialize;

const DIRECTORY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden");

#[derive(Deserialize)]
struct Case {
    session: Spec,
    schedule: Vec<Scheduled>,
    expect: Vec<Expected>,
    tolerance: Tolerance,
}

#[derive(Deserialize)]
struct Spec {
    grid: Grid,
    material: Material,
    tick_rate: f64,
    time_scale: f64,
    initial_snow: Vec<Snowfall>,
}

#[derive(Deserialize, Clone, Copy)]
struct Snowfall {
    depth: f64,
    temperature: f32,
}

#[derive(Deserialize)]
struct Scheduled {
    at: u64,
    #[serde(flatten)]
    op: Op,
}

#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "lowercase")]
enum Op {
    Snowfall(Snowfall),
    Load { q: f32, b: f32 },
    Put { id: String, mass: f64, shape: Shape, position: Position },
    Move { id: String, position: Position },
}

#[derive(Deserialize)]
struct Expected {
    tick: u64,
    height: Option<f64>,
    mass_per_area: Option<f64>,
    refused_per_area: Option<f64>,
    #[serde(default)]
    layers_bottom_up: Vec<Layer>,
    heights: Option<Vec<f64>>,
    #[serde(default)]
    colliders: BTreeMap<String, Touch>,
}

#[derive(Deserialize)]
struct Layer {
    thickness: f64,
    density: f64,
    temperature: f64,
}

#[derive(Deserialize)]
struct Touch {
    bottom: f64,
    contact_area: f64,
    pressure: f64,
}

#[derive(Deserialize)]
struct Tolerance {
    height: f64,
    thickness: Option<f64>,
    density: Option<f64>,
    temperature: Option<f64>,
    pressure_relative: Option<f64>,
}

/// A case as it runs.
struct Trial {
    spec: Spec,
    clock: Clock,
    snowpack: Snowpack,
    refused: u64,
    /// From a `load` on, the column that carries it and stands for all.
    loaded: Option<(Column, SurfaceLoad)>,
    colliders: BTreeMap<String, (f64, Shape)>,
}

fn mass_quanta(per_area: f64) -> u64 {
    (per_area * MASS_QUANTA).round() as u64
}

fn near(what: &str, actual: f64, expected: f64, tolerance: f64) {
    let off = actual - expected;
    assert!(off.abs() <= tolerance, "{what}: {actual} is {off} off {expected}");
}

impl Trial {
    fn new(spec: Spec) -> Trial {
        let mut trial = Trial {
            clock: Clock::new(spec.tick_rate, spec.time_scale),
            snowpack: Snowpack::new(spec.grid, spec.material, &[], false).unwrap(),
            spec,
            refused: 0,
            loaded: None,
            colliders: BTreeMap::new(),
        };
        for layer in trial.spec.initial_snow.clone() {
            trial.snow(layer);
        }
        trial
    }

    fn snow(&mut self, fall: Snowfall) {
        let (grid, material) = (&self.spec.grid, &self.spec.material);
        let depth = grid.thickness_quanta(fall.depth) as u32;
        let mass = mass_quanta(fall.depth * material.fresh_density) as u32;
        self.refused += self.snowpack.deposit(grid.all(), depth, mass, fall.temperature);
    }

    fn put(&mut self, id: &str, position: Position) {
        let (mass, shape) = &self.colliders[id];
        let footprint = Footprint::new(&self.spec.grid, shape, position, Turn::NONE);
        self.snowpack.put_collider(Arc::from(id), *mass, Cover::default(), vec![footprint], true);
    }

    fn apply(&mut self, op: &Op) {
        match op {
            Op::Snowfall(fall) => self.snow(*fall),
            Op::Load { q, b } => {
                let load = SurfaceLoad { pressure: *q, width: *b };
                self.loaded = Some((self.snowpack.column(0, 0).clone(), load));
            }
            Op::Put { id, mass, shape, position } => {
                self.colliders.insert(id.clone(), (*mass, shape.clone()));
                self.put(id, *position);
            }
            Op::Move { id, position } => self.put(id, *position),
        }
    }

    fn advance_to(&mut self, tick: u64) {
        while self.clock.tick() < tick {
            let run = self.clock.advance(tick - self.clock.tick(), u32::MAX).run;
            let Some((column, load)) = &mut self.loaded else {
                self.snowpack.run(run.cycles, run.dt);
                continue;
            };
            for _ in 0..run.cycles {
                column.stress(&self.spec.grid, &self.spec.material, &[*load]);
                column.compact(&self.spec.grid, &self.spec.material, 1, run.dt as f32);
            }
        }
    }

    fn columns(&self) -> Vec<&Column> {
        if let Some((column, _)) = &self.loaded {
            return vec![column];
        }
        let (width, depth) = (self.spec.grid.width, self.spec.grid.depth);
        (0..depth)
            .flat_map(|z| (0..width).map(move |x| (x, z)))
            .map(|(x, z)| self.snowpack.column(x, z))
            .collect()
    }

    fn check(&self, expected: &Expected, tolerance: &Tolerance) {
        let grid = &self.spec.grid;
        let columns = self.columns();
        if let Some(height) = expected.height {
            assert!(columns.iter().all(|&column| column == columns[0]), "all columns are equal");
            let actual = grid.metres(u64::from(columns[0].height()));
            near("height", actual, height, tolerance.height);
        }
        if let Some(mass) = expected.mass_per_area {
            assert_eq!(u64::from(columns[0].mass()), mass_quanta(mass), "mass");
        }
        if let Some(refused) = expected.refused_per_area {
            assert_eq!(self.refused, mass_quanta(refused) * grid.columns(), "refused");
        }
        if !expected.layers_bottom_up.is_empty() {
            self.check_layers(columns[0], &expected.layers_bottom_up, tolerance);
        }
        if let Some(heights) = &expected.heights {
            assert_eq!(columns.len(), heights.len());
            for (i, (column, height)) in columns.iter().zip(heights).enumerate() {
                let actual = grid.metres(u64::from(column.height()));
                near(&format!("height of column {i}"), actual, *height, tolerance.height);
            }
        }
        for (id, touch) in &expected.colliders {
            self.check_contact(id, touch, tolerance);
        }
    }

    fn check_layers(&self, column: &Column, layers: &[Layer], tolerance: &Tolerance) {
        assert_eq!(column.cells.len(), layers.len(), "layers");
        for (i, (cell, layer)) in column.cells.iter().zip(layers).enumerate() {
            let thickness = self.spec.grid.metres(u64::from(cell.thickness));
            let density = f64::from(cell.mass) / MASS_QUANTA / thickness;
            let within = |what: &str, actual, expected, tolerance: Option<f64>| {
                let tolerance = tolerance.expect("a tolerance for layers");
                near(&format!("{what} of layer {i}"), actual, expected, tolerance);
            };
            within("thickness", thickness, layer.thickness, tolerance.thickness);
            within("density", density, layer.density, tolerance.density);
            let temperature = f64::from(cell.temperature);
            within("temperature", temperature, layer.temperature, tolerance.temperature);
        }
    }

    fn check_contact(&self, id: &str, touch: &Touch, tolerance: &Tolerance) {
        let (_, contact): (_, &Contact) =
            self.snowpack.contacts().find(|(name, _)| &***name == id).expect("it stands there");
        let relative = tolerance.pressure_relative.expect("a tolerance for pressures");
        let bottom = contact.bottom.metres(&self.spec.grid);
        near(&format!("bottom of {id}"), bottom, touch.bottom, tolerance.height);
        let (area, pressure) = (f64::from(contact.area), f64::from(contact.pressure));
        near(&format!("area of {id}"), area, touch.contact_area, relative * touch.contact_area);
        near(&format!("pressure of {id}"), pressure, touch.pressure, relative * touch.pressure);
    }
}

fn run(name: &str) {
    let path = format!("{DIRECTORY}/{name}.json");
    let text = std::fs::read_to_string(&path).expect("the case is there");
    let case: Case = serde_json::from_str(&text).expect("the case is in the known form");
    let mut trial = Trial::new(case.session);
    let mut ticks: Vec<u64> = case.expect.iter().map(|expected| expected.tick).collect();
    ticks.extend(case.schedule.iter().map(|scheduled| scheduled.at));
    ticks.sort_unstable();
    ticks.dedup();
    for tick in ticks {
        trial.advance_to(tick);
        let check = |trial: &Trial| {
            for expected in case.expect.iter().filter(|expected| expected.tick == tick) {
                println!("{name} at tick {tick}");
                trial.check(expected, &case.tolerance);
            }
        };
        // What is expected holds before what is scheduled at a tick, but for tick 0.
        if tick > 0 {
            check(&trial);
        }
        for scheduled in case.schedule.iter().filter(|scheduled| scheduled.at == tick) {
            trial.apply(&scheduled.op);
        }
        if tick == 0 {
            check(&trial);
        }
    }
}

macro_rules! cases {
    ($($test:ident: $name:literal,)*) => {
        $(
            #[test]
            fn $test() {
                run($name);
            }
        )*

        #[test]
        fn every_golden_file_has_its_test() {
            let mut names = vec![$($name.to_string(),)*];
            names.sort();
            let mut files: Vec<String> = std::fs::read_dir(DIRECTORY)
                .expect("the directory is there")
                .map(|entry| entry.expect("an entry").path())
                .filter(|path| path.extension().is_some_and(|extension| extension == "json"))
                .map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned())
                .collect();
            files.sort();
            assert_eq!(files, names);
        }
    };
}

cases! {
    experiment_1a: "1a",
    experiment_1b: "1b",
    experiment_2: "2",
    experiment_3: "3",
    half_cell: "half-cell",
    two_cycles_a_tick: "fast",
    ticks_that_save_up_time: "slow",
    hardness_law_gold: "gold",
    hardness_law_regression: "regression",
    collider_1: "collider-1",
    collider_2: "collider-2",
    collider_3: "collider-3",
    track: "track",
}
