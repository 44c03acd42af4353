//! The calls, one file per noun.

pub mod air_temperature;
pub mod cells;
pub mod checkpoints;
pub mod clearings;
pub mod colliders;
pub mod columns;
pub mod health;
pub mod height;
pub mod heights;
pub mod mass;
pub mod metrics;
pub mod probes;
pub mod profile;
pub mod render;
pub mod samples;
pub mod sessions;
pub mod snapshots;
pub mod snowfalls;
pub mod stamps;
pub mod store;
pub mod terrain;
pub mod tokens;
pub mod unlock;
pub mod usage;
pub mod weather;

use axum::http::{HeaderName, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use firn_protocol::Stamp;
use serde::Serialize;

use crate::http::state::App;
use crate::problem::{FieldError, Problem};
use crate::session::{Applied, Reading};

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

/// Answers with what is made of what was read of the snow.
async fn respond<T: Send + 'static, R: IntoResponse>(
    app: &App,
    reading: Reading<T>,
    make: impl FnOnce(T) -> Result<R, Problem> + Send + 'static,
) -> Result<Response, Problem> {
    let respond = |found| make(found).map(IntoResponse::into_response);
    let (response, leave) = app.answers.read(reading, respond).await?;
    Ok(leave.take(response).await)
}

/// A body with its media type.
type JsonBody = ([(HeaderName, HeaderValue); 1], Vec<u8>);

/// A JSON body that has about so many bytes.
///
/// # Errors
/// 507 where there is no memory for it.
fn json(value: &impl Serialize, bytes: usize) -> Result<JsonBody, Problem> {
    let mut body = reserved(bytes)?;
    serde_json::to_writer(&mut body, value)
        .map_err(|error| Problem::internal(format!("the answer can't be written: {error}")))?;
    Ok(([(header::CONTENT_TYPE, HeaderValue::from_static("application/json"))], body))
}

/// Room for so many bytes.
///
/// # Errors
/// 507 where there is no memory for them.
fn reserved(bytes: usize) -> Result<Vec<u8>, Problem> {
    let mut room = Vec::new();
    let no_memory = |_| Problem::no_memory("there is no memory for an answer of this length");
    room.try_reserve_exact(bytes).map_err(no_memory)?;
    Ok(room)
}
