//! The height stream: a WebSocket per client that carries the newest heights to it and its changes
//! to the session. `api/asyncapi.yaml` describes the messages.

mod answer;
mod cache;
mod cause;
pub mod codec;
mod metrics;
mod quantum;
mod receive;
mod region;
mod request;
mod send;
mod socket;
mod subscription;
mod tiles;

use axum::extract::State;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::Response;
use utoipa::IntoParams;

use crate::http::{App, Caller, FromQuery, Params, Query, Segments, bearer};
use crate::problem::Problem;
use crate::session::Visit;

use tiles::LARGEST_PART;

pub use cache::EncodedTiles;
pub use cause::Cause;
pub use metrics::StreamMetrics;
pub use request::{ColumnRegion, Control, Refusal, Request, Resume, Subscribe, Update};
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

/// How a browser says who it is: it can't set headers of a WebSocket.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct StreamQuery {
    /// The API key or one of the session's tokens, where there is no `Authorization` header.
    token: Option<String>,
}

impl FromQuery for StreamQuery {
    fn from_query(params: &mut Params) -> StreamQuery {
        StreamQuery { token: params.text("token") }
    }
}

/// Streams heights and takes changes
///
/// A WebSocket with the sub-protocol `firn.v1.json`, which is the default, or `firn.v1.bin`, whose
/// heights are binary; `asyncapi.yaml` describes the messages, `height-stream.md` the bytes. Where
/// the token is not good or there is no such session, browsers (whose requests have an `Origin`) get
/// a stream that is closed at once with 3500 or 3501, because they can't see a status.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/stream",
    tag = "snow",
    params(("id" = String, Path, description = "Name of the session"), StreamQuery),
    responses(
        (status = 101, description = "The stream begins"),
        (status = 400, description = "No WebSocket upgrade, or no known sub-protocol",
            body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "No such session",
            body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "The server is bringing sessions back, or stopping",
            body = Problem, content_type = "application/problem+json"),
    )
)]
pub async fn stream(
    State(app): State<App>,
    Segments(id): Segments<String>,
    Query(query): Query<StreamQuery>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Problem> {
    let admitted = admit(&app, &id, bearer(&headers).or(query.token.as_deref()));
    let is_browser = headers.contains_key(header::ORIGIN);
    match (admitted, upgrade) {
        (Ok((session, caller)), Ok(upgrade)) => begin(app, upgrade, session, caller),
        (Err(problem), Ok(upgrade)) if is_browser => refuse(app, upgrade, problem),
        (Err(problem), _) => Err(problem),
        (Ok(_), Err(rejection)) => Err(Problem::malformed(format!(
            "a stream begins with a WebSocket upgrade: {rejection}"
        ))),
    }
}

/// Who wants to stream, and what.
fn admit(app: &App, id: &str, token: Option<&str>) -> Result<(Visit, Caller), Problem> {
    let caller = app.gate.access.admit(token, app.sessions.find(id)?.as_deref())?;
    Ok((app.sessions.get(id)?, caller))
}

/// Begins a stream.
fn begin(
    app: App,
    upgrade: WebSocketUpgrade,
    session: Visit,
    caller: Caller,
) -> Result<Response, Problem> {
    let (upgrade, protocol) = negotiate(upgrade)?;
    if app.draining.is_cancelled() {
        return Err(Problem::unavailable("the server is stopping"));
    }
    let tracked = app.streams.token();
    let response = upgrade
        .max_message_size(LARGEST_MESSAGE)
        .max_frame_size(LARGEST_FRAME)
        .read_buffer_size(READ_BUFFER)
        .write_buffer_size(WRITE_BUFFER)
        .max_write_buffer_size(LARGEST_BACKLOG)
        .on_upgrade(async move |socket| {
            socket::serve(socket, session, caller, protocol, &app).await;
            drop(tracked);
        });
    Ok(response)
}

/// Begins a stream only to tell a browser why there is none.
fn refuse(app: App, upgrade: WebSocketUpgrade, problem: Problem) -> Result<Response, Problem> {
    let cause = match StatusCode::from_u16(problem.status) {
        Ok(StatusCode::UNAUTHORIZED) => Cause::BadToken,
        Ok(StatusCode::NOT_FOUND) => Cause::UnknownSession,
        _ => return Err(problem),
    };
    let (upgrade, _) = negotiate(upgrade)?;
    let tracked = app.streams.token();
    let response = upgrade
        .max_message_size(LARGEST_MESSAGE)
        .read_buffer_size(READ_BUFFER)
        .on_upgrade(async move |socket| {
            socket::end(socket, cause, &app).await;
            drop(tracked);
        });
    Ok(response)
}

/// Chooses the sub-protocol: the default one where the client offers none.
fn negotiate(upgrade: WebSocketUpgrade) -> Result<(WebSocketUpgrade, Protocol), Problem> {
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
    Ok((upgrade, chosen.unwrap_or(Protocol::Json)))
}
