//! What sessions need from time to time: anchors, checkpoints, hibernation, and an end.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use firn_engine::frame::cell_bytes;
use firn_protocol::Settings;
use tracing::{debug, info, warn};

use crate::core::inputs::gone;
use crate::core::record::{Part, Record};
use crate::core::session::{Answer, Outlet, SessionError, Simulation};
use crate::core::{Effect, World};

/// Sessions of which it is found out in one frame whether they are to be deleted.
const MOST_ENDS: usize = 256;

/// Time between two attempts to delete a session that nobody wants.
const RETRY: Duration = Duration::from_secs(1);

/// Time between two attempts to save a session for which there was no memory.
const RETRY_CHECKPOINT: Duration = Duration::from_secs(60);

impl World {
    /// Does what is due in this frame. Sessions with nothing due are not looked at: there may be
    /// thousands of them.
    pub(crate) fn look_after_sessions(&mut self) {
        let fallen = std::mem::take(&mut self.fallen);
        self.go_back(&fallen);
        if self.looked_after == self.frame {
            return;
        }
        self.looked_after = self.frame;
        self.wake_for_weather();
        self.anchor_some();
        let now = self.now.instant;
        for _ in 0..MOST_ENDS {
            let Some(key) = self.ends.pop_due(now) else { break };
            self.end(key, now);
        }
    }

    /// Has sessions at rest take part in the coming frame for which a step of weather is due.
    fn wake_for_weather(&mut self) {
        let frame = self.frame;
        while let Some(key) = self.wakes.pop_due(frame) {
            if !self.coming.contains_key(&key) {
                self.guard(key, |simulation| simulation.wake_for_weather(frame));
                self.review(key);
            }
        }
    }

    /// Begins a checkpoint, where one is due: one at a time, and none while it could not be stored. It is
    /// taken in a frame of its own before the next beat, so that no frame with cycles takes longer for it.
    /// Returns whether the coming frame is that one: a session in the middle of a run has it after that.
    pub(crate) fn begin_checkpoint(&mut self) -> bool {
        let now = self.now.instant;
        let free = self.checkpointing.is_none();
        while self.checkpointing.is_none()
            && self.storage.refusal().is_none()
            && let Some(key) = self.saves.pop_due(now)
        {
            self.save(key);
        }
        let begun = self.checkpointing.filter(|_| free).and_then(|key| self.simulations.get(&key));
        begun.is_some_and(|simulation| !simulation.portions.are_under_way())
    }

    /// Notes when a session is to be looked at next.
    pub(crate) fn schedule(&mut self, key: u64) {
        let interval = self.checkpoint_interval;
        let now = self.now.instant;
        if let Some(simulation) = self.simulations.get(&key) {
            let Settings { delete_after_s, idle_timeout_s, .. } = simulation.state.settings;
            let idle = simulation.session.idle_for();
            let tired = after(now, idle_timeout_s, idle);
            let due = simulation.log.checkpoint_due(interval);
            self.ends.set(key, after(now, delete_after_s, idle));
            let wanted = [tired, due].into_iter().flatten().min();
            self.saves.set(key, simulation.log.checkpoint_at(wanted));
        } else if let Some(session) = self.hibernating.get(&key) {
            let kept = session.mirror().settings.delete_after_s;
            self.ends.set(key, after(now, kept, session.idle_for()));
        }
    }

    /// Deletes a session, where nobody has wanted it for so long.
    fn end(&mut self, key: u64, now: Instant) {
        let (session, kept) = match self.simulations.get(&key) {
            Some(simulation) => (&simulation.session, simulation.state.settings.delete_after_s),
            None => match self.hibernating.get(&key) {
                Some(session) => (session, session.mirror().settings.delete_after_s),
                None => return,
            },
        };
        // Where it is being woken, this is looked at again when it is awake.
        if self.is_leaving(key) || self.coming.contains_key(&key) {
            return;
        }
        // Of a locked one an administrator decides.
        let forsaken = !session.is_locked() && kept.is_some_and(|kept| session.idle_for() >= kept);
        if !forsaken {
            self.schedule(key);
        } else if self.storage.refusal().is_some() {
            self.ends.set(key, now.checked_add(RETRY));
        } else {
            info!(session = session.id, "deleted: nobody has asked for it");
            self.delete(key, None);
        }
    }

    /// Begins a checkpoint of a session, where one is due or nobody has wanted it for so long that it
    /// hibernates.
    fn save(&mut self, key: u64) {
        let (frame, interval) = (self.frame, self.checkpoint_interval);
        // Either is looked at again when that ends.
        let elsewhere = self.is_leaving(key) || self.coming.contains_key(&key);
        let Some(simulation) = self.simulations.get_mut(&key) else { return };
        if simulation.step.is_some() || simulation.frozen || elsewhere {
            return;
        }
        let tired = simulation.is_tired();
        let due = simulation.log.checkpoint_due(interval);
        if !tired && due.is_none_or(|due| due > self.now.instant) {
            self.schedule(key);
            return;
        }
        if !(self.has_memory)(cell_bytes(&simulation.session.spec.grid)) {
            warn!(session = simulation.session.id, "no checkpoint for want of memory");
            self.saves.set(key, self.now.instant.checked_add(RETRY_CHECKPOINT));
            return;
        }
        simulation.catch_up(frame);
        simulation.frozen = tired;
        simulation.next.checkpoint = true;
        self.checkpointing = Some(key);
        self.review(key);
    }

