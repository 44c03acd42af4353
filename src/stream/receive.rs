//! The half of a stream that listens: reads requests, has changes applied in their order, and
//! passes answers on in the same order.

use std::collections::VecDeque;
use std::future::{Future, poll_fn};
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::Poll;
use std::time::Duration;

use axum::extract::ws::Message;
use firn_protocol::stream::Cause;
use futures_util::stream::{FuturesOrdered, Stream, StreamExt};
use governor::DefaultDirectRateLimiter;
use tokio::sync::mpsc;
use tokio::task::unconstrained;
use tokio::time::{Instant, sleep_until};

use crate::http::{Leave, Unfinished};
use crate::problem::Problem;
use crate::session::{Applied, Change, SessionError};

use super::answer;
use super::cause::cause_of;
use super::request::{Control, Read, Request};

/// Requests of one client that may be under way. Beyond them nothing more is read from it.
pub const PIPELINE: usize = 1024;

/// Time after which a client that has not even answered pings is given up.
pub const SILENCE: Duration = Duration::from_secs(60);

/// What the sending half does next.
#[derive(Debug)]
pub enum Next {
    /// Sends a text.
    Text(String),
    /// Sends what was read, whose memory is counted until then.
    Read(String, Leave),
    /// Carries out a request about the stream itself.
    Control(Control),
}

/// What is taken from a client.
#[derive(Debug)]
pub struct Bounds<'a> {
    /// Commands that it may still send.
    pub rate: DefaultDirectRateLimiter,
    /// Whether a message to it is being written.
    pub writing: &'a AtomicBool,
    /// What is read of a message that has not ended.
    pub unfinished: Option<&'a Unfinished>,
}

/// Answers that wait to be sent, beyond which nothing more is read from a client \[bytes\].
const WAITING: usize = 64 * 1024;

impl Next {
    /// Memory that it takes while it waits.
    fn bytes(&self) -> usize {
        match self {
            Next::Text(text) | Next::Read(text, _) => text.len(),
            Next::Control(_) => size_of::<Next>(),
        }
    }
}

/// An answer that may still be made.
enum Pending<'a> {
    /// It is there, and its memory is counted.
    Made(Next),
    Later(Pin<Box<dyn Future<Output = Next> + Send + 'a>>),
}

/// Reads a client's messages until the stream ends.
///
/// `apply` carries out changes; those of one client are begun in the order of their messages. `read` reads
/// the snow for a request of a number.
pub async fn receive<S, A, F, R, G>(
    mut messages: S,
    answers: mpsc::Sender<Next>,
    (apply, read): (A, R),
    bounds: Bounds<'_>,
) -> Cause
where
    S: Stream<Item = Result<Message, axum::Error>> + Unpin,
    A: Fn(Change) -> F,
    F: Future<Output = Result<Applied, SessionError>> + Send,
    R: Fn(i64, Read) -> G,
    G: Future<Output = Next> + Send,
{
    let mut pending = FuturesOrdered::new();
    let mut ready: VecDeque<Next> = VecDeque::new();
    // Memory of the answers in both that are made.
    let mut waiting = 0;
    let mut heard = Instant::now();
    let end_message = || bounds.unfinished.into_iter().for_each(Unfinished::end);
    end_message();
    loop {
        let reading = pending.len() + ready.len() < PIPELINE && waiting < WAITING;
        if !reading {
            // A client that is not listened to can't be called silent.
            heard = Instant::now();
        }
        tokio::select! {
            message = messages.next(), if reading => {
                heard = Instant::now();
                end_message();
                if let Some(Ok(Message::Text(_) | Message::Binary(_) | Message::Ping(_))) = message
                    && bounds.rate.check().is_err()
                {
                    return Cause::TooManyCommands;
                }
                let begun = match message {
                    None => return Cause::Broken,
                    Some(Err(error)) => return cause_of(error),
                    Some(Ok(Message::Close(_))) => return Cause::Done,
                    Some(Ok(Message::Ping(_) | Message::Pong(_))) => continue,
                    Some(Ok(Message::Text(text))) => {
                        begin(Request::parse(&text), &apply, &read).await
                    }
                    Some(Ok(Message::Binary(_))) => refuse_binary(),
                };
                if let Pending::Made(next) = &begun {
                    waiting += next.bytes();
                }
                pending.push_back(finish(begun));
            }
            Some((next, late)) = pending.next() => {
                waiting += if late { next.bytes() } else { 0 };
                ready.push_back(next);
            }
            permit = answers.reserve(), if !ready.is_empty() => {
                let Ok(permit) = permit else { return Cause::Broken };
                let next = ready.pop_front().expect("checked before waiting");
                waiting -= next.bytes();
                permit.send(next);
            }
            () = sleep_until(heard + SILENCE), if reading => {
                // Who can't take a message in can't answer pings: the writing half decides.
                if !bounds.writing.load(Ordering::Relaxed) {
                    return Cause::Silent;
                }
                heard = Instant::now();
            }
        }
    }
}

/// The answer, and whether it is made only then.
async fn finish(pending: Pending<'_>) -> (Next, bool) {
    match pending {
        Pending::Made(next) => (next, false),
        Pending::Later(next) => (next.await, true),
    }
}

/// Begins what a message asks for.
async fn begin<'a, A, F, R, G>(
    request: Result<Request, super::request::Refusal>,
    apply: &A,
    read: &R,
) -> Pending<'a>
where
    A: Fn(Change) -> F,
    F: Future<Output = Result<Applied, SessionError>> + Send + 'a,
    R: Fn(i64, Read) -> G,
    G: Future<Output = Next> + Send + 'a,
{
    match request {
        Ok(Request::Control(control)) => Pending::Made(Next::Control(control)),
        Ok(Request::Read { id, read: wanted }) => Pending::Later(Box::pin(read(id, wanted))),
        Ok(Request::Change { id, change, at }) => {
            let applied = apply(change);
            // Polled once here, it is in the session's queue before the next message is read. The
            // runtime's budget must not put that off.
            let mut next = Box::pin(unconstrained(async move {
                Next::Text(answer::outcome(id, at, applied.await))
            }));
            match poll_fn(|context| Poll::Ready(next.as_mut().poll(context))).await {
                Poll::Ready(next) => Pending::Made(next),
                Poll::Pending => Pending::Later(next),
            }
        }
        Err(refusal) => Pending::Made(Next::Text(answer::refusal(refusal.id, *refusal.problem))),
    }
}

fn refuse_binary<'a>() -> Pending<'a> {
    let problem = Problem::malformed("requests are JSON text, not binary messages");
    Pending::Made(Next::Text(answer::refusal(None, problem)))
}

#[cfg(test)]
mod tests;
