//! One client's connection: both halves run in one task until one of them ends, or the server
//! stops, or the session is deleted.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{Message, WebSocket};
use futures_util::sink::SinkExt;
use futures_util::stream::StreamExt;
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};
use tokio_util::sync::CancellationToken;
use tracing::debug;

use crate::session::Session;

use super::cause::Cause;
use super::receive::receive;
use super::send::send;

/// Answers that wait for being written; those beyond them wait in the receiving half.
const ANSWERS: usize = 16;

/// Time that a client has to hear that the stream is closed.
const FAREWELL: Duration = Duration::from_secs(2);

/// Serves a client until the stream ends.
pub async fn serve(socket: WebSocket, session: Arc<Session>, draining: CancellationToken) {
    let (mut sink, mut messages) = socket.split();
    let (answers, next) = mpsc::channel(ANSWERS);
    let changes = &session;
    let apply = |change| async move { changes.change(change).await };
    let cause = tokio::select! {
        cause = receive(&mut messages, answers, apply) => cause,
        cause = send(&mut sink, &session, next) => cause,
        () = draining.cancelled() => Cause::Draining,
        () = session.gone().cancelled() => Cause::Deleted,
    };
    debug!(session = session.id, cause = cause.label(), "stream ended");
    let Some(frame) = cause.close_frame() else { return };
    let farewell = async {
        // Fails where the client has closed first, or is gone: then there is nothing to say.
        let _ = sink.send(Message::Close(Some(frame))).await;
        if cause.is_readable() {
            while let Some(Ok(_)) = messages.next().await {}
        } else {
            // Dropping the connection with input unread would reset it before the client has read
            // why it is closed.
            sleep(FAREWELL).await;
        }
    };
    // Whoever takes longer is cut off.
    let _ = timeout(FAREWELL, farewell).await;
}
