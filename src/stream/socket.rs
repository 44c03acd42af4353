//! One client's connection: both halves run in one task until one of them ends, or the server
//! stops, or the session is deleted.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use axum::extract::ws::{Message, WebSocket};
use futures_util::sink::SinkExt;
use futures_util::stream::StreamExt;
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep, timeout};
use tracing::debug;

use crate::http::App;
use crate::session::Session;

use super::cause::Cause;
use super::rate::CommandRate;
use super::receive::{Bounds, receive};
use super::send::{Manner, send};
use super::tiles::Protocol;

/// Answers that wait for being written; those beyond them wait in the receiving half.
const ANSWERS: usize = 16;

/// Serves a client until the stream ends.
pub async fn serve(socket: WebSocket, session: Arc<Session>, protocol: Protocol, app: &App) {
    let limits = &app.stream;
    let (mut sink, mut messages) = socket.split();
    let (answers, next) = mpsc::channel(ANSWERS);
    let changes = &session;
    let apply = |change| async move { changes.change(change).await };
    let writing = AtomicBool::new(false);
    let rate = CommandRate::new(limits.stream_commands_per_second, Instant::now());
    let bounds = Bounds { rate, writing: &writing };
    let patience = limits.stream_write_timeout;
    let carried = app.metrics.streams.begin(protocol);
    let manner = Manner { protocol, patience, writing: &writing, carried };
    let cause = tokio::select! {
        cause = receive(&mut messages, answers, apply, bounds) => cause,
        cause = send(&mut sink, &session, next, manner) => cause,
        () = app.draining.cancelled() => Cause::Draining,
        () = session.gone().cancelled() => Cause::Deleted,
    };
    debug!(session = session.id, cause = cause.label(), "stream ended");
    app.metrics.streams.end(cause);
    let Some(frame) = cause.close_frame() else { return };
    let farewell = async {
        // Fails where the client has closed first, or is gone: then there is nothing to say.
        let _ = sink.send(Message::Close(Some(frame))).await;
        if cause.is_readable() {
            while let Some(Ok(_)) = messages.next().await {}
        } else {
            // Dropping the connection with input unread would reset it before the client has read
            // why it is closed.
            sleep(limits.stream_farewell).await;
        }
    };
    // Whoever takes longer is cut off.
    let _ = timeout(limits.stream_farewell, farewell).await;
}
