//! The calls, one file per noun.

pub mod air_temperature;
pub mod cells;
pub mod clearings;
pub mod colliders;
pub mod columns;
pub mod health;
pub mod height;
pub mod heights;
pub mod mass;
pub mod metrics;
pub mod openapi;
pub mod probes;
pub mod profile;
pub mod render;
pub mod sessions;
pub mod snapshots;
pub mod snowfalls;
pub mod tokens;

use axum::http::{HeaderName, HeaderValue};
use axum::response::{IntoResponse, Response};

use crate::problem::{FieldError, Problem};
use crate::session::{Applied, Stamp};

/// The headers that date an answer: the tick, and the number of the newest published change.
fn stamp_headers(stamp: Stamp) -> [(HeaderName, HeaderValue); 2] {
    [
        (HeaderName::from_static("firn-tick"), HeaderValue::from(stamp.tick)),
        (HeaderName::from_static("firn-seq"), HeaderValue::from(stamp.seq)),
    ]
}

/// The first of a number of cells along an axis of the grid, and how many there are: up to the edge
/// where nothing is said. `names` are those of the parameters, in that order.
fn span(
    names: [&str; 2],
    first: Option<u32>,
    count: Option<u32>,
    cells: u32,
    errors: &mut Vec<FieldError>,
) -> (u32, u32) {
    let mut reject = |name: &str, detail| {
        errors.push(FieldError { pointer: name.to_owned(), detail });
        (0, 0)
    };
    let start = first.unwrap_or(0);
    if start >= cells {
        let detail = format!("{start} is outside the grid's cells 0 to {}", cells - 1);
        return reject(names[0], detail);
    }
    let most = cells - start;
    match count.unwrap_or(most) {
        count if count <= most => (start, count),
        count => {
            let detail = format!("{count} from {start} on reach beyond the grid; {most} fit");
            reject(names[1], detail)
        }
    }
}

/// Answers a change with what it did.
fn applied(applied: Applied) -> Response {
    axum::Json(applied).into_response()
}

/// Does work that takes a while off the threads that serve everybody.
async fn off_thread<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Problem> {
    tokio::task::spawn_blocking(work)
        .await
        .map_err(|_| Problem::internal("making the answer failed"))
}
