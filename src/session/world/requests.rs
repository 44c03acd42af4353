//! What reaches the world, taken in between frames.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use firn_engine::frame::EngineError;
use firn_engine::made::Made;
use tracing::warn;

use crate::session::answer::Answer;
use crate::session::error::SessionError;
use crate::session::handle::Session;
use crate::session::journal::{Anchor, Identity, Log, Part};
use crate::session::keyed::Done;
use crate::session::message::{Control, Message};
use crate::session::orders::Reply;
use crate::session::receipt::Receipted;
use crate::session::simulation::Simulation;
use crate::session::snapshot::Snapshot;
use crate::session::token::TokenHashes;

use super::Fault;
use super::back::{Coming, Room};
use super::engine::Engine;

impl Engine {
    /// Takes in what has arrived. Returns false where it says to stop.
    ///
    /// # Errors
    /// Those of the backend, where sessions come back.
    pub(super) fn take_message(&mut self, message: Message) -> Result<bool, EngineError> {
        match message {
            Message::Create { session, made, saved, done, reply } => {
                self.create(session, made, saved, done, reply);
            }
            Message::Request { key, request } => self.post(key, request),
            Message::Control { key, control } => self.control(key, control),
            Message::Read(read) => self.take_in_all(read)?,
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

    /// Does something of a session at once.
    fn control(&mut self, key: u64, control: Control) {
        let Some(session) = self.session(key).cloned() else {
            control.refuse(&gone());
            return;
        };
        match control {
            Control::Delete(reply) => self.delete(key, Some(reply)),
            Control::Tokens(hashes, reply) => self.set_tokens(session, hashes, reply),
            Control::Unlock(reply) => self.unlock(key, reply),
            Control::Wake => self.wake(key),
        }
    }

    /// A session, wherever its snow is.
    pub(super) fn session(&self, key: u64) -> Option<&Arc<Session>> {
        let simulated = self.simulations.get(&key).map(|simulation| &simulation.session);
        let coming = || self.coming.get(&key).map(Coming::session);
        simulated.or_else(|| self.hibernating.get(&key)).or_else(coming)
    }

    fn create(
        &mut self,
        session: Arc<Session>,
        made: Made,
        saved: Option<Box<Snapshot>>,
        done: Option<Arc<Done>>,
        reply: Answer<Receipted<()>>,
    ) {
        if let Some(why) = self.storage.refusal() {
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
        let mut anchor = Anchor { adapter: self.adapter, ..Anchor::default() };
        anchor.set_seq(self.round, session.epochs.first_seq());
        let identity = Arc::new(session.identity());
        let (origin, epochs) = (session.origin.clone(), session.epochs.clone());
        let log = Log::created(identity, origin, epochs, anchor, done);
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
    fn set_tokens(&mut self, session: Arc<Session>, tokens: TokenHashes, reply: Answer<()>) {
        if let Some(why) = self.storage.refusal() {
            reply.refuse(&why);
            return;
        }
        let identity = Arc::new(Identity { tokens, ..session.identity() });
        self.submit_parts(session.key, vec![Part::Identity(identity)], Some(reply));
    }

    /// Unlocks a session, once that is durable.
    fn unlock(&mut self, key: u64, reply: Answer<()>) {
        match self.storage.refusal() {
            Some(why) => reply.refuse(&why),
            None => self.submit_parts(key, vec![Part::Lock(None)], Some(reply)),
        }
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
        self.refuse_mail(key, why);
        self.forget(key, &session);
        self.vitals.memory.store(self.backend.memory(), Ordering::Relaxed);
        simulation.refuse_all(why);
    }
}

pub(super) fn gone() -> SessionError {
    SessionError::NotFound { kind: "session", id: "deleted meanwhile".to_owned() }
}
