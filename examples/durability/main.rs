//! What durability costs: how long a restart takes after a kill and a session takes to wake, what
//! checkpoints do to frames, and what sessions at rest cost.
//!
//! ```sh
//! cargo run --release --example durability -- gpu            # everything; or cpu
//! cargo run --release --example durability -- gpu rest       # one part of it
//! ```

mod frames;
mod recovery;
mod rest;
mod waking;

use std::error::Error;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use clap::{Parser, ValueEnum};
use firn::backend;
use firn::config::{BackendChoice, EngineConfig};
use firn::driver::{Driver, Durability, WorldConfig};
use firn::session::{Limits, Session, SessionError, Sessions};
use firn::store::{RedbStore, Store};
use firn_protocol::{SessionSpec, SnowLayer};
use firn_snow::Grid;
use tokio::runtime::Runtime;
use tokio::task::JoinSet;

const NEVER: Duration = Duration::from_secs(3600);
const FILE: &str = "firn.redb";

type Result<T> = std::result::Result<T, Box<dyn Error>>;

#[derive(Parser)]
struct Arguments {
    /// What computes.
    #[arg(value_enum, default_value_t = BackendChoice::Auto)]
    backend: BackendChoice,
    /// What is measured; everything where nothing is named.
    #[arg(value_enum)]
    parts: Vec<Part>,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Part {
    /// How long a start takes after a kill.
    Recovery,
    /// How long a request waits for a session that hibernates.
    Waking,
    /// What checkpoints do to frames.
    Frames,
    /// What sessions at rest cost.
    Rest,
}

fn main() -> Result<()> {
    let Arguments { backend, parts } = Arguments::parse();
    let runtime = Runtime::new()?;
    for &part in if parts.is_empty() { Part::value_variants() } else { &parts } {
        match part {
            Part::Recovery => recovery::measure(&runtime, backend)?,
            Part::Waking => waking::measure(&runtime, backend)?,
            Part::Frames => frames::measure(&runtime, backend)?,
            Part::Rest => rest::measure(&runtime, backend)?,
        }
    }
    Ok(())
}

/// A place for files that is removed again.
struct Directory(std::path::PathBuf);

impl Directory {
    fn new(name: &str) -> Result<Directory> {
        let path = std::env::temp_dir().join(format!("firn-{}-{name}", std::process::id()));
        fs::create_dir(&path)?;
        Ok(Directory(path))
    }
}

impl Drop for Directory {
    fn drop(&mut self) {
        // What is left over lies among other temporary files.
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn open(backend: BackendChoice, data: &Path, interval: Duration) -> Result<(Sessions, Driver)> {
    open_on(backend, Box::new(RedbStore::in_directory(data)?), interval, 20.0)
}

fn open_on(
    backend: BackendChoice,
    store: Box<dyn Store>,
    checkpoint_interval: Duration,
    publish_rate: f64,
) -> Result<(Sessions, Driver)> {
    let limits = Limits {
        sessions: 100_000,
        columns_per_session: 1 << 30,
        columns: 1 << 40,
        cells_per_session: 1 << 30,
        cells: 1 << 40,
        colliders_per_session: 16,
    };
    let config = WorldConfig { limits, publish_rate, sleep: true };
    let engine = EngineConfig { backend, device_memory: None };
    let durability = Durability { store, checkpoint_interval, accept_loss: false };
    Ok(Driver::open(Box::new(move || backend::open(&engine)), config, durability)?)
}

fn spec(id: u64, paused: bool) -> SessionSpec {
    let layer = SnowLayer { depth: 5.0, temperature: None, density: None };
    SessionSpec {
        id: Some(format!("s{id}")),
        grid: Grid { width: 50, depth: 50, height: 50, cell_size: 0.2 },
        paused,
        initial_snow: vec![layer],
        ..SessionSpec::default()
    }
}

async fn create(sessions: &Sessions, count: u64, paused: bool) -> Result<Vec<Arc<Session>>> {
    let mut made = Vec::new();
    for id in 0..count {
        made.push(sessions.create(spec(id, paused)).await?.0);
    }
    Ok(made)
}

/// Has all sessions do something at once.
async fn all<F>(sessions: &[Arc<Session>], act: impl Fn(Arc<Session>) -> F) -> Result<()>
where
    F: Future<Output = std::result::Result<(), SessionError>> + Send + 'static,
{
    let mut tasks = JoinSet::new();
    sessions.iter().for_each(|session| drop(tasks.spawn(act(session.clone()))));
    while let Some(ended) = tasks.join_next().await {
        ended??;
    }
    Ok(())
}
