//! What checkpoints do to frames.

use std::time::Duration;

use firn::config::BackendChoice;
use firn::session::FrameTime;
use firn::store::RedbStore;
use tokio::runtime::Runtime;

use super::{Directory, NEVER, Result, create, open_on};

/// Sessions in which snow moves, each with a cycle in every frame.
const SESSIONS: u32 = 4;
/// Time in which frames are watched, no longer than they are remembered.
const WATCHED: Duration = Duration::from_secs(8);
/// Frames before the first that counts.
const WARM_UP: usize = 60;
/// Every frame with a cycle is published, so that all of them do the same.
const PUBLISH_RATE: f64 = 60.0;
/// Turns of both, one after the other: others may use the machine too.
const TURNS: usize = 3;

/// Frames of sessions that settle, with checkpoints one after another and without any.
pub fn measure(runtime: &Runtime, backend: BackendChoice) -> Result<()> {
    println!("{SESSIONS} live sessions of 50³, snow moves in every frame");
    for _ in 0..TURNS {
        let frames = watch(runtime, backend, NEVER)?;
        tell("without checkpoints", &frames, |_| true);
        let frames = watch(runtime, backend, Duration::ZERO)?;
        tell("beside checkpoints, frames with cycles", &frames, |f| f.sessions == SESSIONS);
        tell("frames in which a checkpoint is taken", &frames, |f| f.checkpoints > 0);
    }
    Ok(())
}

/// What frames take in a new world, those left out that only answer.
fn watch(
    runtime: &Runtime,
    backend: BackendChoice,
    checkpoint_interval: Duration,
) -> Result<Vec<FrameTime>> {
    let data = Directory::new("frames")?;
    let store = Box::new(RedbStore::in_directory(&data.0)?);
    let (sessions, world) = open_on(backend, store, checkpoint_interval, PUBLISH_RATE)?;
    let made = runtime.block_on(create(&sessions, SESSIONS.into(), false))?;
    std::thread::sleep(WATCHED);
    let frames = sessions.vitals().frame_times().into_iter();
    let counts = |frame: &FrameTime| frame.sessions == SESSIONS || frame.checkpoints > 0;
    let frames = frames.filter(counts).skip(WARM_UP).collect();
    drop((made, sessions));
    world.stop();
    Ok(frames)
}

fn tell(which: &str, frames: &[FrameTime], of: impl Fn(&FrameTime) -> bool) {
    let frames = frames.iter().filter(|frame| of(frame));
    let mut times: Vec<Duration> = frames.map(|frame| frame.took).collect();
    times.sort_unstable();
    let Some(last) = times.len().checked_sub(1) else {
        println!("  {which}: none");
        return;
    };
    let at = |share: f64| times[(last as f64 * share) as usize].as_secs_f64() * 1e3;
    println!(
        "  {which}: {}, median {:.2} ms, p99 {:.2} ms, longest {:.2} ms",
        times.len(),
        at(0.5),
        at(0.99),
        at(1.0)
    );
}
