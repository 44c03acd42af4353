//! One client's connection: both halves run in one task until one of them ends, or the server
//! stops, or the session is deleted.

use std::sync::atomic::AtomicBool;

use axum::extract::ws::{Message, WebSocket};
use firn_protocol::stream::{Cause, SubProtocol};
use futures_util::stream::StreamExt;
use governor::{Quota, RateLimiter};
use serde::Serialize;
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};
use tracing::debug;

use crate::config::Scope;
use crate::http::{App, Caller, Unfinished};
use crate::problem::Problem;
use crate::session::{Reading, Session, SessionError};

use super::Client;
use super::answer;
use super::cause;
use super::parts::LARGEST_PART;
use super::receive::{Bounds, Next, receive};
use super::request::Read;
use super::send::{Manner, send};

/// Answers that wait for being written; those beyond them wait in the receiving half.
const ANSWERS: usize = 16;

/// Serves a client until the stream ends.
pub(super) async fn serve(mut socket: WebSocket, client: Client, protocol: SubProtocol, app: &App) {
    let cause = converse(&mut socket, &client, protocol, app).await;
    debug!(session = client.session.id, cause = cause.label(), "stream ended");
    end(socket, cause, client.unfinished.as_deref(), app).await;
}

/// Carries on both halves of a conversation until one of them ends, or the client has to go.
async fn converse(
    socket: &mut WebSocket,
    client: &Client,
    protocol: SubProtocol,
    app: &App,
) -> Cause {
    let (session, caller, limits) = (&client.session, &client.caller, &app.stream);
    let (mut sink, mut messages) = socket.split();
    let (answers, next) = mpsc::channel(ANSWERS);
    let apply = |change| async move {
        if !caller.may(Scope::Write) {
            let why = "this token only allows reading and streaming";
            return Err(SessionError::Forbidden(why.to_owned()));
        }
        session.change(change).await
    };
    let read = |id, read| async move {
        match read {
            Read::Probes(batch) => tell(id, session.probe(batch), app).await,
            Read::Samples(batch) => tell(id, session.sample(batch), app).await,
        }
    };
    let writing = AtomicBool::new(false);
    let rate = RateLimiter::direct(Quota::per_second(limits.stream_commands_per_second));
    let unfinished = client.unfinished.as_deref();
    let bounds = Bounds { rate, writing: &writing, unfinished };
    let patience = limits.stream_write_timeout;
    let carried = app.metrics.streams.begin(protocol);
    let unsent = &app.answers.unsent;
    let manner = Manner { protocol, patience, writing: &writing, carried, unsent };
    tokio::select! {
        cause = receive(&mut messages, answers, (apply, read), bounds) => cause,
        cause = send(&mut sink, session, next, manner) => cause,
        () = app.draining.cancelled() => Cause::Draining,
        () = session.gone().cancelled() => Cause::Deleted,
        () = disowned(session, caller, app) => Cause::BadToken,
    }
}

/// The answer to a request of a number that reads the snow.
async fn tell<T: Serialize + Send + 'static>(
    id: i64,
    reading: Result<Reading<T>, SessionError>,
    app: &App,
) -> Next {
    let told = match reading {
        Ok(reading) if reading.answer_bytes() > LARGEST_PART => {
            let detail = format!(
                "the answer would take some {} bytes; messages have at most {LARGEST_PART}: ask for \
                 fewer points or fields at a time, or over REST",
                reading.answer_bytes()
            );
            Err(Problem::invalid_field("/points", detail))
        }
        Ok(reading) => app.answers.read(reading, move |reply| answer::found(id, &reply)).await,
        Err(error) => Err(error.into()),
    };
    match told {
        Ok((text, leave)) => Next::Read(text, leave),
        Err(problem) => Next::Text(answer::refusal(Some(id), problem)),
    }
}

/// Waits until the session has other tokens than the caller's, or its API key is good no more.
async fn disowned(session: &Session, caller: &Caller, app: &App) {
    let (mut tokens, mut keys) = (session.token_changes(), app.gate.access.key_changes());
    // Both senders outlive this: they belong to the session and the server.
    tokio::select! {
        _ = tokens.wait_for(|tokens| !caller.is_known_to(tokens)) => {}
        _ = keys.wait_for(|keys| !caller.is_among(keys)) => {}
    }
}

/// Counts the end of a stream, and tells its client why.
pub async fn end(mut socket: WebSocket, cause: Cause, unfinished: Option<&Unfinished>, app: &App) {
    app.metrics.streams.end(cause);
    if let Some(limit) = cause::limit(cause) {
        app.metrics.limits.reached(limit);
    }
    let Some(frame) = cause::close_frame(cause) else { return };
    let limits = &app.stream;
    let farewell = async {
        // Fails where the client has closed first, or is gone: then there is nothing to say.
        let _ = socket.send(Message::Close(Some(frame))).await;
        if cause::is_readable(cause) {
            while let Some(Ok(_)) = socket.next().await {
                unfinished.into_iter().for_each(Unfinished::end);
            }
        } else {
            // Dropping the connection with input unread would reset it before the client has read
            // why it is closed.
            sleep(limits.stream_farewell).await;
        }
    };
    // A client that takes longer is cut off.
    let _ = timeout(limits.stream_farewell, farewell).await;
}
