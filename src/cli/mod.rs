//! The command line: one file per subcommand.

mod bench;
pub mod configuration;
mod demo;
mod experiment;
mod load;
mod openapi;
mod serve;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

pub use serve::{Serve, open_backend};

/// Firn simulates snowpacks on the GPU and serves them over HTTP and WebSocket.
#[derive(Debug, Parser)]
#[command(name = "firn", version, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// What the program can do.
#[derive(Debug, Subcommand)]
enum Command {
    /// Serve snowpacks over HTTP and WebSocket
    ///
    /// Sessions are kept in --data-dir and are there again after a restart. Every flag can be given
    /// as an environment variable too. SIGINT and SIGTERM stop the server
    /// gracefully: it accepts no more, finishes what is under way, and ends; a second signal ends
    /// it at once.
    #[command(after_help = serve::EXAMPLES)]
    Serve(Box<Serve>),
    /// Repeat the experiments of the thesis that the model comes from
    ///
    /// Prints the thesis's figures, those of an independent program and Firn's beside each other,
    /// and writes figures and numbers into a directory. Exits with 1 where a result is not what it
    /// should be.
    #[command(after_help = experiment::EXAMPLES)]
    Experiment(experiment::Options),
    /// Put load on a server and measure what its viewers get
    ///
    /// Creates sessions, watches them with many clients, moves objects through the snow, and
    /// deletes the sessions again, on Ctrl-C too. See below for what the figures mean.
    #[command(after_help = load::NOTES)]
    Load(load::Options),
    /// Measure what snow costs on this machine's device
    ///
    /// Runs the engine that serves snowpacks, and beside it the layout of the thesis that the model
    /// comes from. See below for what the figures mean.
    #[command(after_help = bench::NOTES)]
    Bench(bench::Options),
    /// Print the OpenAPI document of the REST interface
    Openapi,
    /// Print the options of `serve` as a Markdown table, for docs/operations.md
    #[command(hide = true)]
    Configuration,
}

/// Why a command did not succeed.
#[derive(Debug)]
pub enum Failure {
    /// It was called in a way that it can't carry out.
    Usage(String),
    /// It tried and failed.
    Failed(String),
}

/// Runs the program: exit code 0 for success, 1 for failure, 2 for wrong usage.
pub fn run() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Serve(options) => serve::run(&options),
        Command::Experiment(options) => experiment::run(&options),
        Command::Load(options) => load::run(&options),
        Command::Bench(options) => bench::run(&options),
        Command::Openapi => openapi::run(),
        Command::Configuration => configuration::run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Usage(message)) => {
            eprintln!("error: {message}");
            ExitCode::from(2)
        }
        Err(Failure::Failed(message)) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}
