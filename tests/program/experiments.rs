//! The thesis's experiments through sessions, on each backend, and the program's `experiment`.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use firn::backend;
use firn::config::{BackendChoice, EngineConfig};
use firn::driver::{Driver, WorldConfig};
use firn::experiment::{self, Experiment, ExperimentError, Study};
use firn::session::{Limits, Sessions};
use firn_protocol::ColumnView;

/// Columns along each side of a small grid, whose last tiles are partly covered.
const SMALL: u32 = 9;

fn start(backend: BackendChoice) -> (Sessions, Driver) {
    let engine = EngineConfig { backend, device_memory: None };
    let backend = backend::open(&engine).expect("a graphics adapter to test");
    let limits = Limits {
        sessions: 1,
        columns_per_session: 1 << 20,
        columns: 1 << 40,
        cells_per_session: 1 << 20,
        cells: 1 << 20,
        colliders_per_session: 3,
    };
    let config = WorldConfig { limits, publish_rate: 20.0, sleep: true };
    Driver::start(backend, config).expect("the world starts")
}

fn run(
    sessions: &Sessions,
    experiment: Experiment,
    side: u32,
    progress: &dyn Fn(u64),
) -> Result<Vec<Study>, ExperimentError> {
    let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
    runtime.block_on(experiment::run(sessions, experiment, side, progress))
}

/// Carries an experiment out; `None` where the environment says that there is no GPU to test.
fn studies(experiment: Experiment, side: u32, backend: BackendChoice) -> Option<Vec<Study>> {
    let skipped = std::env::var_os("FIRN_SKIP_GPU_TESTS").is_some_and(|value| value == "1");
    if backend == BackendChoice::Gpu && skipped {
        eprintln!("IGNORED: FIRN_SKIP_GPU_TESTS=1, the GPU is not tested");
        return None;
    }
    let (sessions, world) = start(backend);
    let ticks = Cell::new(0);
    let progress = |taken| ticks.set(ticks.get() + taken);
    let studies = run(&sessions, experiment, side, &progress).expect("it is carried out");
    assert_eq!(ticks.get(), experiment.ticks(), "progress is told to the end");
    assert_eq!(sessions.count(), 0, "nothing is left behind");
    world.stop();
    Some(studies)
}

/// Carries an experiment out and sees to it that nothing deviates.
fn meets_the_oracle(experiment: Experiment, side: u32, backend: BackendChoice) {
    for study in studies(experiment, side, backend).unwrap_or_default() {
        assert_eq!(study.deviations(), Vec::<String>::new(), "{study}");
        assert!(study.rows.len() > 5, "{study}");
    }
}

/// Layer fidelity: cutting columns anew does not smear the cold snow.
fn keeps_its_layers(backend: BackendChoice) {
    let Some(studies) = studies(Experiment::Three, SMALL, backend) else { return };
    assert_eq!(studies[0].deviations(), Vec::<String>::new(), "{}", studies[0]);
    let column: &ColumnView = &studies[0].profiles.last().expect("a final state").column;
    let cold: Vec<_> = column.layers.iter().filter(|layer| layer.temperature < -12.0).collect();
    let thickness: f64 = cold.iter().map(|layer| layer.thickness).sum();
    assert!(thickness >= 0.80, "{thickness} m are colder than −12 °C");
    let coldest = column.layers.iter().map(|layer| layer.temperature).fold(0.0, f64::min);
    assert!(coldest <= -14.9, "the coldest is at {coldest} °C");

    assert_eq!(column.weak_layers.len(), 1, "{:?}", column.weak_layers);
    let weak = &column.weak_layers[0];
    assert_eq!(cold.len(), 5, "the cells of the cold snowfall");
    assert!((weak.bottom - cold[0].bottom).abs() < 1e-9, "it begins with them");
    assert!((weak.thickness - thickness).abs() < 1e-9, "and ends with them");
}

macro_rules! on_each_backend {
    ($($name:ident => |$backend:ident| $check:expr;)*) => {
        $(mod $name {
            use super::*;

            #[test]
            fn on_the_cpu() {
                let $backend = BackendChoice::Cpu;
                $check;
            }

            #[test]
            fn on_the_gpu() {
                let $backend = BackendChoice::Gpu;
                $check;
            }
        })*
    };
}

