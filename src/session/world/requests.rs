//! Requests, taken in between frames.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use tracing::warn;

use crate::engine::frame::{EngineError, SampleBox};
use crate::session::error::SessionError;
use crate::session::handle::Session;
use crate::session::message::Message;
use crate::session::orders::{Answer, Reply};
use crate::session::simulation::Simulation;
use crate::session::snapshot::Snapshot;

use super::engine::Engine;

/// Edits of one session in one frame after which other requests wait for the next.
const MOST_EDITS: usize = 4096;

impl Engine {
    pub(super) fn take_message(&mut self, message: Message) -> bool {
        match message {
            Message::Create { session, saved, reply } => self.create(session, saved, reply),
            Message::Delete { key, reply } => {
                let name = self.simulations.get(&key).map(|sim| sim.session.id.clone());
                let result = name.ok_or_else(gone).map(|id| {
                    self.remove(key, &SessionError::NotFound { kind: "session", id });
                });
                // Here and below: whoever has gone away needs no answer.
                drop(reply.send(result));
            }
            Message::Change { key, change, reply } => {
                let most = self.config.limits.colliders_per_session;
                self.order(key, reply, |sim, reply| sim.change(change, most, reply));
            }
            Message::Step { key, step, reply } => {
                self.order(key, reply, |sim, reply| sim.begin_step(&step, reply));
            }
            Message::Reset { key, saved, reply } => {
                self.order(key, reply, |sim, reply| sim.begin_reset(saved.as_deref(), reply));
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
                drop(reply.send(result));
            }
            Message::Stop => return false,
        }
        true
    }

    fn create(&mut self, session: Arc<Session>, saved: Option<Box<Snapshot>>, reply: Answer<()>) {
        let slot = self.slots.take();
        let layout = Simulation::layout(&session.spec);
        if let Err(failure) = self.backend.create(slot, &layout) {
            self.slots.give_back(slot);
            let refused = match failure {
                EngineError::OutOfMemory(_) => SessionError::OutOfMemory(failure.to_string()),
                _ => SessionError::Unavailable(failure.to_string()),
            };
            warn!(session = session.id, "not created: {failure}");
            drop(reply.send(Err(refused)));
            return;
        }
        let key = session.key;
        self.simulations.insert(key, Simulation::new(session, slot, self.frame));
        self.guard(key, |simulation| {
            simulation.begin(saved.as_deref());
            simulation.next.replies.push(Reply::Created(reply));
        });
        self.review(key);
    }

    /// Hands a request with its answer to a simulation, and sees to it that it gets a frame.
    fn order<T>(
        &mut self,
        key: u64,
        reply: Answer<T>,
        act: impl FnOnce(&mut Simulation, Answer<T>),
    ) {
        if !self.simulations.contains_key(&key) {
            drop(reply.send(Err(gone())));
            return;
        }
        let frame = self.frame;
        let edits = self.guard(key, |simulation| {
            simulation.catch_up(frame);
            act(simulation, reply);
            simulation.next.edits.len()
        });
        self.full |= edits.is_some_and(|edits| edits >= MOST_EDITS);
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
        self.guard(key, act)
            .ok_or_else(|| SessionError::Internal("the session failed and is ended".to_owned()))
    }

    /// Takes a session out of the world. Whoever waits for it gets `why`.
    pub(super) fn remove(&mut self, key: u64, why: &SessionError) {
        let Some(simulation) = self.simulations.remove(&key) else { return };
        self.backend.release(simulation.slot);
        self.slots.give_back(simulation.slot);
        self.names.remove(&simulation.session.id);
        simulation.session.gone.cancel();
        self.vitals.memory.store(self.backend.memory(), Ordering::Relaxed);
        simulation.refuse_all(why);
    }
}

fn gone() -> SessionError {
    SessionError::NotFound { kind: "session", id: "deleted meanwhile".to_owned() }
}
