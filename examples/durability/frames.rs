//! What checkpoints do to frames.

use std::time::Duration;

use firn::config::BackendChoice;
use firn::session::{Change, SettingsPatch};
use tokio::runtime::Runtime;

use super::{Directory, NEVER, Result, all, create, open};

/// Time in which frames are watched.
const WATCHED: Duration = Duration::from_secs(10);

/// Frames of sessions that settle, with and without checkpoints.
pub fn measure(runtime: &Runtime, backend: BackendChoice) -> Result<()> {
    println!("20 live sessions, frames with snow that moves");
    for (name, interval) in [("no checkpoints", NEVER), ("one after another", Duration::ZERO)] {
        let data = Directory::new("frames")?;
        let (sessions, world) = open(backend, &data.0, interval)?;
        let made = runtime.block_on(create(&sessions, 20, false))?;
        let slow = SettingsPatch { time_scale: Some(0.1), ..SettingsPatch::default() };
        runtime.block_on(all(&made, move |session| async move {
            session.change(Change::Settings(slow)).await.map(drop)
        }))?;
        std::thread::sleep(WATCHED);
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
