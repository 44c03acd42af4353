//! Has the crate built again when the viewer was.
//!
//! The files of `viewer/dist` become part of the binary. Cargo learns of those that were there at the last build; of a folder
//! that was not there it learns here.

use std::path::Path;

fn main() {
    let built = "viewer/dist";
    let watched = if Path::new(built).exists() { built } else { "viewer" };
    println!("cargo::rerun-if-changed={watched}");
}
