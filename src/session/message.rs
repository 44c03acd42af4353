//! What reaches the world's thread.

use std::sync::Arc;
use std::time::Instant;

use firn_engine::made::Made;
use tokio::sync::mpsc;

use super::answer::{Answer, Place};
use super::error::SessionError;
use super::handle::Session;
use super::inbox::Request;
use super::keyed::Done;
use super::receipt::Receipted;
use super::snapshot::Snapshot;
use super::token::TokenHashes;
use super::world::{Fault, Read};

/// What the world is told.
pub(super) enum Message {
    Create {
        session: Arc<Session>,
        made: Made,
        saved: Option<Box<Snapshot>>,
        done: Option<Arc<Done>>,
        reply: Answer<Receipted<()>>,
    },
    /// Waits in the session's inbox.
    Request {
        key: u64,
        request: Request,
    },
    /// Does not wait for what is in the session's inbox.
    Control {
        key: u64,
        control: Control,
    },
    /// What is stored of sessions that come back has been read.
    Read(Vec<Read>),
    /// Something is to be heard from the journal.
    Nudge,
    Break(Fault),
    /// Nothing that takes longer than this is begun.
    Stop(Instant),
}

/// What is done of a session at once, wherever its snow is.
pub(super) enum Control {
    Delete(Answer<()>),
    Tokens(TokenHashes, Answer<()>),
    Unlock(Answer<()>),
    /// Somebody asks for the session.
    Wake,
}

impl Message {
    /// Tells whoever sent it why there is no answer.
    pub fn refuse(self, why: &SessionError) {
        match self {
            Message::Create { reply, .. } => reply.refuse(why),
            Message::Request { request, .. } => request.refuse(why),
            Message::Control { control, .. } => control.refuse(why),
            Message::Read(_) | Message::Nudge | Message::Break(_) | Message::Stop(_) => {}
        }
    }
}

impl Control {
    /// As [`Message::refuse`].
    pub fn refuse(self, why: &SessionError) {
        match self {
            Control::Delete(reply) | Control::Tokens(_, reply) | Control::Unlock(reply) => {
                reply.refuse(why);
            }
            Control::Wake => {}
        }
    }
}

/// Sends something to the world and waits for its answer, in a place among those that wait for a session.
pub(super) async fn ask<T>(
    world: &mpsc::Sender<Message>,
    place: Option<Place>,
    message: impl FnOnce(Answer<T>) -> Message,
) -> Result<T, SessionError> {
    let (answer, receive) = Answer::new(place);
    world.send(message(answer)).await.map_err(|_| stopped())?;
    receive.await.unwrap_or_else(|_| {
        if world.is_closed() {
            return Err(stopped());
        }
        Err(SessionError::Internal(
            "handling the request failed; the session goes back to what is stored: read it before \
             the request is sent again"
                .to_owned(),
        ))
    })
}

/// The error of a request that the world can't answer any more.
pub(super) fn stopped() -> SessionError {
    SessionError::Unavailable("the engine has stopped".to_owned())
}
