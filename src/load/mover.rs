//! Moves a session's objects through the snow, all of them in one batch, over one socket.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use firn_client::Stream;
use firn_protocol::stream::{Command, SubProtocol};
use firn_protocol::{ColliderBatch, ColliderSpec};
use firn_snow::{Position, Shape};
use tokio::time::MissedTickBehavior;

use super::api::cause;
use super::message::{self, Content};
use super::tally::Moves;
use super::viewer::open;
use super::{CELL_SIZE, Plan, Shared};

/// Least columns of a grid that objects move on, along each side.
pub const LEAST_SIDE: u32 = 8;

/// Side of an object \[m\].
const SIDE: f64 = 0.8;

/// Mass of an object \[kg\].
const MASS: f64 = 80.0;

/// Greatest speed of an object along x and along z \[m/s\].
const SPEED: f64 = 1.0;

/// Moves the objects until the run ends, once per tick.
pub async fn drive(plan: Plan, id: String, shared: Arc<Shared>) -> Moves {
    let mut moves = Moves::default();
    if let Err(cause) = live(&plan, &id, &shared, &mut moves).await {
        moves.dropped = Some(cause);
    }
    moves
}

async fn live(plan: &Plan, id: &str, shared: &Shared, moves: &mut Moves) -> Result<(), String> {
    let mut stream = open(&shared.client, id, SubProtocol::Json).await?;
    let began = Instant::now();
    let mut beat = tokio::time::interval(Duration::from_secs_f64(1.0 / plan.tick_rate));
    beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        let batch = tokio::select! {
            biased;
            () = shared.end.cancelled() => break,
            _ = beat.tick() => batch(plan, began.elapsed().as_secs_f64()),
        };
        let sent = Instant::now();
        let content = tokio::select! {
            biased;
            () = shared.end.cancelled() => break,
            content = ask(&mut stream, &batch) => content?,
        };
        if shared.counting.load(Ordering::Relaxed) {
            match content {
                Content::Ack => {
                    moves.acks += 1;
                    moves.times.note(sent.elapsed().as_secs_f64());
                }
                _ => moves.refused += 1,
            }
        }
    }
    stream.close().await;
    Ok(())
}

/// Sends a batch and waits for the answer.
async fn ask(stream: &mut Stream, batch: &Command) -> Result<Content, String> {
    stream.send(batch).await.map_err(|error| cause(&error))?;
    loop {
        let content = message::read(&stream.next_raw().await.map_err(|error| cause(&error))?);
        if let Some(content @ (Content::Ack | Content::Refused(_))) = content {
            return Ok(content);
        }
    }
}

/// All objects as they stand at a time \[s\]: each on its own curve all over the grid.
fn batch(plan: &Plan, time: f64) -> Command {
    let along = |columns: u32, phase: f64| {
        let middle = f64::from(columns) * CELL_SIZE / 2.0;
        // A hair inside, whatever the rounding.
        let reach = middle - SIDE / 2.0 - CELL_SIZE / 100.0;
        middle + reach * (time * SPEED / reach + phase).sin()
    };
    let object = |i: usize| {
        let phase = i as f64;
        let x = along(plan.grid.width, 2.4 * phase);
        let z = along(plan.grid.depth, 1.1 + 1.7 * phase);
        ColliderSpec {
            id: Some(format!("object-{i}")),
            mass: MASS,
            shape: Some(Shape::Box { width: SIDE, depth: SIDE }),
            position: Position { x, z },
            ..ColliderSpec::default()
        }
    };
    let put = (0..plan.colliders).map(object).collect();
    Command::Colliders { id: 1, batch: ColliderBatch { put, ..ColliderBatch::default() } }
}
