//! The program's `season`: on weather that the test makes, on files that are wrong, and beside a measured season.

mod measured;
mod refusals;
mod weather;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

use weather::{SNOWFALL, csv, hours, smet};

/// A folder of its own for a test.
fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("season").join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a folder");
    path
}

fn file(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("it can be written");
    path
}

/// Runs the program.
fn season(forcing: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_firn"))
        .arg("season")
        .arg("--forcing")
        .arg(forcing)
        .args(arguments)
        .output()
        .expect("the program runs")
}

/// What it prints, where it succeeds; without a terminal it says nothing else.
#[track_caller]
fn said(forcing: &Path, arguments: &[&str]) -> String {
    let output = season(forcing, arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!((output.status.code(), &*errors), (Some(0), ""), "{arguments:?}");
    String::from_utf8(output.stdout).expect("it is text")
}

#[track_caller]
fn json(forcing: &Path, arguments: &[&str]) -> Value {
    let text = said(forcing, &[arguments, &["--json"]].concat());
    serde_json::from_str(&text).expect("one JSON object")
}

/// What it says where it can't.
#[track_caller]
fn refused(forcing: &Path, arguments: &[&str], code: i32) -> String {
    let output = season(forcing, arguments);
    let errors = String::from_utf8(output.stderr).expect("it is text");
    assert_eq!(output.status.code(), Some(code), "{errors}");
    assert!(errors.starts_with("error: "), "{errors}");
    errors
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// The values of a day in `daily.csv`.
fn day(folder: &Path, index: usize) -> Vec<f64> {
    let daily = std::fs::read_to_string(folder.join("daily.csv")).expect("it was written");
    let line = daily.lines().nth(index + 1).expect("that day");
    line.split(',').skip(1).map(|value| value.parse().expect("a number")).collect()
}

#[test]
fn a_season_is_told_written_and_drawn() {
    let here = folder("whole");
    let forcing = file(&here, "forcing.csv", &csv(&hours(6)));
    let measured = "date,depth_m,swe_kgm2,tsurf_c,tsurf_n,albedo,runoff_kgm2d\n\
                    2024-02-27,0.1,,-9.5,24,,0\n2024-02-28,0.14,14,,0,0.9,\n2024-03-03,0,0,,,0.2,1\n";
    let evaluation = file(&here, "evaluation.csv", measured);
    let out = here.join("out");
    let frozen = ["--soil", "-1,-1,-1,-1"];
    let files = ["--evaluation", text(&evaluation), "--out", text(&out)];
    let told = said(&forcing, &[frozen.as_slice(), &files].concat());
    for words in [
        "2024-02-27 to 2024-03-03, 6 days",
        "1 column of 255 cells of 0.05 m, steps of 900 s",
        "beside what was measured",
        "melt-out",
        "measured 2024-03-03",
    ] {
        assert!(told.contains(words), "{words}: {told}");
    }
    let imbalance = told.lines().find(|line| line.contains("imbalance")).expect("the ledger");
    assert!(imbalance.trim_end().ends_with(" 0 quanta"), "{imbalance}");

    let files: BTreeSet<String> = (std::fs::read_dir(&out).expect("it is there"))
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    let figures = ["albedo", "depth", "runoff", "surface-temperature", "swe"];
    let expected = figures.iter().map(|name| format!("{name}.svg")).chain(["daily.csv".to_owned()]);
    assert_eq!(files, expected.collect());
    for name in figures {
        let svg = std::fs::read_to_string(out.join(format!("{name}.svg"))).unwrap();
        assert!(svg.starts_with("<svg width=\"800\"") && svg.trim_end().ends_with("</svg>"));
        assert!(svg.contains("measured") && svg.contains("Mar"), "{name}");
    }
    let daily = std::fs::read_to_string(out.join("daily.csv")).unwrap();
    let names = "date,depth_m,swe_kgm2,lwc_kgm2,tsurf_c,albedo_eff,runoff_kgm2d,cells";
    assert_eq!((daily.lines().next(), daily.lines().count()), (Some(names), 7));
    // Of the states at full hours the one at seven has half of the snow, and 17 have all.
    let first = day(&out, 0);
    let fallen = 7200.0 * SNOWFALL;
    assert!((first[1] / fallen - 17.5 / 24.0).abs() < 0.015, "{first:?}");
    assert!(first[0] > 0.05 && first[3] < -5.0 && first[4] > 0.5, "{first:?}");
    assert_eq!((first[2], first[5]), (0.0, 0.0), "it is cold");
    let runoff: f64 = (0..6).map(|index| day(&out, index)[5]).sum();
    assert!((runoff / fallen - 1.0).abs() < 0.1, "{runoff} of {fallen} runs off");
}

#[test]
fn without_measurements_there_is_nothing_to_compare() {
    let here = folder("alone");
    let forcing = file(&here, "forcing.csv", &csv(&hours(3)));
    let out = here.join("out");
    let outcome = json(&forcing, &["--out", text(&out), "--columns", "9x3"]);
    let names: Vec<&String> = outcome.as_object().expect("an object").keys().collect();
    let expected = [
        "depth_bias_m",
        "depth_rmse_m",
        "imbalance_quanta",
        "melt_out_days",
        "seconds",
        "swe_bias_kgm2",
        "swe_rmse_kgm2",
        "tsurf_rmse_k",
    ];
    assert_eq!(names.iter().map(|name| name.as_str()).collect::<BTreeSet<_>>(), expected.into());
    for name in
        names.iter().filter(|name| !["imbalance_quanta", "seconds"].contains(&name.as_str()))
    {
        assert_eq!(outcome[name.as_str()], Value::Null, "{name}");
    }
    assert_eq!(outcome["imbalance_quanta"], 0);
    assert!(outcome["seconds"].as_f64().is_some_and(|seconds| seconds >= 0.0));
    assert!(!out.join("albedo.svg").exists() && out.join("depth.svg").exists());
    assert!(!said(&forcing, &[]).contains("beside what was measured"));

    // Many columns are as one.
    let one = here.join("one");
    json(&forcing, &["--out", text(&one)]);
    for index in 0..3 {
        assert_eq!(day(&one, index), day(&out, index));
    }
}

#[test]
fn smet_equals_csv() {
    let here = folder("smet");
    let hours = hours(6);
    let forcing = file(&here, "forcing.csv", &csv(&hours));
    let evaluation = here.join("csv/daily.csv");
    let [csv, same, ended] = ["csv", "same", "ended"].map(|name| here.join(name));
    json(&forcing, &["--out", text(&csv)]);
    let station = file(&here, "station.smet", &smet(&hours, 0));
    json(&station, &["--out", text(&same)]);
    // Rows that are stamped when they have ended.
    let end = file(&here, "end.smet", &smet(&hours, 1));
    json(&end, &["--out", text(&ended), "--stamps", "end"]);
    for other in [same, ended] {
        for index in 0..6 {
            let pairs = day(&csv, index).into_iter().zip(day(&other, index));
            for (a, b) in pairs {
                assert!((a - b).abs() <= 1e-3 * a.abs().max(0.1), "{}: {a} {b}", other.display());
            }
        }
    }
    let outcome = json(&station, &["--evaluation", text(&evaluation)]);
    assert!(outcome["depth_rmse_m"].as_f64().is_some_and(|rmse| rmse < 1e-4), "{outcome}");
    assert_eq!(outcome["melt_out_days"], 0);

    // Without the phase, it snows up to 1.2 °C; without a pressure, the altitude tells it.
    let text = smet(&hours, 0).replace(" P TA", " X TA").replace("PSUM_PH", "Y");
    let outcome =
        json(&file(&here, "plain.smet", &text), &["--evaluation", self::text(&evaluation)]);
    assert!(outcome["depth_rmse_m"].as_f64().is_some_and(|rmse| rmse < 0.01), "{outcome}");
}
