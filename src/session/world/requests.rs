//! Requests, taken in between frames.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use firn_engine::frame::{EngineError, SampleBox};
use firn_engine::made::Made;
use tracing::warn;

use crate::session::answer::Answer;
use crate::session::error::SessionError;
use crate::session::handle::Session;
use crate::session::journal::{Ack, Identity, Log, Record, Submission};
use crate::session::message::Message;
use crate::session::once::Done;
use crate::session::orders::Reply;
use crate::session::simulation::Simulation;
use crate::session::snapshot::Snapshot;
use crate::session::token::TokenHashes;

use super::Fault;
use super::engine::Engine;
use super::revive::Room;

impl Engine {
    /// Takes a request in. Returns false where it says to stop.
    ///
    /// # Errors
    /// Those of the backend, where a session is woken.
    pub(super) fn take_message(&mut self, message: Message) -> Result<bool, EngineError> {
        let Some(message) = self.put_off(message)? else { return Ok(true) };
        match message {
            Message::Create { session, made, saved, done, reply } => {
                self.create(session, made, saved, done, reply);
            }
            Message::Delete { key, reply } => {
                if self.simulations.contains_key(&key) || self.hibernating.contains_key(&key) {
                    self.delete(key, Some(reply));
                } else {
                    reply.refuse(&gone());
                }
            }
            Message::Change { key, change, once, reply } => {
                let most = self.config.limits.colliders_per_session;
                self.alter(key, reply, move |sim, reply| {
                    sim.between_ticks(reply, move |sim, reply| {
                        sim.change(change, once, most, reply);
                    });
                });
            }
            Message::Step { key, step, reply } => {
                self.alter(key, reply, |sim, reply| sim.step_after_changes(step, reply));
            }
            Message::Reset { key, saved, reply } => {
                self.alter(key, reply, |sim, reply| sim.reset_between_ticks(saved, reply));
            }
            Message::Tokens { key, hashes, reply } => {
                self.set_tokens(key, hashes, reply);
            }
            Message::Snapshot { key, reply } => {
                self.order(key, reply, |sim, reply| sim.next.snapshots.push(reply));
            }
            Message::Gather { key, tiles, reply } => {
                self.order(key, reply, |sim, reply| sim.next.gathers.push((tiles, reply)));
            }
            Message::Sample { key, columns, y0, height, reply } => {
                self.order(key, reply, |sim, reply| {
                    let dt = sim.cycle_length();
                    sim.next.samples.push((SampleBox { columns, y0, height, dt }, reply));
                });
            }
            Message::Mass { key, reply } => {
                self.order(key, reply, |sim, reply| sim.next.tallies.push(reply));
            }
            Message::Inspect { key, look, reply } => {
                let result = self.with(key, |simulation| look(simulation));
                // Here and below: whoever has gone away needs no answer.
                reply.give(result);
            }
            Message::Unlock { session, reply } => self.unlock(session, reply),
            Message::Woken { key, generation, decoded } => {
                self.woken(key, generation, *decoded)?;
            }
            Message::Wake { .. } | Message::Nudge => {}
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
        made: Made,
        saved: Option<Box<Snapshot>>,
        done: Option<Arc<Done>>,
        reply: Answer<()>,
    ) {
        if let Some(why) = self.journal.refusal() {
            reply.refuse(&why);
            return;
        }
        let Room { slot, object_rows, units } = match self.take_in(saved.as_deref(), made) {
            Ok(room) => room,
            Err(failure) => {
                warn!(session = session.id, "not created: {failure}");
                reply.refuse(&failure.into());
                return;
            }
        };
        let key = session.key;
        let log = Log::created(Arc::new(session.identity()), session.origin.clone(), done);
        let mut simulation = Simulation::new(session, slot, self.frame, log, object_rows);
        simulation.portions.furnish(units);
        self.simulations.insert(key, simulation);
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
            reply.refuse(&refusal.unwrap_or_else(gone));
            return;
        };
        let identity = Arc::new(Identity { tokens, ..session.identity() });
        let ack: Ack = Box::new(move |durable| {
            if durable.is_ok() {
                session.set_tokens(tokens);
            }
            reply.give(durable);
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
    ) {
        match self.journal.refusal() {
            Some(why) => reply.refuse(&why),
            None => self.order(key, reply, act),
        }
    }

    /// Hands a request with its answer to a simulation, and sees to it that it gets a frame.
    fn order<T>(
        &mut self,
        key: u64,
        reply: Answer<T>,
        act: impl FnOnce(&mut Simulation, Answer<T>),
    ) {
        if !self.simulations.contains_key(&key) {
            reply.refuse(&gone());
            return;
        }
        let frame = self.frame;
        self.guard(key, |simulation| {
            simulation.catch_up(frame);
            act(simulation, reply);
        });
        self.review(key);
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

pub(super) fn gone() -> SessionError {
    SessionError::NotFound { kind: "session", id: "deleted meanwhile".to_owned() }
}
