//! One client's connection: both halves run in one task until one of them ends, or the server
//! stops, or the session is deleted.

use std::sync::atomic::AtomicBool;

use axum::extract::ws::{Message, WebSocket};
use futures_util::stream::StreamExt;
use governor::{Quota, RateLimiter};
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};
use tracing::debug;

use crate::http::{App, Caller};
use crate::session::{Session, SessionError, Visit};

use super::cause::Cause;
use super::receive::{Bounds, receive};
use super::send::{Manner, send};
use super::tiles::Protocol;

/// Answers that wait for being written; those beyond them wait in the receiving half.
const ANSWERS: usize = 16;

/// Serves a client until the stream ends.
pub async fn serve(
    mut socket: WebSocket,
    session: Visit,
    caller: Caller,
    protocol: Protocol,
    app: &App,
) {
    let cause = converse(&mut socket, &session, caller, protocol, app).await;
    debug!(session = session.id, cause = cause.label(), "stream ended");
    end(socket, cause, app).await;
}

/// Carries on both halves of a conversation until one of them ends, or the client has to go.
async fn converse(
    socket: &mut WebSocket,
    session: &Session,
    caller: Caller,
    protocol: Protocol,
    app: &App,
) -> Cause {
    let limits = &app.stream;
    let (mut sink, mut messages) = socket.split();
    let (answers, next) = mpsc::channel(ANSWERS);
    let apply = |change| async move {
        if !caller.may_change() {
            let why = "a viewer's token only allows reading and streaming";
            return Err(SessionError::Forbidden(why.to_owned()));
        }
        session.change(change).await
    };
    let writing = AtomicBool::new(false);
    let rate = RateLimiter::direct(Quota::per_second(limits.stream_commands_per_second));
    let bounds = Bounds { rate, writing: &writing };
    let patience = limits.stream_write_timeout;
    let carried = app.metrics.streams.begin(protocol);
    let manner = Manner { protocol, patience, writing: &writing, carried };
    tokio::select! {
        cause = receive(&mut messages, answers, apply, bounds) => cause,
        cause = send(&mut sink, session, next, manner) => cause,
        () = app.draining.cancelled() => Cause::Draining,
        () = session.gone().cancelled() => Cause::Deleted,
        () = disowned(session, caller) => Cause::BadToken,
    }
}

/// Waits until the session has other tokens than the caller's.
async fn disowned(session: &Session, caller: Caller) {
    let mut tokens = session.token_changes();
    // The session outlives this, and with it whoever could change its tokens.
    let _ = tokens.wait_for(|tokens| !caller.is_known_to(tokens)).await;
}

/// Counts the end of a stream, and tells its client why.
pub async fn end(mut socket: WebSocket, cause: Cause, app: &App) {
    app.metrics.streams.end(cause);
    let Some(frame) = cause.close_frame() else { return };
    let limits = &app.stream;
    let farewell = async {
        // Fails where the client has closed first, or is gone: then there is nothing to say.
        let _ = socket.send(Message::Close(Some(frame))).await;
        if cause.is_readable() {
            while let Some(Ok(_)) = socket.next().await {}
        } else {
            // Dropping the connection with input unread would reset it before the client has read
            // why it is closed.
            sleep(limits.stream_farewell).await;
        }
    };
    // Whoever takes longer is cut off.
    let _ = timeout(limits.stream_farewell, farewell).await;
}
