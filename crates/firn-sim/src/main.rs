//! `firn-sim --seed N --steps M` runs the server's core under faults that a seed tells, and says what it came
//! through. Where something was lost, done twice or told wrongly it says so, with the seed, and exits with 1.

mod client;
mod device;
#[path = "../../../tests/durability/disk.rs"]
mod disk;
mod machine;
mod model;
mod panics;
mod report;
mod simulation;
mod viewer;
mod watched;

use std::process::ExitCode;
use std::time::{SystemTime, UNIX_EPOCH};

use clap::Parser;

use simulation::Simulation;

/// Runs Firn under simulated faults.
#[derive(Parser)]
struct Arguments {
    /// The first seed; one that the clock tells where none is given.
    #[arg(long)]
    seed: Option<u64>,
    /// Seeds that are run, one after the other.
    #[arg(long, default_value_t = 1)]
    seeds: u64,
    /// Steps of each.
    #[arg(long, default_value_t = 20_000)]
    steps: u64,
    /// Tell what clients are answered.
    #[arg(long)]
    tell: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let first = arguments.seed.unwrap_or_else(fresh);
    panics::watch();
    let mut code = ExitCode::SUCCESS;
    for seed in first..first + arguments.seeds {
        let run =
            std::panic::catch_unwind(|| Simulation::run(seed, arguments.steps, arguments.tell));
        match run {
            Ok((report, Ok(()))) => println!("seed {seed}: {report}"),
            Ok((report, Err(why))) => {
                println!("seed {seed}: {report}\nseed {seed}: VIOLATION: {why}");
                code = ExitCode::FAILURE;
            }
            Err(_) => {
                let why = panics::unexpected().unwrap_or_else(|| "it panicked".to_owned());
                println!("seed {seed}: VIOLATION: {why}");
                code = ExitCode::FAILURE;
            }
        }
    }
    code
}

/// A seed that nobody has had.
fn fresh() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    since.as_nanos() as u64 / 1000
}
