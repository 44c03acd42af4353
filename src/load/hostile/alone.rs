//! What a hostile session gets of the device while nobody else wants it.

use std::time::{Duration, Instant};

use firn_client::Method;
use serde::Serialize;
use serde_json::json;
use tokio::task::JoinHandle;

use crate::load::{LoadError, PATIENCE};

use super::Run;
use super::scenario::{Scenario, prepare};

/// Time between two looks at a session's ticks.
const LOOK: Duration = Duration::from_millis(50);

/// Ticks of a step that takes longer than any run.
const STEP: u64 = 1_000_000;

/// What a session got, alone on the server.
#[derive(Clone, Debug, Serialize)]
pub struct Alone {
    /// While it was live.
    pub live: Got,
    /// While it was paused and stepped, which waits for no beat: all that there is.
    pub stepped: Got,
}

/// What a session got in some time.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Got {
    /// Device time that it was charged with, in a second of the clock.
    pub charged_share: f64,
    /// Time that the server's frames took, in a second of the clock.
    pub frame_share: f64,
    /// Ticks per second, where two of them were seen \[Hz\].
    pub ticks_per_second: Option<f64>,
}

/// Measures a session for about the plan's duration while it is stepped, and a new one while it is live:
/// changes to one that is being stepped wait for the end of a long tick. It is deleted then.
pub(super) async fn measure(run: &Run<'_>, id: &str) -> Result<Alone, LoadError> {
    prepare(run, Scenario::Ticks, id).await?;
    let step = step(run, id);
    let stepped = got(run, id).await;
    step.abort();
    let stepped = stepped?;
    run.api.delete(id).await?;
    prepare(run, Scenario::Ticks, id).await?;
    run.api.unpause(id).await?;
    let live = got(run, id).await?;
    run.api.delete(id).await?;
    Ok(Alone { live, stepped })
}

async fn got(run: &Run<'_>, id: &str) -> Result<Got, LoadError> {
    let began = Instant::now();
    let (charged, frames) = (run.api.device_seconds(id).await?, run.api.frame_seconds().await?);
    let ticks_per_second = pace(run, id).await?;
    let seconds = began.elapsed().as_secs_f64();
    Ok(Got {
        charged_share: (run.api.device_seconds(id).await? - charged) / seconds,
        frame_share: (run.api.frame_seconds().await? - frames) / seconds,
        ticks_per_second,
    })
}

fn step(run: &Run<'_>, id: &str) -> JoinHandle<()> {
    let (api, path) = (run.api.clone(), format!("/{id}/step"));
    tokio::spawn(async move {
        // It is never answered, and what it does is measured.
        let _ = api.ask(Method::POST, &path, Some(json!({"ticks": STEP}))).await;
    })
}

/// Ticks per second, from the first tick that is seen to the last. Where a tick takes long, it takes longer
/// than the plan's duration to see two.
async fn pace(run: &Run<'_>, id: &str) -> Result<Option<f64>, LoadError> {
    let began = Instant::now();
    let mut newest = run.api.tick(id).await?;
    let mut seen: Option<(Instant, u64)> = None;
    let mut pace = None;
    let is_seen = |pace: Option<f64>| {
        began.elapsed() >= run.plan.duration && (pace.is_some() || began.elapsed() >= PATIENCE)
    };
    while !is_seen(pace) && !run.stop.is_cancelled() {
        tokio::time::sleep(LOOK).await;
        let tick = run.api.tick(id).await?;
        if tick == newest {
            continue;
        }
        newest = tick;
        match seen {
            None => seen = Some((Instant::now(), tick)),
            Some((at, first)) => pace = Some((tick - first) as f64 / at.elapsed().as_secs_f64()),
        }
    }
    Ok(pace)
}
