//! The neighbour: what a small session and its client get.

use std::sync::Arc;
use std::time::{Duration, Instant};

use firn_protocol::{SessionSpec, SnowLayer};
use firn_snow::Grid;
use serde::Serialize;
use tokio::task::JoinSet;

use crate::load::tally::Times;
use crate::load::{CELL_SIZE, LoadError, PATIENCE, Percentiles, Plan};

use super::Run;

/// Ticks per second \[Hz\].
const TICK_RATE: f64 = 60.0;

/// Columns along each side, and cells that each can hold.
const SIDE: u32 = 32;
const HEIGHT: u32 = 20;

/// Time from a change to the next.
const PERIOD: Duration = Duration::from_millis(100);

/// What the neighbour got.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// Ticks per second \[Hz\].
    pub ticks_per_second: f64,
    /// Part of the ticks that its rate stands for.
    pub tick_share: f64,
    /// Changes that were asked for.
    pub changes: u64,
    /// Those of them that were refused or not answered.
    pub refused: u64,
    /// From a change to its answer \[ms\]. Changes don't wait for each other.
    pub change_ms: Option<Percentiles>,
}

/// Requests that may be under way at a time.
pub(super) fn most_requests(plan: &Plan) -> u64 {
    let all = plan.duration.div_duration_f64(PERIOD) as u64;
    all.min(PATIENCE.div_duration_f64(PERIOD) as u64)
}

/// Creates the session, paused.
pub(super) async fn create(run: &Run<'_>, id: &str) -> Result<(), LoadError> {
    let spec = SessionSpec {
        id: Some(id.to_owned()),
        grid: Grid { width: SIDE, depth: SIDE, height: HEIGHT, cell_size: CELL_SIZE },
        tick_rate: TICK_RATE,
        paused: true,
        initial_snow: vec![SnowLayer::new(1.0)],
        ..SessionSpec::default()
    };
    run.api.create_from(&spec).await
}

/// Sets the session running and changes it for the plan's duration.
pub(super) async fn measure(run: &Run<'_>, id: &str) -> Result<Measured, LoadError> {
    run.api.unpause(id).await?;
    let (first, began) = (run.api.tick(id).await?, Instant::now());
    let mut changes = JoinSet::new();
    let mut beat = tokio::time::interval(PERIOD);
    while began.elapsed() < run.plan.duration && !run.stop.is_cancelled() {
        beat.tick().await;
        let (api, id) = (Arc::clone(&run.api), id.to_owned());
        changes.spawn(async move {
            let asked = Instant::now();
            let answered = tokio::time::timeout(PATIENCE, api.snow(&id)).await;
            answered.is_ok_and(|answer| answer.is_ok()).then(|| asked.elapsed())
        });
    }
    let last = run.api.tick(id).await?;
    let ticks_per_second = last.saturating_sub(first) as f64 / began.elapsed().as_secs_f64();
    let (mut times, mut asked) = (Times::default(), 0);
    while let Some(answered) = changes.join_next().await {
        asked += 1;
        if let Ok(Some(time)) = answered {
            times.note(time.as_secs_f64());
        }
    }
    Ok(Measured {
        ticks_per_second,
        tick_share: ticks_per_second / TICK_RATE,
        changes: asked,
        refused: asked - times.count(),
        change_ms: Percentiles::of(&times),
    })
}
