//! Snowpacks that the backend is about to take in: of sessions that are created, and of those that come back.

use std::sync::Arc;

use firn_engine::frame::{EngineError, Slot};
use firn_engine::made::Made;
use tracing::{error, warn};

use crate::core::back::Stage;
use crate::core::device::DEVICE_FAILED;
use crate::core::object_rows::ObjectRows;
use crate::core::record::Done;
use crate::core::session::{Answer, Outlet, Receipted, SessionError};
use crate::core::snapshot::Snapshot;
use crate::core::{Effect, World};

/// A session that is to be created.
pub(crate) struct Creation {
    pub session: Arc<Outlet>,
    pub saved: Option<Box<Snapshot>>,
    pub done: Option<Arc<Done>>,
    pub reply: Answer<Receipted<()>>,
}

/// For whom the backend takes a snowpack in.
pub(crate) struct Making {
    /// What it takes in the tables of objects.
    object_rows: ObjectRows,
    of: Of,
}

/// What is made of it.
pub(crate) enum Of {
    Creation(Creation),
    /// A session comes back, in one of its lives.
    Return {
        key: u64,
        life: u64,
        snapshot: Option<Box<Snapshot>>,
    },
}

/// What a session takes of the device.
pub(crate) struct Room {
    pub slot: Slot,
    pub object_rows: ObjectRows,
    /// Units that furnishing its memory costs.
    pub units: u64,
}

impl Making {
    /// Tells who waits for it why there is no answer.
    pub fn refuse(self, why: &SessionError) {
        if let Of::Creation(creation) = self.of {
            creation.reply.refuse(why);
        }
    }
}

impl World {
    /// Has the backend take a snowpack in, where it could be made and there is room for its objects.
    pub(crate) fn make(&mut self, made: Result<Made, EngineError>, of: Of) {
        let saved = match &of {
            Of::Creation(creation) => creation.saved.as_deref(),
            Of::Return { snapshot, .. } => snapshot.as_deref(),
        };
        let mut object_rows = ObjectRows::new(self.object_rows.clone());
        let room = object_rows.try_take(saved.map_or(0, Snapshot::object_rows));
        let room = room.map_err(|why| EngineError::OutOfMemory(why.to_string()));
        match made.and_then(|made| room.map(|()| made)) {
            Ok(made) => {
                let slot = self.slots.take();
                self.making.insert(slot, Making { object_rows, of });
                self.effects.push(Effect::Make { slot, made });
            }
            Err(failure) => self.not_made(of, failure),
        }
    }

    /// Goes on with a snowpack that the backend has taken in, or has not.
    pub(crate) fn made(&mut self, slot: Slot, result: Result<u64, EngineError>) {
        let Some(Making { object_rows, of }) = self.making.remove(&slot) else { return };
        self.busy = true;
        if let Of::Return { key, life, .. } = of
            && !self.comes_back(key, life, Stage::Making)
        {
            if result.is_ok() {
                self.free(slot);
            }
            return;
        }
        let room = match result {
            Ok(units) => Room { slot, object_rows, units },
            Err(failure) => {
                self.slots.give_back(slot);
                return self.not_made(of, failure);
            }
        };
        match of {
            Of::Creation(creation) => self.begin_session(creation, room),
            Of::Return { key, snapshot, .. } => self.begin_replay(key, snapshot, room),
        }
    }

    fn not_made(&mut self, of: Of, failure: EngineError) {
        match (of, failure) {
            (Of::Creation(Creation { session, reply, .. }), failure) => {
                warn!(session = session.id, "not created: {failure}");
                reply.refuse(&failure.into());
            }
            (Of::Return { key, snapshot, .. }, EngineError::OutOfMemory(why)) => {
                self.hibernate_on(key, snapshot.as_deref(), why);
            }
            (Of::Return { .. }, failure) => {
                error!("{failure}");
                self.lose_device(DEVICE_FAILED);
            }
        }
    }

    /// Frees what a session has of the device.
    pub(crate) fn free(&mut self, slot: Slot) {
        debug_assert!(self.in_flight.is_none(), "nothing is taken out of a frame in flight");
        self.effects.push(Effect::Free(slot));
        self.slots.give_back(slot);
    }
}
