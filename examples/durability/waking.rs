//! How long a request waits for a session that hibernates.

use std::time::{Duration, Instant};

use firn::config::BackendChoice;
use firn_protocol::{SessionSpec, StepSpec};
use tokio::runtime::Runtime;

use super::{Directory, NEVER, Result, open, spec};

const WAKES: usize = 11;
/// Shortest time after which a session may hibernate \[s\].
const IDLE: f64 = 1.0;

/// Wakes a settled session again and again, each time by a read that the device has to answer.
pub fn measure(runtime: &Runtime, backend: BackendChoice) -> Result<()> {
    let data = Directory::new("waking")?;
    let (sessions, world) = open(backend, &data.0, NEVER)?;
    let spec = SessionSpec { idle_timeout_s: Some(IDLE), ..spec(0, true) };
    let id = spec.id.clone().unwrap_or_default();
    let (session, _) = runtime.block_on(sessions.create(spec))?;
    let settle =
        StepSpec { until_settled: Some(true), max_seconds: Some(3600.0), ..StepSpec::default() };
    runtime.block_on(session.step(settle))?;
    drop(session);
    let mut times = Vec::new();
    for _ in 0..WAKES {
        while sessions.vitals().hibernating() == 0 {
            std::thread::sleep(Duration::from_millis(1));
        }
        let began = Instant::now();
        runtime.block_on(async { sessions.get(&id)?.mass().await })?;
        times.push(began.elapsed());
    }
    times.sort_unstable();
    println!(
        "{WAKES} wakes of a settled session of 50³, from a request for its mass to the answer"
    );
    println!(
        "  shortest {:.1?}, median {:.1?}, longest {:.1?}",
        times[0],
        times[WAKES / 2],
        times[WAKES - 1]
    );
    drop(sessions);
    world.stop();
    Ok(())
}
