//! `firn store`: what a data directory holds, beside a running server or without one.

mod output;
mod running;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use firn_protocol::{CompactReply, VerifyReply};
use indicatif::HumanBytes;

use crate::journal::{StoreReport, check_store, verify_store};
use crate::store::{Compacted, Format, RedbStore, Store, StoreError};

use self::output::Output;
use self::running::Running;
use super::Failure;

/// Shown below the commands.
pub const EXAMPLES: &str = "\
Examples:
  firn store check --data-dir /var/lib/firn     before an upgrade, or after a power cut
  firn store backup --server http://127.0.0.1:8080 --output firn-monday.redb
                                                a running server's sessions, while it goes on
  firn store verify --server http://127.0.0.1:8080 --api-key-file key
                                                whether the disk still has all that was written
  firn store compact --data-dir /var/lib/firn   give back what deleted sessions have left

A backup is put back under the name firn.redb in the directory of a server that is stopped. Without
--server the server that uses the directory has to be stopped; `check` always needs that.";

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
    /// Copy all sessions into a new file, as they are at one moment
    ///
    /// A running server goes on meanwhile. The file gets its name once it is whole, and is written over no other.
    Backup(Backup),
    /// Look at every row where it lies, and read every session as a start would
    ///
    /// A running server goes on meanwhile. Exits with 1 where anything is wrong.
    Verify(Place),
    /// Give unused pages of the file back to the file system
    ///
    /// Changes of a running server wait until that is done.
    Compact(Place),
}

/// A data directory.
#[derive(Args, Clone, Debug)]
struct Directory {
    /// The directory.
    #[arg(long, env = "FIRN_DATA_DIR", default_value = "./firn-data", value_name = "DIRECTORY")]
    data_dir: PathBuf,
}

/// A store: that of a running server, or a directory.
#[derive(Args, Clone, Debug)]
struct Place {
    #[command(flatten)]
    directory: Directory,
    #[command(flatten)]
    running: Running,
}

/// Options of a backup.
#[derive(Args, Clone, Debug)]
struct Backup {
    /// The file to make.
    #[arg(long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    place: Place,
}

impl Directory {
    /// The store in it; `advice` is for where a server uses it.
    fn open(&self, advice: &str) -> Result<RedbStore, Failure> {
        RedbStore::existing(&self.data_dir).map_err(|error| match error {
            StoreError::InUse(why) => Failure::Failed(format!("{why}: {advice}")),
            other => failed(other),
        })
    }

    fn open_or_ask(&self) -> Result<RedbStore, Failure> {
        self.open("ask the server with --server, as in --server http://127.0.0.1:8080, or stop it")
    }
}

/// Carries out a command.
///
/// # Errors
/// Where the directory can't be read, or something in it is wrong.
pub fn run(options: &Options) -> Result<(), Failure> {
    match &options.command {
        Command::Check(directory) => check(directory),
        Command::Backup(options) => backup(options),
        Command::Verify(place) => verify(place),
        Command::Compact(place) => compact(place),
    }
}

fn backup(Backup { output: path, place }: &Backup) -> Result<(), Failure> {
    let bytes = match place.running.client()? {
        Some(client) => running::backup(&client, path)?,
        None => {
            let mut store = place.directory.open_or_ask()?;
            let (output, file) = Output::begin(path)?;
            let file = store.moment().and_then(|moment| moment.copy_into(file)).map_err(failed)?;
            output.finish(&file)?;
            file.metadata().map_err(|error| output::unwritten(path, &error))?.len()
        }
    };
    super::print(format!("{}: {}\n", path.display(), HumanBytes(bytes)).as_bytes())
}

fn verify(place: &Place) -> Result<(), Failure> {
    let found = match place.running.client()? {
        Some(client) => running::verify(&client)?,
        None => verify_store(&mut place.directory.open_or_ask()?).map_err(failed)?,
    };
    let VerifyReply { sound, sessions, broken, damage, rows, bytes, file_bytes } = found;
    let mut text = String::new();
    for what in broken {
        text += &format!("can't be brought back: {what}\n");
    }
    for what in damage {
        text += &format!("damaged: {what}\n");
    }
    text += &format!(
        "sessions that can be brought back: {sessions}, in {rows} rows of {}",
        HumanBytes(bytes)
    );
    if file_bytes > 0 {
        text += &format!("; the file has {}", HumanBytes(file_bytes));
    }
    super::print(format!("{text}\n").as_bytes())?;
    if sound { Ok(()) } else { Err(Failure::Failed("the store is damaged, see above".to_owned())) }
}

fn compact(place: &Place) -> Result<(), Failure> {
    let (before, after) = match place.running.client()? {
        Some(client) => {
            let CompactReply { bytes_before, bytes_after } = running::compact(&client)?;
            (bytes_before, bytes_after)
        }
        None => {
            let Compacted { before, after } =
                place.directory.open_or_ask()?.compact().map_err(failed)?;
            (before, after)
        }
    };
    let (before, after) = (HumanBytes(before), HumanBytes(after));
    super::print(format!("the file had {before}, and has {after}\n").as_bytes())
}

fn failed(error: StoreError) -> Failure {
    Failure::Failed(error.to_string())
}

fn check(directory: &Directory) -> Result<(), Failure> {
    let mut store =
        directory.open("stop it first, or ask it with `firn store verify --server URL`")?;
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
