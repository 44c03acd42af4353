//! The height stream: a WebSocket per client that carries the newest heights to it and its changes
//! to the session. `api/asyncapi.yaml` describes the messages.

mod answer;
mod cache;
mod cause;
mod ground;
mod interest;
mod memory;
mod pace;
mod parts;
mod quantum;
mod receive;
mod region;
mod request;
mod send;
mod socket;
mod subscription;
mod tiles;
mod waiting;
mod watch;

use std::sync::Arc;

use axum::Extension;
use axum::extract::State;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{WebSocket, WebSocketUpgrade};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::Response;
use firn_protocol::stream::{Cause, SubProtocol};
use utoipa::IntoParams;

use crate::config::Scope;
use crate::http::{
    Admitted, App, Caller, FromQuery, Params, Peer, Query, Segments, Unfinished, Visitor, admit,
    bearer,
};
use crate::problem::Problem;
use crate::session::Visit;

use parts::LARGEST_PART;

pub use cache::EncodedTiles;
pub use request::{Control, Read, Refusal, Request};
pub use subscription::{Copied, Source, Subscription};

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
    /// An API key or one of the session's tokens, where there is no `Authorization` header.
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
    Peer(address): Peer,
    headers: HeaderMap,
    unfinished: Option<Extension<Arc<Unfinished>>>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Problem> {
    let unfinished = unfinished.map(|Extension(unfinished)| unfinished);
    let token = bearer(&headers).or(query.token.as_deref());
    let visitor = Visitor { address, token, session: Some(&id), scope: Scope::Read };
    let is_browser = headers.contains_key(header::ORIGIN);
    match (admit(&app, &visitor), upgrade) {
        (Ok(admitted), Ok(upgrade)) => begin(app, upgrade, admitted, unfinished),
        (Err(problem), Ok(upgrade)) if is_browser => refuse(app, upgrade, problem, unfinished),
        (Err(problem), _) => Err(problem),
        (Ok(_), Err(rejection)) => Err(Problem::malformed(format!(
            "a stream begins with a WebSocket upgrade: {rejection}"
        ))),
    }
}

/// Who streams.
struct Client {
    /// What.
    session: Visit,
    caller: Caller,
    /// Counts what is read of a message that has not ended, where it came over a connection.
    unfinished: Option<Arc<Unfinished>>,
}

/// Begins a stream.
fn begin(
    app: App,
    upgrade: WebSocketUpgrade,
    admitted: Admitted,
    unfinished: Option<Arc<Unfinished>>,
) -> Result<Response, Problem> {
    let Admitted { caller, session } = admitted;
    let session = session.ok_or_else(|| Problem::internal("the session was not looked up"))?;
    if app.draining.is_cancelled() {
        return Err(Problem::unavailable("the server is stopping"));
    }
    let client = Client { session: app.sessions.visit(session), caller, unfinished };
    accept(app, upgrade, move |app, socket, protocol| async move {
        socket::serve(socket, client, protocol, &app).await;
    })
}

/// Lets a client change to a WebSocket. What it may send and leave unread has bounds, whether there is a
/// stream for it or only a farewell.
fn accept<F: Future<Output = ()> + Send + 'static>(
    app: App,
    upgrade: WebSocketUpgrade,
    serve: impl FnOnce(App, WebSocket, SubProtocol) -> F + Send + 'static,
) -> Result<Response, Problem> {
    let (upgrade, protocol) = negotiate(upgrade)?;
    let tracked = app.streams.token();
    let upgrade = upgrade
        .max_message_size(LARGEST_MESSAGE)
        .max_frame_size(LARGEST_FRAME)
        .read_buffer_size(READ_BUFFER)
        .write_buffer_size(WRITE_BUFFER)
        .max_write_buffer_size(LARGEST_BACKLOG);
    Ok(upgrade.on_upgrade(async move |socket| {
        serve(app, socket, protocol).await;
        drop(tracked);
    }))
}

/// Begins a stream only to tell a browser why there is none.
fn refuse(
    app: App,
    upgrade: WebSocketUpgrade,
    problem: Problem,
    unfinished: Option<Arc<Unfinished>>,
) -> Result<Response, Problem> {
    let cause = match StatusCode::from_u16(problem.status) {
        Ok(StatusCode::UNAUTHORIZED) => Cause::BadToken,
        Ok(StatusCode::NOT_FOUND) => Cause::UnknownSession,
        _ => return Err(problem),
    };
    accept(app, upgrade, move |app, socket, _| async move {
        // What it sends before it has heard the farewell is counted as that of any other.
        unfinished.iter().for_each(|unfinished| unfinished.end());
        socket::end(socket, cause, unfinished.as_deref(), &app).await;
    })
}

/// Chooses the sub-protocol: the default one where the client offers none.
fn negotiate(upgrade: WebSocketUpgrade) -> Result<(WebSocketUpgrade, SubProtocol), Problem> {
    let offers_any = upgrade.requested_protocols().next().is_some();
    let names = SubProtocol::ALL.map(SubProtocol::name);
    let upgrade = upgrade.protocols(names);
    let chosen = upgrade.selected_protocol().and_then(|chosen| chosen.to_str().ok());
    let chosen = SubProtocol::ALL.into_iter().find(|protocol| chosen == Some(protocol.name()));
    if offers_any && chosen.is_none() {
        let known = names.join(", ");
        return Err(Problem::malformed(format!(
            "none of the sub-protocols offered is known; known are: {known}"
        )));
    }
    Ok((upgrade, chosen.unwrap_or(SubProtocol::Json)))
}
