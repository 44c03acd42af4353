//! What durability costs: how long a restart takes after a kill, and what checkpoints do to frames.
//!
//! ```sh
//! cargo run --release --example durability -- gpu    # or cpu
//! ```

use std::error::Error;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use firn::cli::open_backend;
use firn::config::{BackendChoice, EngineConfig};
use firn::session::{
    Change, Durability, Limits, Region, Session, SessionError, SessionSpec, Sessions,
    SettingsPatch, SnowLayer, Snowfall, StepSpec, World, WorldConfig,
};
use firn::snow::Grid;
use firn::store::RedbStore;
use tokio::task::JoinSet;

const SESSIONS: u64 = 100;
const CHANGES: u64 = 1000;
/// Time that live sessions have to go through again.
const LIVE: Duration = Duration::from_secs(10);
const NEVER: Duration = Duration::from_secs(3600);
const FILE: &str = "firn.redb";

type Result<T> = std::result::Result<T, Box<dyn Error>>;

fn main() -> Result<()> {
    let backend = std::env::args().nth(1).unwrap_or_else(|| "auto".to_owned());
    let backend = BackendChoice::from_str(&backend, true)?;
    let runtime = tokio::runtime::Runtime::new()?;
    paused(&runtime, backend)?;
    live(&runtime, backend)?;
    checkpoints(&runtime, backend)
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

fn open(backend: BackendChoice, data: &Path, interval: Duration) -> Result<(Sessions, World)> {
    let limits = Limits {
        sessions: 1000,
        cells_per_session: 1 << 30,
        cells: 1 << 40,
        colliders_per_session: 16,
    };
    let config = WorldConfig { limits, publish_rate: 20.0, sleep: true };
    let engine = EngineConfig { backend, device_memory: None };
    let store = Box::new(RedbStore::in_directory(data)?);
    let durability = Durability { store, checkpoint_interval: interval };
    Ok(World::open(Box::new(move || open_backend(&engine)), config, durability)?)
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

/// What a kill would leave: no last checkpoints, no orderly end.
fn killed(sessions: Sessions, world: World, data: &Path) -> Result<Directory> {
    let left = Directory::new("left")?;
    fs::copy(data.join(FILE), left.0.join(FILE))?;
    drop(sessions);
    world.stop();
    Ok(left)
}

/// Time until everything that is stored is back, and the sessions.
fn recover(backend: BackendChoice, data: &Path) -> Result<(Duration, Sessions, World)> {
    let began = Instant::now();
    let (sessions, world) = open(backend, data, NEVER)?;
    while !sessions.vitals().is_recovered() {
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok((began.elapsed(), sessions, world))
}

fn paused(runtime: &tokio::runtime::Runtime, backend: BackendChoice) -> Result<()> {
    let data = Directory::new("paused")?;
    let (sessions, world) = open(backend, &data.0, NEVER)?;
    let made = runtime.block_on(create(&sessions, SESSIONS, true))?;
    let began = Instant::now();
    runtime.block_on(all(&made, async |session| {
        for change in 0..CHANGES {
            let x = (change % 8) as f64;
            let region = Region { x, z: 0.0, width: 2.0, depth: 10.0 };
            let fall =
                Snowfall { depth: 0.001, density: None, temperature: None, region: Some(region) };
            session.change(Change::Snowfall(fall)).await?;
        }
        Ok(())
    }))?;
    let rate = (SESSIONS * CHANGES) as f64 / began.elapsed().as_secs_f64();
    println!("{SESSIONS} sessions, {CHANGES} changes each: {rate:.0} durable changes per second");
    drop(made);
    let left = killed(sessions, world, &data.0)?;
    let (took, sessions, world) = recover(backend, &left.0)?;
    println!("  back after {:.2} s ({} sessions)", took.as_secs_f64(), sessions.count());
    world.stop();
    Ok(())
}

fn live(runtime: &tokio::runtime::Runtime, backend: BackendChoice) -> Result<()> {
    let data = Directory::new("live")?;
    let (sessions, world) = open(backend, &data.0, NEVER)?;
    let made = runtime.block_on(create(&sessions, SESSIONS, false))?;
    std::thread::sleep(LIVE);
    drop(made);
    let left = killed(sessions, world, &data.0)?;
    let (took, sessions, world) = recover(backend, &left.0)?;
    let ticks: Vec<u64> =
        sessions.list(None, SESSIONS as usize).iter().map(|s| s.view().tick).collect();
    world.stop();
    let mean = ticks.iter().sum::<u64>() / ticks.len() as u64;

    let data = Directory::new("plain")?;
    let (sessions, world) = open(backend, &data.0, NEVER)?;
    let made = runtime.block_on(create(&sessions, SESSIONS, true))?;
    let began = Instant::now();
    runtime.block_on(all(&made, move |session| async move {
        let step = StepSpec { ticks: Some(mean), ..StepSpec::default() };
        session.step(step).await.map(drop)
    }))?;
    let plain = began.elapsed();
    let ratio = took.as_secs_f64() / plain.as_secs_f64();
    println!("{SESSIONS} live sessions, {mean} ticks each");
    println!("  back after {:.2} s", took.as_secs_f64());
    println!("  plain stepping {:.2} s: {ratio:.2} times", plain.as_secs_f64());
    drop((made, sessions));
    world.stop();
    Ok(())
}

/// Frames of sessions that settle, with and without checkpoints.
fn checkpoints(runtime: &tokio::runtime::Runtime, backend: BackendChoice) -> Result<()> {
    println!("20 live sessions, frames with snow that moves");
    for (name, interval) in [("no checkpoints", NEVER), ("one after another", Duration::ZERO)] {
        let data = Directory::new("frames")?;
        let (sessions, world) = open(backend, &data.0, interval)?;
        let made = runtime.block_on(create(&sessions, 20, false))?;
        let slow = SettingsPatch { time_scale: Some(0.1), ..SettingsPatch::default() };
        runtime.block_on(all(&made, move |session| async move {
            session.change(Change::Settings(slow)).await.map(drop)
        }))?;
        std::thread::sleep(LIVE);
        let mut times: Vec<Duration> = sessions
            .vitals()
            .frame_times()
            .into_iter()
            .filter(|frame| frame.sessions >= 20)
            .skip(60)
            .map(|frame| frame.took)
            .collect();
        times.sort_unstable();
        let at =
            |share: f64| times[((times.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e3;
        println!(
            "  {name}: {} checkpoints, {} frames, median {:.2} ms, p99 {:.2} ms, longest {:.2} ms",
            sessions.vitals().store.checkpoints(),
            times.len(),
            at(0.5),
            at(0.99),
            at(1.0)
        );
        drop((made, sessions));
        world.stop();
    }
    Ok(())
}
