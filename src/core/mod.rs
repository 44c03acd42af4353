//! What happens to all sessions, step by step. The core has no thread, clock, channel, disk or chance of its own:
//! it is told what has happened, and says what it wants done. The driver carries that out, and
//! reports the results.

mod anchors;
pub(crate) mod back;
mod backoff;
pub(crate) mod begin;
pub(crate) mod device;
mod frame;
mod inputs;
mod making;
mod object_rows;
pub(crate) mod reading;
pub(crate) mod record;
pub(crate) mod restore_points;
mod rewriting;
pub(crate) mod session;
mod simulations;
mod slots;
pub(crate) mod snapshot;
mod stop;
pub(crate) mod storage;
pub(crate) mod tenant;
mod timers;
mod upkeep;
pub(crate) mod vitals;
pub(crate) mod world;

use std::sync::Arc;
use std::time::{Duration, Instant};

use firn_engine::frame::{EngineError, Frame, Outcome, Slot};
use firn_engine::made::Made;

use crate::store::StoreError;

use reading::{Read, Wanted};
use record::{Append, Checkpoint, Hash, Heartbeat, Part, Taken};
use restore_points::PointChange;
use session::{Answer, Limits, Outlet, Receipted, Request, SessionError, TokenHashes};

pub(crate) use making::Creation;
pub(crate) use world::World;

/// How the core works.
#[derive(Clone, Copy, Debug)]
pub struct WorldConfig {
    /// Limits of what the server holds.
    pub limits: Limits,
    /// Publications per second \[Hz\], beside those that requests ask for; at most 60.
    pub publish_rate: f64,
    /// Whether snow at rest is left alone. It makes no difference to any result.
    pub sleep: bool,
}

/// Where sessions are found by their names.
pub(crate) trait Directory: Send + Sync {
    /// A session that outlived the last stop is back.
    fn recover(&self, session: &Outlet);

    /// A session is no more.
    fn forget(&self, session: &Outlet);
}

/// When a step happens.
#[derive(Clone, Copy, Debug)]
pub struct Now {
    /// By a clock that never goes back.
    pub instant: Instant,
    /// By the store's clock.
    pub stored: Duration,
}

/// What the core is told.
pub(crate) enum Input {
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

/// What is begun of a session at once, wherever its snow is and whatever waits in its inbox.
pub(crate) enum Control {
    Delete(Answer<()>),
    Tokens(TokenHashes, Answer<()>),
    Unlock(Answer<()>),
    /// A restore point is kept or deleted.
    Points(PointChange, Answer<()>),
    /// Somebody asks for the session.
    Wake,
    /// A step ends at the tick it has reached: the one of a number, for which nobody waits any more, or the one
    /// under way.
    EndStep(Option<u64>, Answer<Receipted<()>>),
}

impl Control {
    /// Tells who sent it why there is no answer.
    pub fn refuse(self, why: &SessionError) {
        match self {
            Control::Delete(reply)
            | Control::Tokens(_, reply)
            | Control::Unlock(reply)
            | Control::Points(_, reply) => reply.refuse(why),
            Control::EndStep(_, reply) => reply.refuse(why),
            Control::Wake => {}
        }
    }
}

/// What the core wants done, in this order.
pub(crate) enum Effect {
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
    /// What was done for requests of these keys is forgotten: their session is deleted.
    Forget(Vec<Hash>),
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

/// What the journal says.
pub(crate) enum Verdict {
    /// These appends, each a session and a position, are durable.
    Durable(Vec<(u64, u64)>),
    /// None of these is, nor anything that follows, until sessions are written anew.
    Failed(Vec<(u64, u64)>, StoreError),
    /// Whether sessions could be written anew.
    Rewritten(Result<(), StoreError>),
    /// A checkpoint of a session in one of its lives, where it could be made.
    Packed { key: u64, life: u64, checkpoint: Option<Arc<Checkpoint>> },
}

/// A snapshot of a session in one of its lives, to be made a checkpoint that holds all entries below `base`.
pub(crate) struct Job {
    pub key: u64,
    pub life: u64,
    pub base: u64,
    pub taken: Box<Taken>,
}

/// Something that breaks, for tests of what happens then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The device is lost, as when its driver crashes.
    LoseDevice,
    /// The world's thread panics.
    Panic,
}
