//! The half of a stream that listens: reads requests, has changes applied in their order, and
//! passes answers on in the same order.

use std::collections::VecDeque;
use std::future::{Future, poll_fn};
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::Poll;
use std::time::Duration;

use axum::extract::ws::Message;
use futures_util::stream::{FuturesOrdered, Stream, StreamExt};
use governor::DefaultDirectRateLimiter;
use tokio::sync::mpsc;
use tokio::task::unconstrained;
use tokio::time::{Instant, sleep_until};

use crate::problem::Problem;
use crate::session::{Applied, Change, SessionError};

use super::answer;
use super::cause::Cause;
use super::request::{Control, Request};

/// Requests of one client that may be under way. Beyond them nothing more is read from it.
pub const PIPELINE: usize = 1024;

/// Time after which a client that has not even answered pings is given up.
pub const SILENCE: Duration = Duration::from_secs(60);

/// What the sending half does next.
#[derive(Debug)]
pub enum Next {
    /// Sends a text.
    Text(String),
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
}

type Pending<'a> = Pin<Box<dyn Future<Output = Next> + Send + 'a>>;

/// Reads a client's messages until the stream ends.
///
/// `apply` carries out changes; those of one client are begun in the order of their messages.
pub async fn receive<S, A, F>(
    mut messages: S,
    answers: mpsc::Sender<Next>,
    apply: A,
    bounds: Bounds<'_>,
) -> Cause
where
    S: Stream<Item = Result<Message, axum::Error>> + Unpin,
    A: Fn(Change) -> F,
    F: Future<Output = Result<Applied, SessionError>> + Send,
{
    let mut pending: FuturesOrdered<Pending> = FuturesOrdered::new();
    let mut ready = VecDeque::new();
    let mut heard = Instant::now();
    loop {
        let reading = pending.len() + ready.len() < PIPELINE;
        if !reading {
            // Whoever is not listened to can't be called silent.
            heard = Instant::now();
        }
        tokio::select! {
            message = messages.next(), if reading => {
                heard = Instant::now();
                if let Some(Ok(Message::Text(_) | Message::Binary(_) | Message::Ping(_))) = message
                    && bounds.rate.check().is_err()
                {
                    return Cause::TooManyCommands;
                }
                let begun = match message {
                    None => return Cause::Broken,
                    Some(Err(error)) => return error.into(),
                    Some(Ok(Message::Close(_))) => return Cause::Done,
                    Some(Ok(Message::Ping(_) | Message::Pong(_))) => continue,
                    Some(Ok(Message::Text(text))) => begin(Request::parse(&text), &apply).await,
                    Some(Ok(Message::Binary(_))) => refuse_binary(),
                };
                pending.push_back(begun);
            }
            Some(next) = pending.next() => ready.push_back(next),
            permit = answers.reserve(), if !ready.is_empty() => {
                let Ok(permit) = permit else { return Cause::Broken };
                permit.send(ready.pop_front().expect("checked before waiting"));
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

/// Begins what a message asks for.
async fn begin<'a, A, F>(
    request: Result<Request, super::request::Refusal>,
    apply: &A,
) -> Pending<'a>
where
    A: Fn(Change) -> F,
    F: Future<Output = Result<Applied, SessionError>> + Send + 'a,
{
    match request {
        Ok(Request::Control(control)) => at_once(Next::Control(control)),
        Ok(Request::Change { id, change, at }) => {
            let applied = apply(change);
            // Polled once here, it is in the session's queue before the next message is read. The
            // runtime's budget must not put that off.
            let mut pending: Pending = Box::pin(unconstrained(async move {
                Next::Text(answer::outcome(id, at, applied.await))
            }));
            match poll_fn(|context| Poll::Ready(pending.as_mut().poll(context))).await {
                Poll::Ready(next) => at_once(next),
                Poll::Pending => pending,
            }
        }
        Err(refusal) => at_once(Next::Text(answer::refusal(refusal.id, *refusal.problem))),
    }
}

fn refuse_binary<'a>() -> Pending<'a> {
    let problem = Problem::malformed("requests are JSON text, not binary messages");
    at_once(Next::Text(answer::refusal(None, problem)))
}

fn at_once<'a>(next: Next) -> Pending<'a> {
    Box::pin(std::future::ready(next))
}

#[cfg(test)]
mod tests;
