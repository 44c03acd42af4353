//! Arrows between the rooms of the code point one way, and `docs/architecture.md` tells every room.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The rooms of `src/`: each uses only those before it.
const ROOMS: [&str; 28] = [
    "budget",
    "limit",
    "machine",
    "open_files",
    "quote",
    "threads",
    "store",
    "problem",
    "core",
    "journal",
    "session",
    "driver",
    "config",
    "metrics",
    "telemetry",
    "backend",
    "caaml",
    "diagram",
    "render",
    "http",
    "stream",
    "server",
    "experiment",
    "season",
    "load",
    "bench",
    "cli",
    "main",
];

/// The crates: each uses only those before it.
const CRATES: [&str; 6] =
    ["firn-snow", "firn-protocol", "firn-engine", "firn-client", "firn", "firn-sim"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Every file of Rust below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("it can be read").path();
        if path.is_dir() {
            files.extend(self::files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files
}

/// The room that a file of `src/` is in.
fn room_of(path: &Path) -> String {
    let inside = path.strip_prefix(root().join("src")).expect("it is in src");
    let first = inside.iter().next().expect("it has a name").to_string_lossy();
    first.trim_end_matches(".rs").to_owned()
}

/// The rooms that some code imports from, beside its own. Tests may import what they like.
fn imports(code: &str) -> BTreeSet<String> {
    let code = code.split("\n#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let word = |rest: &str| {
        let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
        rest[..end].to_owned()
    };
    code.split("crate::").skip(1).map(word).collect()
}

#[test]
fn rooms_use_only_those_before_them() {
    let place = |room: &str| ROOMS.iter().position(|&known| known == room);
    for path in files(&root().join("src")) {
        let room = room_of(&path);
        if room == "lib" || path.file_name().is_some_and(|name| name == "tests.rs") {
            continue;
        }
        let here = place(&room).unwrap_or_else(|| panic!("{room} has no place in ROOMS"));
        for used in imports(&read(&path)).iter().filter(|&used| *used != room) {
            let there = place(used).unwrap_or_else(|| {
                panic!("{} imports crate::{used}, which is no room", path.display())
            });
            assert!(there < here, "{} may not use {used}: it comes later", path.display());
        }
    }
}

/// What the core may not have: it is told the time, and others work, wait and draw for it. The order of a hash
/// map is chance, too.
const IMPURE: [&str; 17] = [
    ".elapsed(",
    "Instant::now",
    "SystemTime",
    "machine::",
    "thread::",
    "rayon",
    "spawn",
    "sleep(",
    "block_on",
    "getrandom",
    "rand::",
    "HashMap",
    "HashSet",
    "mpsc",
    "std::fs",
    "std::net",
    "std::env",
];

#[test]
fn the_core_has_no_clock_no_chance_and_no_thread() {
    let files = files(&root().join("src/core"));
    assert!(files.len() > 50, "the core has moved");
    for path in files {
        let whole = read(&path);
        let code = whole.split("\n#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        let code = (1..).zip(code.lines()).filter(|(_, line)| !line.trim_start().starts_with("//"));
        for (number, line) in code {
            let found = IMPURE.iter().find(|impure| line.contains(**impure));
            assert_eq!(found, None, "{}, line {number}: {line}", path.display());
        }
    }
}

#[test]
fn crates_use_only_those_before_them() {
    for (here, name) in CRATES.iter().enumerate() {
        let folder = if *name == "firn" { root().into() } else { root().join("crates").join(name) };
        let manifest: toml::Table = toml::from_str(&read(&folder.join("Cargo.toml"))).unwrap();
        let used = manifest["dependencies"].as_table().unwrap().keys();
        for used in used.filter(|used| used.starts_with("firn")) {
            let there = CRATES.iter().position(|known| known == used);
            assert!(there.is_some_and(|there| there < here), "{name} may not use {used}");
        }
    }
    let folders = fs::read_dir(root().join("crates")).unwrap().count();
    assert_eq!(folders, CRATES.len() - 1, "a crate has no place in CRATES");
}

#[test]
fn every_room_is_told() {
    let told = read(&root().join("docs/architecture.md"));
    for room in ROOMS.iter().filter(|&&room| room != "main") {
        let (folder, file) = (format!("`src/{room}/`"), format!("`src/{room}.rs`"));
        assert!(told.contains(&folder) || told.contains(&file), "{room} is not told");
    }
    for name in CRATES.iter().filter(|&&name| name != "firn") {
        assert!(told.contains(&format!("`crates/{name}/`")), "{name} is not told");
    }
}
