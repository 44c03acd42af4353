//! The same seeds each time: what once went wrong is looked at again.

use std::process::Command;

/// Runs seeds, and returns what is said of them without the time that they took.
fn run(arguments: &[&str]) -> Vec<String> {
    let output = Command::new(env!("CARGO_BIN_EXE_firn-sim")).args(arguments).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    said.lines().filter_map(|line| Some(line.split_once(" s, ")?.1.to_owned())).collect()
}

#[test]
fn nothing_is_lost_done_twice_or_told_wrongly() {
    let said = run(&["--seed", "1", "--seeds", "10", "--steps", "20000"]);
    assert_eq!(said.len(), 10);
}

#[test]
fn a_seed_tells_everything() {
    let seed = ["--seed", "24", "--seeds", "2", "--steps", "4000"];
    let said = run(&seed);
    assert!(said.iter().all(|line| line.contains("crash") && line.contains("disk")), "{said:?}");
    assert_eq!(run(&seed), said, "to the last byte that is written");
}
