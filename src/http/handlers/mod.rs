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
pub mod sessions;
pub mod snapshots;
pub mod snowfalls;

use axum::http::{HeaderName, HeaderValue};
use axum::response::{IntoResponse, Response};

use crate::problem::Problem;
use crate::session::{Applied, Stamp};

/// The headers that date an answer: the tick, and the number of the newest published change.
fn stamp_headers(stamp: Stamp) -> [(HeaderName, HeaderValue); 2] {
    [
        (HeaderName::from_static("firn-tick"), HeaderValue::from(stamp.tick)),
        (HeaderName::from_static("firn-seq"), HeaderValue::from(stamp.seq)),
    ]
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
