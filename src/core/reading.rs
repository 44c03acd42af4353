//! Another thread reads the stored sessions that come back, several at a time.

use std::sync::Arc;

use firn_engine::frame::EngineError;
use firn_engine::made::{Made, Maker};
use tracing::debug;

use crate::core::back::{Coming, Stage};
use crate::core::frame::caught;
use crate::core::record::{Replay, Stored};
use crate::core::session::{Limits, Outlet, SessionError, Simulation};
use crate::core::snapshot::Snapshot;
use crate::core::{Effect, World};

/// Cells that are read and not restored yet, unless one session has more.
const WAVE: u64 = 16 << 20;

/// A session as it was stored, ready to be taken in.
pub(crate) struct Decoded {
    pub snapshot: Option<Box<Snapshot>>,
    pub made: Result<Made, EngineError>,
}

impl Decoded {
    /// Reads what is stored of a session. That takes memory and a while; any thread does it.
    ///
    /// # Errors
    /// Where it can't be read.
    fn new(session: &Outlet, stored: &Stored, maker: Maker) -> Result<Decoded, SessionError> {
        let checkpoint = stored.checkpoint.as_ref();
        let snapshot = checkpoint.map(|saved| Snapshot::decode(&saved.snapshot, &Limits::NONE));
        let snapshot = snapshot.transpose()?.map(Box::new);
        let made = maker.make(Simulation::layout(&session.spec));
        Ok(Decoded { snapshot, made })
    }
}

/// What was read of a session, in the life that it is of.
pub(crate) struct Read {
    pub key: u64,
    pub life: u64,
    pub decoded: Result<Decoded, SessionError>,
}

impl World {
    /// Begins to read the next sessions, as many as memory allows.
    pub(crate) fn read_next(&mut self) {
        if self.queue.is_empty() && self.asked.is_empty() {
            return;
        }
        let restores = |key: &u64| {
            let replay =
                self.simulations.get(key).and_then(|simulation| simulation.replay.as_ref());
            replay.is_some_and(Replay::restores)
        };
        // What was read takes memory until it is restored.
        let takes_memory = |(key, coming): &(&u64, &Coming)| {
            matches!(coming.stage, Stage::Reading | Stage::Making) || restores(key)
        };
        let under_way = self.coming.iter().filter(takes_memory);
        let mut cells = under_way.map(|(_, coming)| coming.cells()).sum::<u64>();
        let mut wave = Vec::new();
        loop {
            let queue = if self.asked.is_empty() { &mut self.queue } else { &mut self.asked };
            let Some(&key) = queue.front() else { break };
            let waits = |coming: &&mut Coming| coming.stage == Stage::Queued;
            let Some(coming) = self.coming.get_mut(&key).filter(waits) else {
                queue.pop_front();
                continue;
            };
            if cells > 0 && cells + coming.cells() > WAVE {
                break;
            }
            queue.pop_front();
            cells += coming.cells();
            coming.stage = Stage::Reading;
            debug!(session = coming.session().id, "comes back");
            let life = self.records.get(&key).map_or(0, |record| record.life);
            let (session, stored) = (coming.session().clone(), coming.stored.clone());
            wave.push(Wanted { session, stored, life });
        }
        if !wave.is_empty() {
            self.effects.push(Effect::Read(wave));
        }
    }
}

/// A session that is to be read.
pub(crate) struct Wanted {
    session: Arc<Outlet>,
    stored: Stored,
    life: u64,
}

impl Wanted {
    /// Reads it. A panic is its own.
    pub fn read(self, maker: Maker) -> Read {
        let Wanted { session, stored, life } = self;
        let decoded = caught(|| Decoded::new(&session, &stored, maker)).unwrap_or_else(|| {
            Err(SessionError::Internal("reading its checkpoint failed".to_owned()))
        });
        Read { key: session.key, life, decoded }
    }
}
