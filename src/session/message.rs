//! Requests to the world's thread, each with a channel for its answer.

use std::sync::Arc;
use std::time::Instant;

use tokio::sync::{mpsc, oneshot};

use crate::snow::ColumnRect;

use super::change::{Change, StepSpec};
use super::error::SessionError;
use super::gather::{Gathered, Sampled};
use super::handle::Session;
use super::once::{Done, Once};
use super::orders::Answer;
use super::simulation::Simulation;
use super::snapshot::Snapshot;
use super::token::TokenHashes;
use super::view::{Applied, MassView};
use super::world::Fault;

/// What the world can be asked.
pub(super) enum Message {
    Create {
        session: Arc<Session>,
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
    /// Somebody asks for the session.
    Wake {
        key: u64,
    },
    Inspect {
        key: u64,
        look: Look,
        reply: Answer<()>,
    },
    /// Something is to be heard from the journal.
    Nudge,
    Break(Fault),
    /// Nothing that takes longer than this is begun.
    Stop(Instant),
}

/// Something to be run with a simulation.
pub(super) type Look = Box<dyn FnOnce(&Simulation) + Send>;

/// Sends a request to the world and waits for its answer.
pub(super) async fn ask<T>(
    world: &mpsc::Sender<Message>,
    message: impl FnOnce(Answer<T>) -> Message,
) -> Result<T, SessionError> {
    let (send, receive) = oneshot::channel();
    world.send(message(send)).await.map_err(|_| stopped())?;
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
