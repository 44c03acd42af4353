//! The height stream: a WebSocket per client that carries the newest heights to it and its changes
//! to the session. `api/asyncapi.yaml` describes the messages.

mod answer;
mod cache;
mod cause;
pub mod codec;
mod metrics;
mod rate;
mod receive;
mod request;
mod send;
mod socket;
mod subscription;
mod tiles;

use axum::extract::rejection::PathRejection;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::{Path, State};
use axum::response::{IntoResponse, Response};

use crate::http::App;
use crate::problem::Problem;

use tiles::LARGEST_PART;

pub use cache::EncodedTiles;
pub use cause::Cause;
pub use metrics::StreamMetrics;
pub use tiles::Protocol;

/// Largest message of a client \[bytes\].
const LARGEST_MESSAGE: usize = 1 << 20;

/// Largest frame that is read at all \[bytes\]. A message that is a little too large is read to its
/// end, so that its client hears why the stream is closed.
const LARGEST_FRAME: usize = 2 * LARGEST_MESSAGE;

/// Bytes of a client's messages read at a time. Every client has a buffer of this size for as long
/// as it is connected, and the library's 128 KiB would be 128 MB for a thousand that only listen.
/// Of who moves 200 objects at 60 Hz it takes some ten reads a frame.
const READ_BUFFER: usize = 4 * 1024;

/// Bytes that are gathered before they are written. Every message is flushed at once, so that this
/// only says in what pieces a long one goes out.
const WRITE_BUFFER: usize = 4 * 1024;

/// Most bytes that wait for being written: the message under way, which is one part at most, an
/// answer to a ping, and the farewell.
const LARGEST_BACKLOG: usize = LARGEST_PART + LARGEST_PART / 16;

/// Streams heights and takes changes
///
/// A WebSocket with the sub-protocol `firn.v1.json`, which is the default, or `firn.v1.bin`, whose
/// heights are binary; `asyncapi.yaml` describes the messages, `height-stream.md` the bytes.
///
/// # Errors
/// 400 where the request is no WebSocket upgrade or offers only unknown sub-protocols; 404 where
/// there is no such session; 503 where the server is stopping.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/stream",
    tag = "snow",
    params(("id" = String, Path, description = "Name of the session")),
    responses(
        (status = 101, description = "The stream begins"),
        (status = 400, description = "No WebSocket upgrade, or no known sub-protocol",
            body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "No such session",
            body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "The server is stopping",
            body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn stream(
    State(app): State<App>,
    path: Result<Path<String>, PathRejection>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Problem> {
    let Path(id) = path?;
    let session = app.sessions.get(&id)?;
    let upgrade = upgrade.map_err(|rejection| {
        Problem::malformed(format!("a stream begins with a WebSocket upgrade: {rejection}"))
    })?;
    let offers_any = upgrade.requested_protocols().next().is_some();
    let names = Protocol::ALL.map(Protocol::name);
    let upgrade = upgrade.protocols(names);
    let chosen = upgrade.selected_protocol().and_then(|chosen| chosen.to_str().ok());
    let chosen = Protocol::ALL.into_iter().find(|protocol| chosen == Some(protocol.name()));
    if offers_any && chosen.is_none() {
        let known = names.join(", ");
        return Err(Problem::malformed(format!(
            "none of the sub-protocols offered is known; known are: {known}"
        )));
    }
    if app.draining.is_cancelled() {
        return Err(Problem::unavailable("the server is stopping"));
    }
    let tracked = app.streams.token();
    let protocol = chosen.unwrap_or(Protocol::Json);
    let response = upgrade
        .max_message_size(LARGEST_MESSAGE)
        .max_frame_size(LARGEST_FRAME)
        .read_buffer_size(READ_BUFFER)
        .write_buffer_size(WRITE_BUFFER)
        .max_write_buffer_size(LARGEST_BACKLOG)
        .on_upgrade(async move |socket| {
            socket::serve(socket, session, protocol, &app).await;
            drop(tracked);
        });
    Ok(response.into_response())
}
