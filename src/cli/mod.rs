//! The command line: one file per subcommand.

mod bench;
mod completions;
pub mod configuration;
mod demo;
mod effective;
mod experiment;
mod giving_up;
mod key;
mod load;
mod man;
mod openapi;
mod progress;
mod season;
mod serve;
mod signals;
mod store;

use std::io::{ErrorKind, Write};
use std::process::ExitCode;

use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};

pub use serve::Serve;

use crate::driver::OpenBackend;

/// Shown below the commands.
const EXAMPLES: &str = "\
Examples:
  firn serve --demo          serve, with a snowpack to look at: http://127.0.0.1:8080
  firn load                  put load on that server
  firn bench --scale 0.004   what snow costs on this machine's device
  firn help serve            every option of a command, and what it means

Exit codes:
  0  done; of `firn serve`: stopped by a signal, with all that was under way finished
  1  it was tried and failed; the last line of standard error says why and what to do
  2  it can't be done as it was asked for: an option is wrong, unknown or missing";

/// Firn simulates snowpacks on the GPU and serves them over HTTP and WebSocket.
#[derive(Debug, Parser)]
#[command(name = "firn", version, arg_required_else_help = true, after_help = EXAMPLES)]
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
    /// Make an API key for a tenant
    ///
    /// Prints the entry for the keys file of `serve`, and on standard error the key itself.
    #[command(after_help = key::EXAMPLES)]
    Key(key::Options),
    /// Look into a data directory
    #[command(after_help = store::EXAMPLES)]
    Store(store::Options),
    /// Repeat the experiments of the thesis that the model comes from
    ///
    /// Prints the thesis's figures, those of an independent program and Firn's beside each other,
    /// and writes figures and numbers into a directory. Exits with 1 where a result is not what it
    /// should be.
    #[command(after_help = experiment::EXAMPLES)]
    Experiment(experiment::Options),
    /// Run alpine snow through a season of weather, beside what was measured
    ///
    /// Reads the weather from a file, lets a column of snow feel it, and prints how near depth, water
    /// equivalent, surface temperature and melt-out come to measurements. With --out it writes daily
    /// values and figures. See below for the files and for what the figures mean.
    #[command(after_help = season::NOTES)]
    Season(season::Options),
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
    #[command(after_help = openapi::EXAMPLES)]
    Openapi,
    /// Print what makes a shell complete Firn's commands and options
    #[command(after_help = completions::EXAMPLES)]
    Completions(completions::Options),
    /// Write manual pages, one for each command
    #[command(after_help = man::EXAMPLES)]
    Man(man::Options),
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
    let given = Cli::command().get_matches();
    let result = match Cli::from_arg_matches(&given) {
        Ok(cli) => carry_out(cli.command, &given),
        Err(error) => error.exit(),
    };
    exit_code(result)
}

/// Serves on what a function opens, for tests of what happens when that fails.
#[doc(hidden)]
pub fn serve_on(options: &Serve, open: OpenBackend) -> ExitCode {
    exit_code(serve::run_on(options, open))
}

fn exit_code(result: Result<(), Failure>) -> ExitCode {
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

fn carry_out(command: Command, given: &ArgMatches) -> Result<(), Failure> {
    match command {
        Command::Serve(options) if options.prints_config() => effective::run(given),
        Command::Serve(options) => serve::run(&options),
        Command::Key(options) => key::run(&options),
        Command::Store(options) => store::run(&options),
        Command::Experiment(options) => experiment::run(&options),
        Command::Season(options) => season::run(&options),
        Command::Load(options) => load::run(&options),
        Command::Bench(options) => bench::run(&options),
        Command::Openapi => openapi::run(),
        Command::Completions(options) => completions::run(&options),
        Command::Man(options) => man::run(&options),
        Command::Configuration => configuration::run(),
    }
}

/// Writes to standard output.
///
/// # Errors
/// Where writing fails. A closed pipe is not an error: `firn ... | head` closes it early.
fn print(text: &[u8]) -> Result<(), Failure> {
    match std::io::stdout().write_all(text) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::Failed(format!("standard output: {error}")))
        }
        _ => Ok(()),
    }
}
