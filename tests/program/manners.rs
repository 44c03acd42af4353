//! How the program treats whoever types its commands: help, completions, manual pages, and errors
//! that say what was wrong and what to do.

use std::net::TcpListener;
use std::path::PathBuf;
use std::process::{Command, Output};

use crate::running::{Running, serve};

const COMMANDS: [&str; 10] = [
    "serve",
    "key",
    "store",
    "experiment",
    "season",
    "load",
    "bench",
    "openapi",
    "completions",
    "man",
];

fn firn(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_firn")).args(arguments).output().expect("it runs")
}

/// What a command writes to standard output when it succeeds.
#[track_caller]
fn said(arguments: &[&str]) -> String {
    let output = firn(arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {errors}");
    String::from_utf8(output.stdout).expect("it is text")
}

/// A folder of its own for a test.
fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("firn-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for temporary files");
    folder
}

#[test]
fn help_teaches_by_examples() {
    let all = said(&["--help"]);
    assert!(all.contains("Examples:") && all.contains("Exit codes:"), "{all}");
    for command in COMMANDS {
        assert!(all.contains(&format!("\n  {command} ")), "{command}: {all}");
        let help = said(&[command, "--help"]);
        assert!(help.contains("Examples:"), "{help}");
        assert!(help.contains(&format!("\n  firn {command}")), "{help}");
    }
}

#[test]
fn shells_complete_and_man_explains_every_command() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = said(&["completions", shell]);
        for word in COMMANDS.into_iter().chain(["allowed-host", "print-config"]) {
            assert!(script.contains(word), "{shell} does not complete {word}");
        }
    }
    let folder = folder("manual");
    said(&["man", folder.to_str().expect("a plain path")]);
    for command in COMMANDS {
        let page = std::fs::read_to_string(folder.join(format!("firn-{command}.1"))).unwrap();
        assert!(page.contains("Examples:"), "{page}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn the_options_that_hold_are_told_with_their_origin() {
    let mut command = serve(&["--listen", "127.0.0.1:9", "--print-config"]);
    let key = "a-key-that-nobody-can-guess";
    command.env("FIRN_API_KEY", key).env("FIRN_MAX_SESSIONS", "7");
    let output = command.stdout(std::process::Stdio::piped()).output().expect("it runs");
    assert_eq!(output.status.code(), Some(0));
    let text = String::from_utf8(output.stdout).unwrap();
    let part = |title: &str| {
        let (_, rest) = text.split_once(title).unwrap_or_else(|| panic!("{title}: {text}"));
        rest.split("\n\n").next().unwrap_or_default().to_owned()
    };
    assert!(part("# From the command line:").contains("\nFIRN_LISTEN=127.0.0.1:9"));
    let environment = part("# From the environment:");
    assert!(environment.contains("\nFIRN_MAX_SESSIONS=7"), "{text}");
    assert!(environment.contains("FIRN_API_KEY=(secret)"), "{text}");
    assert!(part("# Defaults:").contains("\nFIRN_MAX_BODY_BYTES=16MiB"), "{text}");
    assert!(!text.contains(key));
}

#[test]
fn a_signal_stops_it_well() {
    let server = Running::start(serve(&["--listen", "127.0.0.1:0"]));
    let (code, log) = server.stop();
    assert_eq!(code, Some(0), "{log}");
}

/// Runs a command that can't succeed; checks its exit code, and that it says all of some words.
#[track_caller]
fn fails(mut command: Command, code: i32, words: &[&str]) {
    let output = command.output().expect("it runs");
    let said = String::from_utf8(output.stderr).expect("it is text");
    assert_eq!(output.status.code(), Some(code), "{command:?}: {said}");
    assert!(said.lines().any(|line| line.starts_with("error: ")), "{said}");
    for word in words {
        assert!(said.contains(word), "{word}: {said}");
    }
}

#[test]
fn what_was_wrong_with_an_option_is_said() {
    let usage = |options: &[&str], words: &[&str]| fails(serve(options), 2, words);
    usage(&["--lisen", "127.0.0.1:0"], &["--lisen", "--listen"]);
    usage(&["--listen", "localhost"], &["--listen", "localhost", "127.0.0.1:8080"]);
    let mut backend = Command::new(env!("CARGO_BIN_EXE_firn"));
    backend.args(["serve", "--backend", "cuda"]);
    fails(backend, 2, &["cuda", "auto", "gpu", "cpu"]);
    usage(&["--max-body-bytes", "1MB"], &["--max-body-bytes", "MB", "MiB"]);
    usage(&["--log", "firn=loud"], &["--log", "firn=loud"]);
    usage(&["--otlp-endpoint", "https://tempo"], &["--otlp-endpoint", "http://127.0.0.1:4318"]);
    usage(&["--api-key-file", "/nowhere/key"], &["--api-key-file /nowhere/key", "No such file"]);
    usage(&["--api-keys-file", "/nowhere/keys"], &["--api-keys-file /nowhere/keys", "TOML"]);
    let no_keys = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    usage(&["--api-keys-file", no_keys], &["--api-keys-file", "line ", "unknown field"]);
    usage(&["--tls-cert", "cert.pem"], &["--tls-key"]);
    let files = ["--tls-cert", "/nowhere/cert.pem", "--tls-key", "/nowhere/key.pem"];
    usage(&files, &["/nowhere/cert.pem", "No such file", "certificate chain"]);
    let no_pem = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    usage(&["--tls-cert", no_pem, "--tls-key", no_pem], &["--tls-cert", "it holds none"]);
    let mut environment = serve(&[]);
    environment.env("RUST_LOG", "firn=loud");
    fails(environment, 2, &["RUST_LOG", "firn=loud"]);
}

#[test]
fn what_went_wrong_is_said_with_what_to_do() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    fails(serve(&["--listen", &address]), 1, &[&address, "another program", "--listen"]);
    let foreign = ["--listen", "192.0.2.1:0", "--allow-open"];
    fails(serve(&foreign), 1, &["192.0.2.1", "127.0.0.1", "0.0.0.0"]);
    let mut load = Command::new(env!("CARGO_BIN_EXE_firn"));
    load.args(["load", "--url", "http://127.0.0.1:1"]);
    fails(load, 1, &["127.0.0.1:1", "refused", "firn serve"]);
    let mut experiment = Command::new(env!("CARGO_BIN_EXE_firn"));
    experiment.args(["experiment", "1a", "--backend", "cpu", "--out", "/dev/null/here"]);
    fails(experiment, 1, &["/dev/null/here"]);
    let file = folder("manual-pages").join("file");
    std::fs::write(&file, "").unwrap();
    let mut man = Command::new(env!("CARGO_BIN_EXE_firn"));
    man.arg("man").arg(&file);
    fails(man, 1, &[file.to_str().unwrap()]);
    std::fs::remove_dir_all(file.parent().unwrap()).unwrap();
}

/// Vulkan's loader can be told to see no driver; other interfaces can't.
#[cfg(target_os = "linux")]
#[test]
fn without_an_adapter_it_says_how_to_do_without() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_firn"));
    command.args(["serve", "--listen", "127.0.0.1:0", "--ephemeral", "--backend", "gpu"]);
    command.env("VK_DRIVER_FILES", "/nowhere").env("VK_ICD_FILENAMES", "/nowhere");
    fails(command, 1, &["no usable graphics adapter", "mesa-vulkan-drivers", "--backend cpu"]);
}
