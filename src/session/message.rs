//! Requests to the world's thread, each with a channel for its answer.

use std::sync::Arc;
use std::time::Instant;

use firn_engine::made::Made;
use firn_protocol::{MassView, StepSpec};
use firn_snow::ColumnRect;
use tokio::sync::{OwnedSemaphorePermit, mpsc};

use super::answer::Answer;
use super::change::Applied;
use super::change::Change;
use super::error::SessionError;
use super::gather::{Gathered, Sampled};
use super::handle::Session;
use super::once::{Done, Once};
use super::simulation::Simulation;
use super::snapshot::Snapshot;
use super::token::TokenHashes;
use super::world::{Decoded, Fault};

/// What the world can be asked.
pub(super) enum Message {
    Create {
        session: Arc<Session>,
        made: Made,
        saved: Option<Box<Snapshot>>,
        done: Option<Arc<Done>>,
        reply: Answer<()>,
    },
    Delete {
        key: u64,
        reply: Answer<()>,
    },
    Change {
        key: u64,
        change: Change,
        once: Option<Once>,
        reply: Answer<Applied>,
    },
    Step {
        key: u64,
        step: StepSpec,
        reply: Answer<()>,
    },
    Reset {
        key: u64,
        saved: Option<Box<Snapshot>>,
        reply: Answer<()>,
    },
    Snapshot {
        key: u64,
        reply: Answer<Snapshot>,
    },
    Gather {
        key: u64,
        tiles: Vec<u32>,
        reply: Answer<Gathered>,
    },
    Sample {
        key: u64,
        columns: ColumnRect,
        y0: u32,
        height: u32,
        reply: Answer<Sampled>,
    },
    Mass {
        key: u64,
        reply: Answer<MassView>,
    },
    Tokens {
        key: u64,
        hashes: TokenHashes,
        reply: Answer<()>,
    },
    Unlock {
        session: Arc<Session>,
        reply: Answer<()>,
    },
    /// Somebody asks for the session.
    Wake {
        key: u64,
    },
    Inspect {
        key: u64,
        look: Look,
        reply: Answer<()>,
    },
    /// What is stored of a session that is being woken has been read, in the life that it is of.
    Woken {
        key: u64,
        generation: u64,
        decoded: Box<Result<Decoded, SessionError>>,
    },
    /// Something is to be heard from the journal.
    Nudge,
    Break(Fault),
    /// Nothing that takes longer than this is begun.
    Stop(Instant),
}

impl Message {
    /// The session that a request is for.
    pub fn key(&self) -> Option<u64> {
        match *self {
            Message::Delete { key, .. }
            | Message::Change { key, .. }
            | Message::Step { key, .. }
            | Message::Reset { key, .. }
            | Message::Snapshot { key, .. }
            | Message::Gather { key, .. }
            | Message::Sample { key, .. }
            | Message::Mass { key, .. }
            | Message::Tokens { key, .. }
            | Message::Wake { key }
            | Message::Inspect { key, .. } => Some(key),
            Message::Unlock { ref session, .. } => Some(session.key),
            Message::Create { .. }
            | Message::Woken { .. }
            | Message::Nudge
            | Message::Break(_)
            | Message::Stop(_) => None,
        }
    }

    /// Whether it needs its session awake.
    pub fn wakes(&self) -> bool {
        !matches!(self, Message::Delete { .. } | Message::Tokens { .. } | Message::Unlock { .. })
    }

    /// Tells whoever sent it why there is no answer.
    pub fn refuse(self, why: &SessionError) {
        match self {
            Message::Delete { reply, .. }
            | Message::Step { reply, .. }
            | Message::Reset { reply, .. }
            | Message::Tokens { reply, .. }
            | Message::Unlock { reply, .. }
            | Message::Inspect { reply, .. }
            | Message::Create { reply, .. } => reply.refuse(why),
            Message::Change { reply, .. } => reply.refuse(why),
            Message::Snapshot { reply, .. } => reply.refuse(why),
            Message::Gather { reply, .. } => reply.refuse(why),
            Message::Sample { reply, .. } => reply.refuse(why),
            Message::Mass { reply, .. } => reply.refuse(why),
            Message::Wake { .. }
            | Message::Woken { .. }
            | Message::Nudge
            | Message::Break(_)
            | Message::Stop(_) => {}
        }
    }
}

/// Something to be run with a simulation.
pub(super) type Look = Box<dyn FnOnce(&Simulation) + Send>;

/// Sends a request to the world and waits for its answer, in a place among those that wait for a session.
pub(super) async fn ask<T>(
    world: &mpsc::Sender<Message>,
    place: Option<OwnedSemaphorePermit>,
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
