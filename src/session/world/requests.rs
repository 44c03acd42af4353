//! Requests, taken in between frames.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use tracing::warn;

use crate::engine::frame::{EngineError, SampleBox};
use crate::session::error::SessionError;
use crate::session::handle::Session;
use crate::session::journal::{Ack, Identity, Log, Record, Submission};
use crate::session::message::Message;
use crate::session::object_rows::ObjectRows;
use crate::session::once::Done;
use crate::session::orders::{Answer, MOST_EDITS, Reply, refuse};
use crate::session::simulation::Simulation;
use crate::session::snapshot::Snapshot;
use crate::session::token::TokenHashes;

use super::Fault;
use super::engine::Engine;

impl Engine {
    /// Takes a request in. Returns false where it says to stop.
    ///
    /// # Errors
    /// Those of the backend, where a session is woken.
    pub(super) fn take_message(&mut self, message: Message) -> Result<bool, EngineError> {
        match message {
            Message::Create { session, saved, done, reply } => {
                self.create(session, saved, done, reply);
            }
            Message::Delete { key, reply } => {
                if self.simulations.contains_key(&key) || self.hibernating.contains_key(&key) {
                    self.delete(key, Some(reply));
                } else {
                    refuse(reply, &gone());
                }
            }
            Message::Change { key, change, once, reply } => {
                let most = self.config.limits.colliders_per_session;
                self.alter(key, reply, move |sim, reply| {
                    sim.between_ticks(reply, move |sim, reply| {
                        sim.change(change, once, most, reply);
                    });
                })?;
            }
            Message::Step { key, step, reply } => {
                self.alter(key, reply, |sim, reply| sim.step_after_changes(step, reply))?;
            }
            Message::Reset { key, saved, reply } => {
                self.alter(key, reply, |sim, reply| sim.reset_between_ticks(saved, reply))?;
            }
            Message::Tokens { key, hashes, reply } => {
                self.set_tokens(key, hashes, reply);
            }
            Message::Snapshot { key, reply } => {
                self.order(key, reply, |sim, reply| sim.next.snapshots.push(reply))?;
            }
            Message::Gather { key, tiles, reply } => {
                self.order(key, reply, |sim, reply| sim.next.gathers.push((tiles, reply)))?;
            }
            Message::Sample { key, columns, y0, height, reply } => {
                self.order(key, reply, |sim, reply| {
                    let dt = sim.cycle_length();
                    sim.next.samples.push((SampleBox { columns, y0, height, dt }, reply));
                })?;
            }
            Message::Mass { key, reply } => {
                self.order(key, reply, |sim, reply| sim.next.tallies.push(reply))?;
            }
            Message::Inspect { key, look, reply } => {
                self.wake(key)?;
                let result = self.with(key, |simulation| look(simulation));
                // Here and below: whoever has gone away needs no answer.
                drop(reply.send(result));
            }
            Message::Wake { key } => self.wake(key)?,
            Message::Nudge => {}
            Message::Break(Fault::LoseDevice) => self.backend.lose(),
            Message::Break(Fault::Panic) => panic!("a test asked for this"),
            Message::Stop(deadline) => {
                self.stop = Some(deadline);
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn create(
        &mut self,
        session: Arc<Session>,
        saved: Option<Box<Snapshot>>,
        done: Option<Arc<Done>>,
        reply: Answer<()>,
    ) {
        if let Some(why) = self.journal.refusal() {
            refuse(reply, &why);
            return;
        }
        let mut rows = ObjectRows::new(self.object_rows.clone());
        let taken = saved.as_ref().map_or(0, |snapshot| snapshot.object_rows());
        if let Err(why) = rows.try_take(taken) {
            refuse(reply, &why);
            return;
        }
        let slot = self.slots.take();
        let layout = Simulation::layout(&session.spec);
        if let Err(failure) = self.backend.create(slot, &layout) {
            self.slots.give_back(slot);
            let refused = match failure {
                EngineError::OutOfMemory(_) => SessionError::OutOfMemory(failure.to_string()),
                _ => SessionError::Unavailable(failure.to_string()),
            };
            warn!(session = session.id, "not created: {failure}");
            refuse(reply, &refused);
            return;
        }
        let key = session.key;
        let log = Log::created(Arc::new(session.identity()), session.origin.clone(), done);
        self.simulations.insert(key, Simulation::new(session, slot, self.frame, log, rows));
        self.guard(key, |simulation| {
            simulation.begin(saved.as_deref());
            simulation.next.replies.push(Reply::Created(reply));
        });
        self.review(key);
    }

    /// Gives a session other tokens, once that is durable.
    fn set_tokens(&mut self, key: u64, tokens: TokenHashes, reply: Answer<()>) {
        let (session, generation) = match self.simulations.get(&key) {
            Some(simulation) => (Some(&simulation.session), simulation.log.generation()),
            None => (self.hibernating.get(&key), self.journal.generation(key)),
        };
        let refusal = self.journal.refusal().or_else(|| session.is_none().then(gone));
        let (None, Some(session)) = (refusal.clone(), session.cloned()) else {
            refuse(reply, &refusal.unwrap_or_else(gone));
            return;
        };
        let identity = Arc::new(Identity { tokens, ..session.identity() });
        let ack: Ack = Box::new(move |durable| {
            if durable.is_ok() {
                session.set_tokens(tokens);
            }
            drop(reply.send(durable));
        });
        let records = vec![Record::Identity(identity)];
        self.journal.add(Submission { key, generation, records, acks: vec![ack] });
        self.journal.send();
    }

    /// As [`Engine::order`], for what has to be durable.
    fn alter<T>(
        &mut self,
        key: u64,
        reply: Answer<T>,
        act: impl FnOnce(&mut Simulation, Answer<T>),
    ) -> Result<(), EngineError> {
        match self.journal.refusal() {
            Some(why) => {
                refuse(reply, &why);
                Ok(())
            }
            None => self.order(key, reply, act),
        }
    }

    /// Hands a request with its answer to a simulation, and sees to it that it gets a frame.
    fn order<T>(
        &mut self,
        key: u64,
        reply: Answer<T>,
        act: impl FnOnce(&mut Simulation, Answer<T>),
    ) -> Result<(), EngineError> {
        self.wake(key)?;
        if !self.simulations.contains_key(&key) {
            let asleep = self.hibernating.contains_key(&key);
            refuse(reply, &if asleep { no_room() } else { gone() });
            return Ok(());
        }
        let frame = self.frame;
        let edits = self.guard(key, |simulation| {
            simulation.catch_up(frame);
            act(simulation, reply);
            simulation.next.edits.len()
        });
        self.full |= edits.is_some_and(|edits| edits >= MOST_EDITS);
        self.review(key);
        Ok(())
    }

    fn with<T>(
        &mut self,
        key: u64,
        act: impl FnOnce(&mut Simulation) -> T,
    ) -> Result<T, SessionError> {
        if !self.simulations.contains_key(&key) {
            return Err(gone());
        }
        let frame = self.frame;
        let caught_up = |simulation: &mut Simulation| {
            simulation.catch_up(frame);
            act(simulation)
        };
        self.guard(key, caught_up).ok_or_else(|| {
            SessionError::Internal("the session failed; it is back as it was stored".to_owned())
        })
    }

    /// Takes a session out of the world. Whoever waits for it gets `why`.
    pub(super) fn remove(&mut self, key: u64, why: &SessionError) {
        let Some(simulation) = self.simulations.remove(&key) else { return };
        if self.checkpointing == Some(key) {
            self.checkpointing = None;
        }
        self.backend.release(simulation.slot);
        self.slots.give_back(simulation.slot);
        let session = simulation.session.clone();
        self.forget(key, &session);
        self.vitals.memory.store(self.backend.memory(), Ordering::Relaxed);
        simulation.refuse_all(why);
    }
}

fn gone() -> SessionError {
    SessionError::NotFound { kind: "session", id: "deleted meanwhile".to_owned() }
}

fn no_room() -> SessionError {
    let why = "the session hibernates, and there is no room on the device to wake it".to_owned();
    SessionError::OutOfMemory(why)
}