on_each_backend! {
    experiment_1a => |backend| meets_the_oracle(Experiment::OneA, SMALL, backend);
    experiment_1b => |backend| meets_the_oracle(Experiment::OneB, SMALL, backend);
    experiment_2 => |backend| meets_the_oracle(Experiment::Two, SMALL, backend);
    experiment_3_keeps_its_weak_layer => |backend| keeps_its_layers(backend);
    // The objects are metres wide: they need the whole grid.
    colliders => |backend| meets_the_oracle(Experiment::Colliders, experiment::SIDE, backend);
    prototype => |backend| meets_the_oracle(Experiment::Prototype, 1, backend);
}

#[test]
fn objects_that_do_not_fit_are_refused() {
    let (sessions, world) = start(BackendChoice::Cpu);
    assert!(run(&sessions, Experiment::Colliders, SMALL, &|_| {}).is_err());
    assert_eq!(sessions.count(), 0, "nothing is left behind");
    world.stop();
}

/// Runs the program.
fn firn(arguments: &[&str], out: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_firn"))
        .arg("experiment")
        .args(arguments)
        .args(["--backend", "cpu", "--out"])
        .arg(out)
        .output()
        .expect("the program runs")
}

/// A directory that is not there yet.
fn directory(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("experiments").join(name);
    let _ = std::fs::remove_dir_all(&path);
    path
}

#[test]
fn the_program_prints_tables_and_writes_figures_and_numbers() {
    let out = directory("prototype");
    let output = firn(&["prototype"], &out);
    let printed = String::from_utf8(output.stdout).expect("UTF-8");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{printed}{errors}");
    assert_eq!(errors, "", "no progress bar where there is no terminal");
    let row = "  compaction starts at −10 °C [m]   deeper     3.0    3.0";
    assert!(printed.lines().any(|line| line == row), "{printed}");

    let files: BTreeSet<String> = std::fs::read_dir(&out)
        .expect("the directory is there")
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    let kinds =
        ["density.svg", "hardness.svg", "height.svg", "stress.svg", "layers.csv", "heights.csv"];
    assert_eq!(files, kinds.iter().map(|kind| format!("prototype-{kind}")).collect());
    let read = |kind: &str| std::fs::read_to_string(out.join(format!("prototype-{kind}"))).unwrap();
    for (kind, axes) in [
        ("density.svg", ["density [kg/m³]", "depth below the surface [m]"]),
        ("hardness.svg", ["density [kg/m³]", "hardness, stress [Pa]"]),
        ("height.svg", ["simulated time [s]", "height [m]"]),
        ("stress.svg", ["stress, hardness [Pa]", "depth below the surface [m]"]),
    ] {
        let svg = read(kind);
        assert!(svg.starts_with("<svg width=\"800\"") && svg.trim_end().ends_with("</svg>"));
        for text in axes.into_iter().chain(["−3 °C", "−10 °C"]) {
            assert!(svg.contains(text), "{kind}: {text}");
        }
    }
    let layers = read("layers.csv");
    assert_eq!(layers.lines().count(), 1 + 2 * 40, "a line for each cell of each column");
    let heights = read("heights.csv");
    assert_eq!(heights.lines().next(), Some("time_s,−3 °C [m],−10 °C [m]"));
    assert_eq!(heights.lines().nth(1), Some("0.000,8.000000,8.000000"));
    assert_eq!(heights.lines().count(), 1 + 1 + 60, "a line for each 2 s");
}

#[test]
fn the_program_says_what_it_can_not_do() {
    let output = firn(&["4"], &directory("none"));
    assert_eq!(output.status.code(), Some(2));

    let taken = directory("taken");
    std::fs::create_dir_all(taken.parent().unwrap()).unwrap();
    let _ = std::fs::remove_file(&taken);
    std::fs::write(&taken, "a file").unwrap();
    let output = firn(&["prototype"], &taken);
    assert_eq!(output.status.code(), Some(1));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(errors.starts_with("error: ") && errors.contains("taken"), "{errors}");
}
