//! `firn store`: what a data directory holds.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use crate::journal::{StoreReport, check_store};
use crate::store::{Format, RedbStore};

use super::Failure;

/// Shown below the commands.
pub const EXAMPLES: &str = "\
Examples:
  firn store check --data-dir /var/lib/firn     before an upgrade, or after a power cut

The server that uses the directory has to be stopped.";

/// Options of `firn store`.
#[derive(Args, Clone, Debug)]
pub struct Options {
    #[command(subcommand)]
    command: Command,
}

/// What can be done with a data directory.
#[derive(Clone, Debug, Subcommand)]
enum Command {
    /// Read all of it as a start would, and change nothing
    ///
    /// Lists every session that can be brought back, and says what is wrong with each that can't be. A directory
    /// of an earlier version is read as the next start would make it anew. Exits with 1 where anything is
    /// wrong.
    Check(Directory),
}

/// A data directory.
#[derive(Args, Clone, Debug)]
struct Directory {
    /// The directory.
    #[arg(long, env = "FIRN_DATA_DIR", default_value = "./firn-data", value_name = "DIRECTORY")]
    data_dir: PathBuf,
}

/// Carries out a command.
///
/// # Errors
/// Where the directory can't be read, or something in it is wrong.
pub fn run(options: &Options) -> Result<(), Failure> {
    match &options.command {
        Command::Check(directory) => check(directory),
    }
}

fn check(directory: &Directory) -> Result<(), Failure> {
    let failed = |error| Failure::Failed(format!("{error}"));
    let mut store = RedbStore::existing(&directory.data_dir).map_err(failed)?;
    let report = check_store(&mut store).map_err(failed)?;
    super::print(tell(&report).as_bytes())?;
    if report.is_sound() {
        return Ok(());
    }
    let count = report.broken.len();
    let damage = report.damage.map_or(String::new(), |damage| format!("{damage}; "));
    Err(Failure::Failed(format!("{damage}sessions that can't be brought back: {count}, see above")))
}

fn tell(report: &StoreReport) -> String {
    let format = match report.format {
        Format::First => {
            "format 1, of Firn 0.1: the next start makes it format 2 and keeps the old file"
        }
        Format::Present => "format 2",
    };
    let mut text = format!("{format}\n");
    for session in &report.sessions {
        let locked = if session.locked { ", locked" } else { "" };
        let (id, tick, changes) = (&session.id, session.tick, session.changes);
        text += &format!(
            "session '{id}': tick {tick}, {changes} changes after its checkpoint{locked}\n"
        );
    }
    for broken in &report.broken {
        text += &format!("can't be brought back: {broken}\n");
    }
    text + &format!("sessions that can be brought back: {}\n", report.sessions.len())
}
