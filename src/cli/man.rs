//! `firn man`: manual pages.

use std::path::PathBuf;

use clap::{Args, CommandFactory};

use super::{Cli, Failure};

/// Shown below the options.
pub const EXAMPLES: &str = "\
Examples:
  firn man ~/.local/share/man/man1    and then: man firn, man firn-serve
  firn man /tmp && man /tmp/firn-serve.1";

/// Options of `firn man`.
#[derive(Args, Clone, Debug)]
pub struct Options {
    /// Directory for the pages; it is created where it is not there.
    directory: PathBuf,
}

/// Writes the pages.
///
/// # Errors
/// Where the directory can't be written.
pub fn run(options: &Options) -> Result<(), Failure> {
    let directory = &options.directory;
    std::fs::create_dir_all(directory)
        .and_then(|()| clap_mangen::generate_to(Cli::command(), directory))
        .map_err(|error| Failure::Failed(format!("{}: {error}", directory.display())))
}