    /// Has sessions go back to what is stored of them.
    pub(crate) fn go_back(&mut self, keys: &[u64]) {
        let why = self.storage.refusal().unwrap_or_else(|| {
            SessionError::Unavailable("the session went back to what is stored".to_owned())
        });
        for key in keys {
            if let Some(simulation) = self.simulations.remove(key) {
                self.free(simulation.slot);
                self.evict(simulation, &why);
            } else if let Some(coming) = self.coming.get(key) {
                let (session, tick) = (coming.session().clone(), coming.tick());
                self.go_back_from(session, tick);
            } else if let Some(session) = self.hibernating.remove(key) {
                // There was no room for it while something of it was still on its way.
                self.count_hibernating();
                let tick = session.mirror().clock_at(self.frame).tick();
                self.go_back_from(session, tick);
            }
        }
    }

    /// Has a session come back that is no longer on the device. Requests in its frames are refused with `why`.
    pub(crate) fn evict(&mut self, mut simulation: Box<Simulation>, why: &SessionError) {
        let (session, until) = (simulation.session.clone(), simulation.until(self.frame));
        let key = session.key;
        if self.checkpointing == Some(key) {
            self.checkpointing = None;
        }
        self.fallen.retain(|fallen| *fallen != key);
        // Answers were given for what was never handed to the journal: it will not become durable.
        let (last, record) = (simulation.log.last_told(), self.records.get_mut(&key));
        let handed_over = record.as_ref().map_or(0, |record| record.position);
        if last > handed_over {
            session.receipts.refuse((handed_over + 1, last), why);
        }
        if let Some(record) = record {
            record.position = record.position.max(last);
        }
        simulation.refuse_all(why);
        self.go_back_from(session, until);
    }

    pub(crate) fn checkpointed(&mut self, key: u64, life: u64, stored: bool) {
        let frame = self.frame;
        let base = self.records.get(&key).map_or(0, |record| record.stored.base());
        let Some(simulation) = self.simulations.get_mut(&key) else { return };
        if simulation.log.life() != life {
            return;
        }
        if self.checkpointing == Some(key) {
            self.checkpointing = None;
        }
        if stored {
            simulation.log.release();
        } else {
            simulation.log.uncover(base, self.now.instant);
        }
        if let Some(stop) = &mut self.stop {
            // Time stands still for good.
            stop.checkpointed(key, stored);
            return;
        }
        let covered = stored && !simulation.has_orders() && simulation.log.is_covered();
        if simulation.frozen && covered && simulation.is_tired() {
            self.hibernate(key);
        } else if simulation.frozen {
            simulation.thaw(frame);
            self.review(key);
        }
        self.schedule(key);
    }

    /// Wakes a session, if it hibernates, and has it come back, if it has panicked.
    pub(crate) fn wake(&mut self, key: u64) {
        let frame = self.frame;
        if let Some(simulation) = self.simulations.get_mut(&key)
            && simulation.frozen
        {
            simulation.thaw(frame);
            self.review(key);
        }
        if self.fallen.contains(&key) {
            self.go_back(&[key]);
        } else if let Some(session) = self.hibernating.remove(&key) {
            self.count_hibernating();
            self.come_back(session);
        }
        self.ask_for(key);
    }

    /// Frees the memory of a session whose checkpoint is its state, unless somebody comes just then.
    fn hibernate(&mut self, key: u64) {
        let frame = self.frame;
        let Some(simulation) = self.simulations.get_mut(&key) else { return };
        simulation.session.hibernating.store(true, Ordering::SeqCst);
        if !simulation.is_tired() {
            simulation.session.hibernating.store(false, Ordering::SeqCst);
            simulation.thaw(frame);
            self.review(key);
            return;
        }
        let Some(simulation) = self.simulations.remove(&key) else { return };
        self.free(simulation.slot);
        let session = simulation.session.clone();
        session.stand_still(simulation.state.clock);
        debug!(session = session.id, "hibernates");
        self.hibernating.insert(key, session);
        self.count_hibernating();
    }

    /// Deletes a session: first from the store, then from the device. Nothing else happens to it meanwhile.
    pub(crate) fn delete(&mut self, key: u64, reply: Option<Answer<()>>) {
        if let Some(deletion) = self.records.get_mut(&key).and_then(Record::deletion) {
            deletion.replies.extend(reply);
            return;
        }
        self.submit_parts(key, vec![Part::Delete], reply);
        self.simulations.set_active(key, false);
    }

    /// Takes a session out of the world that is no longer stored.
    pub(crate) fn deleted(&mut self, key: u64) {
        if let Some(record) = self.records.remove(&key) {
            let keys = record.stored.done.iter().map(|done| done.key).collect();
            self.effects.push(Effect::Forget(keys));
            record.receipts().end(&gone());
        }
        let coming = self.give_up_coming(key, &gone());
        if self.simulations.contains_key(&key) {
            self.remove(key, &gone());
        } else if let Some(session) = self.hibernating.remove(&key).or(coming) {
            self.forget(key, &session);
        }
        self.count_hibernating();
    }

    pub(crate) fn count_hibernating(&self) {
        self.vitals.hibernating.store(self.hibernating.len() as u64, Ordering::Relaxed);
    }

    /// Notes that a session is no more.
    pub(crate) fn forget(&mut self, key: u64, session: &Outlet) {
        self.ends.remove(key);
        self.saves.remove(key);
        self.wakes.remove(key);
        self.refuse_mail(key, &gone());
        self.names.forget(session);
    }
}

/// When something is due that is to be some time after somebody was last with a session, who has
/// been away for some time.
fn after(now: Instant, limit_s: Option<f64>, idle_s: f64) -> Option<Instant> {
    // A time that is too long to be told never comes.
    now.checked_add(Duration::try_from_secs_f64((limit_s? - idle_s).max(0.0)).ok()?)
}
