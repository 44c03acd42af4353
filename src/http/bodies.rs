//! Bodies of requests, read whole before a handler sees them: in time, no longer than they may be,
//! and all of them together within a budget.

use std::collections::TryReserveError;

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{Request, State};
use axum::middleware::Next;
use axum::response::Response;
use futures_util::StreamExt;
use tokio::time::timeout;

use crate::budget::{Budget, Reservation};
use crate::limit::Limit;
use crate::problem::Problem;

use super::state::App;

/// What every body may have without being counted \[bytes\].
const SMALL: usize = 16 * 1024;

/// Reads the body of a request.
///
/// # Errors
/// 413 where it is too long, without reading any of it where that is announced; 503 where it takes too
/// long to arrive, or the bodies that are arriving leave no room for it; 507 where there is no memory;
/// 400 where it breaks off.
pub async fn read_whole(
    State(app): State<App>,
    request: Request,
    next: Next,
) -> Result<Response, Problem> {
    if request.body().is_end_stream() {
        return Ok(next.run(request).await);
    }
    let (parts, body) = request.into_parts();
    let limit = app.requests.request_timeout;
    let read = timeout(limit, read(body, app.requests.max_body_bytes, &app.bodies)).await;
    let body = read.unwrap_or_else(|_| {
        let detail = format!("the body did not arrive within {} s", limit.as_secs_f64());
        Err(Problem::unavailable(detail).from_limit(Limit::RequestTimeout))
    })?;
    Ok(next.run(Request::from_parts(parts, body)).await)
}

async fn read(body: Body, most: usize, budget: &Budget) -> Result<Body, Problem> {
    let too_long = || {
        let detail = format!("the body is longer than the {most} bytes that this server reads");
        Problem::too_large(detail).from_limit(Limit::MaxBodyBytes)
    };
    // As announced: a client that asks first is told before it sends anything.
    let announced = body.size_hint().lower();
    if announced > most as u64 {
        return Err(too_long());
    }
    let mut read = Read { bytes: Vec::new(), memory: None };
    read.bytes.try_reserve_exact(announced as usize).map_err(no_memory)?;
    let mut pieces = body.into_data_stream();
    while let Some(piece) = pieces.next().await {
        let piece = piece.map_err(|_| Problem::malformed("the body breaks off"))?;
        if read.bytes.len() + piece.len() > most {
            return Err(too_long());
        }
        read.bytes.try_reserve(piece.len()).map_err(no_memory)?;
        read.bytes.extend_from_slice(&piece);
        read.count(budget)?;
    }
    Ok(Body::from(Bytes::from_owner(read)))
}

/// What has arrived of a body.
struct Read {
    bytes: Vec<u8>,
    memory: Option<Reservation>,
}

impl Read {
    /// Counts it off a budget.
    fn count(&mut self, budget: &Budget) -> Result<(), Problem> {
        if self.bytes.len() <= SMALL {
            return Ok(());
        }
        let bytes = self.bytes.len() as u64;
        let counted = match &mut self.memory {
            Some(memory) => memory.resize(bytes),
            free => {
                *free = budget.try_reserve(bytes);
                free.is_some()
            }
        };
        if counted {
            return Ok(());
        }
        let detail = "the bodies that other clients are sending take all the memory that there is for \
                      them; try again";
        Err(Problem::unavailable(detail).from_limit(Limit::MaxBodies))
    }
}

impl AsRef<[u8]> for Read {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

fn no_memory(_: TryReserveError) -> Problem {
    Problem::no_memory("there is no memory for a body of this length")
}
