//! Files and options that are wrong.

use std::path::Path;

use super::weather::{csv, hours, smet};
use super::{file, folder, refused, text};

/// Runs the program on a file that is wrong; it names the file and says all of some words.
#[track_caller]
fn wrong(here: &Path, name: &str, content: &str, words: &[&str]) {
    let errors = refused(&file(here, name, content), &[], 1);
    for word in words.iter().chain([&name]) {
        assert!(errors.contains(word), "{word}: {errors}");
    }
}

#[test]
fn what_is_wrong_with_a_file_is_said_with_its_line_and_column() {
    let here = folder("wrong");
    let good = csv(&hours(2));
    let wrong = |name: &str, text: &str, words: &[&str]| wrong(&here, name, text, words);
    let with = |from: &str, to: &str| good.replacen(from, to, 1);
    wrong(
        "lost.csv",
        &with("T03:00,0,280,", "T03:00,0,,"),
        &["line 5, column lw_in", "a number, found nothing"],
    );
    wrong(
        "word.csv",
        &with("T03:00,0,280,-6.5", "T03:00,0,280,cold"),
        &["line 5, column ta_c", "'cold'"],
    );
    wrong(
        "nan.csv",
        &with("T03:00,0,280,", "T03:00,0,nan,"),
        &["line 5, column lw_in", "a number"],
    );
    wrong("range.csv", &with(",75,", ",140,"), &["line 2, column rh", "0 to 100 %", "140"]);
    wrong(
        "gap.csv",
        &with("27T05:00", "27T05:30"),
        &["line 7, column time", "2024-02-27T05:00:00", "05:30"],
    );
    wrong("twice.csv", &with("27T01:00", "27T00:00"), &["line 3, column time"]);
    wrong(
        "when.csv",
        &with("2024-02-27T00:00", "yesterday"),
        &["line 2, column time", "2005-10-01T00:00"],
    );
    wrong("short.csv", &with("T04:00,0,", "T04:00,"), &["line 6", "9 fields", "found 8"]);
    wrong("names.csv", &with(",rh,", ",humidity,"), &["line 1", "'rh'", "ps_pa"]);
    wrong(
        "one.csv",
        &good.lines().take(2).collect::<Vec<_>>().join("\n"),
        &["at least 2 rows", "found 1"],
    );
    wrong("empty.csv", "", &["line 1", "'time'"]);
}

#[test]
fn what_is_wrong_with_smet_is_said_with_its_line_and_column() {
    let here = folder("wrong-smet");
    let wrong = |name: &str, text: &str, words: &[&str]| wrong(&here, name, text, words);
    let good = smet(&hours(2), 0);
    let with = |from: &str, to: &str| good.replacen(from, to, 1);
    wrong("binary.smet", &with("ASCII", "BINARY"), &["line 1", "'ASCII'"]);
    wrong("fields.smet", &with("fields", "columns"), &["line 9", "fields"]);
    wrong(
        "nodata.smet",
        &with(" 75 2 ", " -999 2 "),
        &["line 10, column RH", "found -999", "missing"],
    );
    wrong("psum.smet", &with(" PSUM ", " RAIN "), &["line 6", "'PSUM'"]);
    wrong(
        "offset.smet",
        &with("273.15 0 0", "273.15 0"),
        &["line 7", "units_offset", "10 numbers", "found 9"],
    );
    wrong("data.smet", &with("[DATA]", "[WEATHER]"), &["[WEATHER]", "[DATA]"]);
    let unknown = with(" P TA", " X TA").replace("altitude", "height");
    wrong("pressure.smet", &unknown, &["line 6", "'P'", "altitude"]);
}

#[test]
fn what_can_not_be_is_refused() {
    let here = folder("refused");
    let forcing = file(&here, "forcing.csv", &csv(&hours(2)));
    for (option, value, word) in [
        ("--weather-step", "700", "3600"),
        ("--weather-step", "30", "3600"),
        ("--cell-size", "0.001", "0.02"),
        ("--soil", "1,2,3", "four numbers"),
        ("--columns", "0x4", "8x8"),
        ("--columns", "99999x99999", "1048576"),
        ("--heights-above", "sea", "ground"),
        ("--temperature-height", "0.1", "--temperature-height: expected 0.5"),
        ("--soil", "1,2,3,-80", "--soil: expected -50"),
    ] {
        let errors = refused(&forcing, &[option, value], 2);
        assert!(errors.contains(word), "{word}: {errors}");
    }
    let nowhere = here.join("nowhere.csv");
    assert!(refused(&nowhere, &[], 1).contains("nowhere.csv: No such file"));
    let errors = refused(&forcing, &["--evaluation", text(&nowhere)], 1);
    assert!(errors.contains("nowhere.csv"), "{errors}");
    let taken = file(&here, "taken", "a file");
    assert!(refused(&forcing, &["--out", text(&taken)], 1).contains("taken"));
    for (content, words) in [
        ("date,depth_m\n2024-02-27,deep\n", ["line 2, column depth_m", "'deep'"]),
        ("date,depth_m\n2024-02-30,1\n", ["line 2, column date", "2005-10-01"]),
        ("date,depth_m\n2024-02-27,1\n2024-02-27,1\n", ["line 3, column date", "once"]),
        ("day,depth_m\n2024-02-27,1\n", ["line 1", "'date'"]),
        ("date,depth\n2024-02-27,1\n", ["line 1", "depth_m, swe_kgm2"]),
    ] {
        let evaluation = file(&here, "evaluation.csv", content);
        let errors = refused(&forcing, &["--evaluation", text(&evaluation)], 1);
        assert!(words.iter().all(|word| errors.contains(word)), "{errors}");
    }
}
