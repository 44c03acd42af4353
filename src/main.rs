//! The `firn` program: see [`firn::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    firn::cli::run()
}
