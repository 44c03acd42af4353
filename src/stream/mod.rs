//! The height stream: a WebSocket per client that carries the newest heights to it and its changes
//! to the session. `api/asyncapi.yaml` describes the messages.

mod answer;
mod cause;
pub mod codec;
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

/// The sub-protocols spoken here, the default one first.
const SUB_PROTOCOLS: [&str; 1] = ["firn.v1.json"];

/// Largest message of a client \[bytes\].
const LARGEST_MESSAGE: usize = 1 << 20;

/// Largest frame that is read at all \[bytes\]. A message that is a little too large is read to its
/// end, so that its client hears why the stream is closed.
const LARGEST_FRAME: usize = 2 * LARGEST_MESSAGE;

/// Bytes of a client's messages read at a time, and the start of its buffer for what it is sent.
const BUFFER: usize = 16 * 1024;

/// Streams heights and takes changes
///
/// A WebSocket with the sub-protocol `firn.v1.json`; `asyncapi.yaml` describes its messages.
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
    let upgrade = upgrade.protocols(SUB_PROTOCOLS);
    if offers_any && upgrade.selected_protocol().is_none() {
        let known = SUB_PROTOCOLS.join(", ");
        return Err(Problem::malformed(format!(
            "none of the sub-protocols offered is known; known are: {known}"
        )));
    }
    if app.draining.is_cancelled() {
        return Err(Problem::unavailable("the server is stopping"));
    }
    let (draining, tracked) = (app.draining.clone(), app.streams.token());
    let response = upgrade
        .max_message_size(LARGEST_MESSAGE)
        .max_frame_size(LARGEST_FRAME)
        .read_buffer_size(BUFFER)
        .write_buffer_size(BUFFER)
        .on_upgrade(async move |socket| {
            socket::serve(socket, session, draining).await;
            drop(tracked);
        });
    Ok(response.into_response())
}
