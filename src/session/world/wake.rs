//! Waking sessions that hibernate, beside all others: what is stored of one is decoded on a thread of its
//! own, and restored in parts of frames. Requests for the session wait meanwhile, in their order.

use std::sync::Arc;

use firn_engine::frame::EngineError;
use tracing::debug;

use crate::machine;
use crate::session::error::SessionError;
use crate::session::handle::Session;
use crate::session::journal::Stored;
use crate::session::message::Message;
use crate::session::portion::Portions;
use crate::session::simulation::Simulation;

use super::engine::Engine;
use super::frame::caught;
use super::revive::{Decoded, Revival};

/// A session that is being woken.
pub(super) struct Waking {
    session: Arc<Session>,
    stored: Stored,
}

impl Waking {
    pub fn session(&self) -> &Arc<Session> {
        &self.session
    }
}

impl Engine {
    /// Wakes a session, if it hibernates, and brings it back, if it has panicked.
    ///
    /// # Errors
    /// Those of the backend, where it is brought back.
    pub(super) fn wake(&mut self, key: u64) -> Result<(), EngineError> {
        let frame = self.frame;
        if let Some(simulation) = self.simulations.get_mut(&key)
            && simulation.frozen
        {
            simulation.thaw(frame);
            self.review(key);
        }
        if let Some(place) = self.fallen.iter().position(|&fallen| fallen == key) {
            self.fallen.swap_remove(place);
            return self.go_back(&[key]);
        }
        let Some(session) = self.hibernating.remove(&key) else { return Ok(()) };
        self.count_hibernating();
        self.begin_to_wake(session);
        Ok(())
    }

    /// Begins anew to wake a session that goes back to what is stored, or to bring it back.
    pub(super) fn begin_anew(&mut self, key: u64) {
        if let Some(Waking { session, .. }) = self.waking.remove(&key) {
            self.begin_to_wake(session);
        } else if let Some(session) = self.comebacks.get(&key).map(Revival::session).cloned()
            && let Some(stored) = self.new_life(key, 0)
        {
            self.comebacks.insert(key, Revival::anew(session, stored));
        }
    }

    fn begin_to_wake(&mut self, session: Arc<Session>) {
        let Some(stored) = self.new_life(session.key, 0) else {
            self.forget(session.key, &session);
            return;
        };
        let life = self.life(session.key);
        debug!(session = session.id, "wakes");
        let (maker, woken, kept) = (self.backend.maker(), session.clone(), stored.clone());
        let read = move || {
            let decoded = caught(|| Decoded::new(&woken, &kept, maker)).unwrap_or_else(|| {
                Err(SessionError::Internal("reading its checkpoint failed".to_owned()))
            });
            let decoded = Box::new(decoded);
            let key = woken.key;
            // Where the world has ended, nobody waits for it.
            let _ = woken.world.blocking_send(Message::Woken { key, life, decoded });
        };
        machine::aside(Box::new(read), |work| drop(self.clock.spawn_blocking(work)));
        self.waking.insert(session.key, Waking { session, stored });
    }

    /// Takes in a session that was decoded, and begins to restore it.
    ///
    /// # Errors
    /// Those of the backend.
    pub(super) fn woken(
        &mut self,
        key: u64,
        life: u64,
        decoded: Result<Decoded, SessionError>,
    ) -> Result<(), EngineError> {
        let of_this_life = self.life(key) == life;
        let Some(Waking { session, stored }) = self.waking.get(&key).filter(|_| of_this_life)
        else {
            return Ok(());
        };
        let revival = Revival::anew(session.clone(), stored.clone());
        match self.begin_life(revival, decoded, Portions::default())? {
            Ok(()) => self.busy = true,
            Err(why) => drop(self.give_up_waking(key, &why)),
        }
        Ok(())
    }

    /// Has sessions that are being restored do so in the next frame.
    pub(super) fn feed_waking(&mut self) {
        let keys: Vec<u64> = self.waking.keys().copied().collect();
        for key in keys {
            if self.guard(key, Simulation::feed_replay).is_some() {
                self.simulations.set_active(key, true);
            }
        }
    }

    /// Takes in what a frame has done of sessions that are being restored.
    pub(super) fn advance_waking(&mut self) {
        let keys: Vec<u64> = self.waking.keys().copied().collect();
        for key in keys {
            // Where it had to wait for another frame, nothing of it is done.
            let advance = |sim: &mut Simulation| sim.next.edits.is_empty() && sim.advance_replay();
            if self.guard(key, advance) != Some(true) {
                continue;
            }
            let frame = self.frame;
            // No time has passed until now.
            self.guard(key, |simulation| simulation.frame = frame);
            self.waking.remove(&key);
            self.review(key);
            self.schedule(key);
        }
        self.busy |= self.has_mail();
    }

    /// Gives up waking a session. Whoever waits for it is told why.
    pub(super) fn give_up_waking(&mut self, key: u64, why: &SessionError) -> Option<Arc<Session>> {
        let Waking { session, .. } = self.waking.remove(&key)?;
        self.refuse_mail(key, why);
        Some(session)
    }

    /// Gives up waking all sessions that are being woken.
    pub(super) fn give_up_all_waking(&mut self, why: &SessionError) -> Vec<Arc<Session>> {
        let keys: Vec<u64> = self.waking.keys().copied().collect();
        keys.into_iter().filter_map(|key| self.give_up_waking(key, why)).collect()
    }

    /// The life that a session is in.
    fn life(&self, key: u64) -> u64 {
        self.records.get(&key).map_or(0, |record| record.life)
    }
}
