//! Reads the snow at many points again and again while it moves, and measures how long the answers take.

use std::fmt;
use std::time::{Duration, Instant};

use firn_protocol::{Load, SampleBatch, SampleField};
use serde::Serialize;
use tokio_util::sync::CancellationToken;

use super::api::Api;
use super::report::Percentiles;
use super::tally::Times;
use super::{CELL_SIZE, LoadError, Plan, Progress};

/// What somebody on foot weighs \[kg\], and what of the snow is under a foot \[m²\].
const MASS: f64 = 80.0;
const AREA: f64 = 0.03;

/// Simulated time of a step on foot \[s\].
const STEP: f64 = 0.4;

/// What came of a run: times from a request to its answer, read and understood.
#[derive(Clone, Debug, Serialize)]
pub struct SamplesReport {
    /// Points of each request, all over the grid.
    pub points: usize,
    /// Length of the run \[s\].
    pub seconds: f64,
    /// Ticks per second of the session.
    pub ticks_per_second: f64,
    /// What was asked for, and how long it took \[ms\].
    pub asked: Vec<(&'static str, Option<Percentiles>)>,
}

/// Creates a session with fresh snow that settles, samples it for the plan's duration, a kind of question after
/// the other, and deletes it again.
///
/// # Errors
/// Where the plan can't be carried out.
pub async fn run_samples(
    plan: &Plan,
    points: usize,
    observe: impl Fn(Progress),
    stop: &CancellationToken,
) -> Result<SamplesReport, LoadError> {
    let api = Api::new(plan)?;
    let id = format!("load-{}", ulid::Ulid::generate().to_string().to_lowercase());
    api.create(&id, plan).await?;
    api.unpause(&id).await?;
    let report = measure(plan, &api, &id, points, observe, stop).await;
    api.delete(&id).await?;
    report
}

async fn measure(
    plan: &Plan,
    api: &Api,
    id: &str,
    points: usize,
    observe: impl Fn(Progress),
    stop: &CancellationToken,
) -> Result<SamplesReport, LoadError> {
    let questions = questions(plan, points);
    let mut times = vec![Times::default(); questions.len()];
    let (first, began) = (api.tick(id).await?, Instant::now());
    while began.elapsed() < plan.duration && !stop.is_cancelled() {
        for ((_, batch), times) in questions.iter().zip(&mut times) {
            let asked = Instant::now();
            api.sample(id, batch).await?;
            times.note(asked.elapsed().as_secs_f64());
            // A game asks once a tick, not as often as it can.
            tokio::time::sleep(Duration::from_secs_f64(0.25 / plan.tick_rate)).await;
        }
        let messages = times.iter().map(Times::count).sum();
        observe(Progress { connected: 1, elapsed: began.elapsed(), messages, bytes: 0 });
    }
    let seconds = began.elapsed().as_secs_f64();
    let asked = questions.iter().zip(&times);
    Ok(SamplesReport {
        points,
        seconds,
        ticks_per_second: api.tick(id).await?.saturating_sub(first) as f64 / seconds,
        asked: asked.map(|((name, _), times)| (*name, Percentiles::of(times))).collect(),
    })
}

/// What is asked for, at points that are spread evenly all over the grid.
fn questions(plan: &Plan, points: usize) -> [(&'static str, SampleBatch); 4] {
    // The plastic number's sequence: neighbours in it are far apart, and no place is crowded.
    let along = |columns: u32, i: usize, part: f64| {
        (0.5 + part * i as f64).fract() * f64::from(columns) * CELL_SIZE
    };
    let point = |i| {
        let (x, z) = (0.754_877_666, 0.569_840_290);
        [along(plan.grid.width, i, x), along(plan.grid.depth, i, z)]
    };
    let points: Vec<[f64; 2]> = (0..points).map(point).collect();
    let batch = |fields, load| SampleBatch { points: points.clone(), fields, load };
    let load = |duration| Some(Load { mass: MASS, area: AREA, duration });
    let all = || {
        [
            SampleField::of_the_surface(),
            vec![SampleField::Density, SampleField::Hardness, SampleField::Sink],
        ]
        .concat()
    };
    [
        ("depth, ground, elevation, normal", batch(SampleField::of_the_surface(), None)),
        ("density, hardness", batch(vec![SampleField::Density, SampleField::Hardness], None)),
        ("all, sink at rest", batch(all(), load(None))),
        ("all, sink in 0.4 s", batch(all(), load(Some(STEP)))),
    ]
}

impl fmt::Display for SamplesReport {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let SamplesReport { points, seconds, ticks_per_second, asked } = self;
        write!(f, "{points} points, {seconds:.1} s, {ticks_per_second:.1} ticks per second")?;
        for (name, times) in asked {
            match times {
                Some(times) => write!(f, "\n{name:<33} {times}")?,
                None => write!(f, "\n{name:<33} was not answered")?,
            }
        }
        Ok(())
    }
}
