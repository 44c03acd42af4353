//! How long it takes until everything is back after a kill.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use firn::config::BackendChoice;
use firn::driver::Driver;
use firn::session::{Change, Sessions};
use firn_protocol::{Region, Snowfall, StepSpec};
use tokio::runtime::Runtime;

use super::{Directory, FILE, NEVER, Result, all, create, open};

const SESSIONS: u64 = 100;
const CHANGES: u64 = 1000;
/// Time that live sessions have to go through again.
const LIVE: Duration = Duration::from_secs(10);

/// Sessions that stand still and were changed often, and sessions that lived for a while.
pub fn measure(runtime: &Runtime, backend: BackendChoice) -> Result<()> {
    paused(runtime, backend)?;
    live(runtime, backend)
}

/// What a kill would leave: no last checkpoints, no orderly end.
fn killed(sessions: Sessions, world: Driver, data: &Path) -> Result<Directory> {
    let left = Directory::new("left")?;
    fs::copy(data.join(FILE), left.0.join(FILE))?;
    drop(sessions);
    world.stop();
    Ok(left)
}

/// Time until everything that is stored is back, and the sessions.
fn recover(backend: BackendChoice, data: &Path) -> Result<(Duration, Sessions, Driver)> {
    let began = Instant::now();
    let (sessions, world) = open(backend, data, NEVER)?;
    while !sessions.vitals().is_recovered() {
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok((began.elapsed(), sessions, world))
}

fn paused(runtime: &Runtime, backend: BackendChoice) -> Result<()> {
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

fn live(runtime: &Runtime, backend: BackendChoice) -> Result<()> {
    let data = Directory::new("live")?;
    let (sessions, world) = open(backend, &data.0, NEVER)?;
    let made = runtime.block_on(create(&sessions, SESSIONS, false))?;
    std::thread::sleep(LIVE);
    drop(made);
    let left = killed(sessions, world, &data.0)?;
    let (took, sessions, world) = recover(backend, &left.0)?;
    let ticks: Vec<u64> =
        sessions.list(None, None, SESSIONS as usize).iter().map(|s| s.view().tick).collect();
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
