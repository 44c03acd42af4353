//! A measured season. The measurements are not part of this repository.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{json, text};

/// A file of the measured season; none where it is not at hand, which is said.
fn col_de_porte(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/cdp_0506").join(name);
    if path.is_file() {
        return Some(path);
    }
    eprintln!("NOT TESTED: {} is not there", path.display());
    None
}

/// Runs the measured season beside a file.
fn measured_season(beside: &str, arguments: &[&str]) -> Option<Value> {
    let (forcing, beside) = (col_de_porte("forcing.csv")?, col_de_porte(beside)?);
    Some(json(&forcing, &[&["--evaluation", text(&beside)], arguments].concat()))
}

#[track_caller]
fn at_most(outcome: &Value, limits: &[(&str, f64)]) {
    for &(name, limit) in limits {
        let value = outcome[name].as_f64().unwrap_or_else(|| panic!("{name}: {outcome}"));
        assert!(value.abs() <= limit, "{name} is {value}, not at most {limit}");
    }
    assert_eq!(outcome["imbalance_quanta"], 0);
}

#[test]
fn a_measured_season_meets_the_independent_program() {
    let Some(outcome) = measured_season("reference_alpine_daily.csv", &[]) else { return };
    at_most(&outcome, &[("depth_rmse_m", 0.015), ("swe_rmse_kgm2", 5.0), ("tsurf_rmse_k", 0.3)]);
}

#[test]
fn a_measured_season_meets_its_measurements() {
    let Some(outcome) = measured_season("evaluation.csv", &[]) else { return };
    at_most(
        &outcome,
        &[
            ("depth_rmse_m", 0.08),
            ("swe_rmse_kgm2", 28.0),
            ("tsurf_rmse_k", 1.4),
            ("melt_out_days", 5.0),
        ],
    );
}

#[test]
fn sizes_of_cells_and_of_steps_hardly_matter() {
    for arguments in [
        ["--cell-size", "0.02"],
        ["--cell-size", "0.1"],
        ["--cell-size", "0.2"],
        ["--weather-step", "60"],
        ["--weather-step", "3600"],
    ] {
        let Some(outcome) = measured_season("evaluation.csv", &arguments) else { return };
        at_most(&outcome, &[("depth_rmse_m", 0.08)]);
    }
}
