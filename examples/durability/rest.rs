//! What sessions cost in which nothing moves while their time goes on.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use firn::config::BackendChoice;
use firn::store::{Ephemeral, Loaded, RedbStore, Store, StoreError, Write};
use firn_protocol::{SessionSpec, SnowLayer};
use firn_snow::Grid;
use tokio::runtime::Runtime;

use super::{Directory, NEVER, Result, open_on};

const SESSIONS: u64 = 10_000;
/// Time in which they come to rest, and in which they are watched then.
const RESTING: Duration = Duration::from_secs(5);
const WATCHED: Duration = Duration::from_secs(6);

/// A store that counts what is written.
#[derive(Debug)]
struct Counting {
    store: Box<dyn Store>,
    commits: Arc<AtomicU64>,
    rows: Arc<AtomicU64>,
}

impl Store for Counting {
    fn load(&mut self) -> std::result::Result<Loaded, StoreError> {
        self.store.load()
    }

    fn commit(&mut self, writes: &[Write]) -> std::result::Result<(), StoreError> {
        self.commits.fetch_add(1, Ordering::Relaxed);
        self.rows.fetch_add(writes.len() as u64, Ordering::Relaxed);
        self.store.commit(writes)
    }

    fn is_durable(&self) -> bool {
        self.store.is_durable()
    }
}

/// Frames of a world at rest, and what it writes.
pub fn measure(runtime: &Runtime, backend: BackendChoice) -> Result<()> {
    println!("{SESSIONS} sessions of 8 × 8 × 4 at rest");
    let data = Directory::new("rest")?;
    let stored = Box::new(RedbStore::in_directory(&data.0)?);
    let stores: [(&str, Box<dyn Store>); 2] =
        [("ephemeral", Box::new(Ephemeral)), ("stored", stored)];
    for (name, store) in stores {
        let (commits, rows) = (Arc::<AtomicU64>::default(), Arc::<AtomicU64>::default());
        let counting = Counting { store, commits: commits.clone(), rows: rows.clone() };
        let (sessions, world) = open_on(backend, Box::new(counting), NEVER, 20.0)?;
        for id in 0..SESSIONS {
            runtime.block_on(sessions.create(spec(id)))?;
        }
        std::thread::sleep(RESTING);
        let read = || (commits.load(Ordering::Relaxed), rows.load(Ordering::Relaxed));
        let (before, first) = (read(), sessions.vitals().frame_times().last().map(|f| f.number));
        std::thread::sleep(WATCHED);
        let after = read();
        let frames = sessions.vitals().frame_times();
        let mut times: Vec<Duration> = frames
            .iter()
            .filter(|frame| Some(frame.number) > first && frame.sessions == 0)
            .map(|frame| frame.took)
            .collect();
        times.sort_unstable();
        let per_second = |count: u64| count as f64 / WATCHED.as_secs_f64();
        println!(
            "  {name}: {} frames, median {:.1?}, longest {:.1?}; {:.1} commits and {:.1} rows a second",
            times.len(),
            times[times.len() / 2],
            times[times.len() - 1],
            per_second(after.0 - before.0),
            per_second(after.1 - before.1)
        );
        drop(sessions);
        world.stop();
    }
    Ok(())
}

fn spec(id: u64) -> SessionSpec {
    SessionSpec {
        id: Some(format!("s{id}")),
        grid: Grid { width: 8, depth: 8, height: 4, cell_size: 0.2 },
        tick_rate: 20.0,
        initial_snow: vec![SnowLayer { depth: 0.1, temperature: None, density: None }],
        ..SessionSpec::default()
    }
}
