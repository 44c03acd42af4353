//! What the core is told, and what it wants done: the driver carries that out and tells what came of it.

use std::time::{Duration, Instant};

use firn_engine::frame::{EngineError, Frame, Outcome, Slot};
use firn_engine::made::Made;

use crate::session::answer::Answer;
use crate::session::error::SessionError;
use crate::session::inbox::Request;
use crate::session::journal::{Append, Heartbeat, Job, Part, Verdict};
use crate::session::token::TokenHashes;

use super::Fault;
use super::making::Creation;
use super::reading::{Read, Wanted};

/// When a step happens.
#[derive(Clone, Copy, Debug)]
pub struct Now {
    /// By a clock that never goes back.
    pub instant: Instant,
    /// By the store's clock.
    pub stored: Duration,
}

/// What the core is told.
pub(in crate::session) enum Input {
    /// A session is created.
    Create { creation: Creation, made: Made },
    /// Waits in the session's inbox.
    Request { key: u64, request: Request },
    /// Does not wait for what is in the session's inbox.
    Control { key: u64, control: Control },
    /// A beat is due: there are up to 60 of them in a second, and those that were missed slip.
    Beat,
    /// The backend has taken a snowpack in, which takes so many units, or has not.
    Made { slot: Slot, result: Result<u64, EngineError> },
    /// The frame in flight has ended.
    Done(Outcome),
    /// Frames can't be carried out any more, for a reason that is told to those who wait.
    Lost(&'static str),
    /// The device has been opened anew, or has not.
    Opened(bool),
    /// What is stored of sessions that come back has been read.
    Read(Vec<Read>),
    /// What the journal says.
    Journal(Verdict),
    /// Nobody is left who would commit anything.
    JournalDied,
    /// Everything is to end; nothing that takes longer than this is begun.
    Stop(Instant),
    /// Something is to be heard from the journal: the driver looks.
    Nudge,
    /// A test breaks something: the driver does.
    Break(Fault),
}

/// What is done of a session at once, wherever its snow is.
pub(in crate::session) enum Control {
    Delete(Answer<()>),
    Tokens(TokenHashes, Answer<()>),
    Unlock(Answer<()>),
    /// Somebody asks for the session.
    Wake,
    /// Nobody waits for the step any more that has this number.
    EndStep(u64),
}

impl Control {
    /// Tells who sent it why there is no answer.
    pub fn refuse(self, why: &SessionError) {
        match self {
            Control::Delete(reply) | Control::Tokens(_, reply) | Control::Unlock(reply) => {
                reply.refuse(why);
            }
            Control::Wake | Control::EndStep(_) => {}
        }
    }
}

/// What the core wants done, in this order.
pub(in crate::session) enum Effect {
    /// The backend takes a snowpack in.
    Make { slot: Slot, made: Made },
    /// The backend forgets a snowpack.
    Free(Slot),
    /// The backend carries a frame out. Nothing but its end may be told before that.
    Submit(Frame),
    /// The device is opened anew.
    OpenDevice,
    /// What is stored of sessions is read on other threads.
    Read(Vec<Wanted>),
    /// Something is made durable.
    Append(Append),
    /// So is how far the world has come, after all that was appended before.
    Heartbeat(Heartbeat),
    /// Sessions are written anew.
    Rewrite { sessions: Vec<(u64, Vec<Part>)>, heartbeat: Heartbeat, heard: u64 },
    /// A checkpoint is made of a snapshot, on another thread.
    Pack(Job),
    /// All sessions are back that outlived the last stop: beats begin now.
    Recovered,
    /// Nothing helps any more but another process.
    GiveUp,
    /// Everything has come to its end.
    Stopped,
}

impl Effect {
    /// Whether it needs the device that is open now.
    pub fn needs_device(&self) -> bool {
        matches!(self, Effect::Make { .. } | Effect::Free(_) | Effect::Submit(_))
    }
}
