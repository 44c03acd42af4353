//! What the core is told, taken in between frames. What sessions are asked waits in their inboxes, wherever their
//! snow is.

use std::sync::Arc;

use crate::core::back::Coming;
use crate::core::making::{Of, Room};
use crate::core::record::{Anchor, Identity, Log, Part};
use crate::core::session::{
    Answer, Outlet, Receipted, Reply, Request, SessionError, Simulation, TokenHashes,
};
use crate::core::stop::Stop;
use crate::core::{Control, Creation, Input, World};

impl World {
    pub(crate) fn take_input(&mut self, input: Input) {
        match input {
            Input::Create { creation, made } => match self.refusal() {
                Some(why) => creation.reply.refuse(&why),
                None => self.make(Ok(made), Of::Creation(creation)),
            },
            Input::Request { key, request } => match self.absence() {
                Some(why) => request.refuse(&why),
                None => self.post(key, request),
            },
            Input::Control { key, control } => match self.absence() {
                Some(why) => control.refuse(&why),
                None => self.control(key, control),
            },
            Input::Beat => self.beat_due = true,
            Input::Made { slot, result } => self.made(slot, result),
            Input::Done(outcome) => self.conclude_frame(outcome),
            Input::Lost(why) => self.lose_device(why),
            Input::Opened(is_open) => self.opened(is_open),
            Input::Read(read) => self.take_in_all(read),
            Input::Journal(verdict) => self.hear(verdict),
            Input::JournalDied => self.lose_journal(),
            Input::Stop(until) => self.stop = Some(Stop::by(until, self.now.instant)),
            Input::Nudge | Input::Break(_) => {}
        }
    }

    /// Why nothing can be asked now, if that is so.
    fn absence(&self) -> Option<SessionError> {
        self.not_begun().or_else(|| self.device.refusal())
    }

    /// Why nothing can be changed now, if that is so.
    fn refusal(&self) -> Option<SessionError> {
        self.absence().or_else(|| self.storage.refusal())
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
            Control::Points(change, reply) => self.change_points(key, change, reply),
            Control::Wake => self.wake(key),
            Control::EndStep(number, reply) => self.end_step(key, number, reply),
        }
    }

    /// A session, wherever its snow is.
    pub(crate) fn session(&self, key: u64) -> Option<&Arc<Outlet>> {
        let simulated = self.simulations.get(&key).map(|simulation| &simulation.session);
        let coming = || self.coming.get(&key).map(Coming::session);
        simulated.or_else(|| self.hibernating.get(&key)).or_else(coming)
    }

    /// Begins a session that there is room for.
    pub(crate) fn begin_session(&mut self, creation: Creation, room: Room) {
        let Creation { session, saved, done, reply } = creation;
        let Room { slot, object_rows, units } = room;
        let key = session.key;
        let mut anchor = Anchor { adapter: self.adapter, ..Anchor::default() };
        anchor.set_seq(self.round, session.epochs.first_seq());
        let identity = Arc::new(session.identity());
        let (origin, epochs) = (session.origin.clone(), session.epochs.clone());
        let now = self.now.instant;
        let log = Log::created(identity, origin, epochs, anchor, done, now);
        let mut simulation = Simulation::new(session, slot, self.frame, log, object_rows);
        simulation.portions.furnish(units);
        self.simulations.insert(key, simulation);
        self.guard(key, |simulation| {
            simulation.begin(saved.as_deref());
            simulation.next.replies.push(Reply::Created(reply));
        });
        self.review(key);
    }

    /// Puts a request into the inbox of its session, and wakes that.
    pub(crate) fn post(&mut self, key: u64, request: Request) {
        if self.session(key).is_none() {
            request.refuse(&gone());
            return;
        }
        let simulation = self.simulations.get(&key);
        if let Some(why) = simulation.and_then(|simulation| simulation.conflict(&request)) {
            request.refuse(&why);
            return;
        }
        self.mail.entry(key).or_default().push(request);
        self.wake(key);
    }

    /// Has sessions take in what waits for them, as far as they can.
    pub(crate) fn drain_mail(&mut self) {
        let refusal = self.storage.refusal();
        let (frame, most) = (self.frame, self.config.limits.colliders_per_session);
        let keys: Vec<u64> = self.mail.keys().copied().collect();
        for key in keys {
            if !self.is_at_work(key) {
                continue;
            }
            let Some(mut inbox) = self.mail.remove(&key) else { continue };
            self.guard(key, |simulation: &mut Simulation| {
                simulation.catch_up(frame);
                simulation.drain(&mut inbox, most, refusal.as_ref());
            });
            if !inbox.is_empty() {
                self.mail.insert(key, inbox);
            }
            self.review(key);
        }
    }

    /// Whether anything waits that a coming frame may take in.
    pub(crate) fn has_mail(&self) -> bool {
        let takes = |key, inbox| self.simulations.get(key).is_some_and(|sim| sim.takes(inbox));
        self.mail.iter().any(|(key, inbox)| self.is_at_work(*key) && takes(key, inbox))
    }

    /// Tells everybody who waits for a session why there is no answer.
    pub(crate) fn refuse_mail(&mut self, key: u64, why: &SessionError) {
        if let Some(inbox) = self.mail.remove(&key) {
            inbox.refuse(why);
        }
    }

    fn is_at_work(&self, key: u64) -> bool {
        self.simulations.contains_key(&key)
            && !self.coming.contains_key(&key)
            && !self.fallen.contains(&key)
            && !self.is_leaving(key)
    }

    /// Gives a session other tokens, once that is durable.
    fn set_tokens(&mut self, session: Arc<Outlet>, tokens: TokenHashes, reply: Answer<()>) {
        if let Some(why) = self.storage.refusal() {
            reply.refuse(&why);
            return;
        }
        let identity = Arc::new(Identity { tokens, ..session.identity() });
        self.submit_parts(session.key, vec![Part::Identity(identity)], Some(reply));
    }

    /// Ends a step at the tick it has reached: the one of a number, also before it has begun, or the one under way.
    fn end_step(&mut self, key: u64, number: Option<u64>, reply: Answer<Receipted<()>>) {
        if let (Some(number), Some(inbox)) = (number, self.mail.get_mut(&key)) {
            inbox.forget_step(number);
        }
        let steps = self.simulations.get(&key).is_some_and(|it| it.is_stepping(number));
        if !steps {
            reply.refuse(&SessionError::Conflict("no step of the session is under way".to_owned()));
            return;
        }
        self.guard(key, |simulation| {
            simulation.end_step();
            simulation.next.replies.push(Reply::Done(reply));
        });
        self.review(key);
    }

    /// Unlocks a session, once that is durable.
    fn unlock(&mut self, key: u64, reply: Answer<()>) {
        match self.storage.refusal() {
            Some(why) => reply.refuse(&why),
            None => self.submit_parts(key, vec![Part::Lock(None)], Some(reply)),
        }
    }

    /// Takes a session out of the world. Waiting requests are refused with `why`.
    pub(crate) fn remove(&mut self, key: u64, why: &SessionError) {
        let Some(simulation) = self.simulations.remove(&key) else { return };
        if self.checkpointing == Some(key) {
            self.checkpointing = None;
        }
        self.free(simulation.slot);
        let session = simulation.session.clone();
        self.refuse_mail(key, why);
        self.forget(key, &session);
        simulation.refuse_all(why);
    }
}

pub(crate) fn gone() -> SessionError {
    SessionError::NotFound { kind: "session", id: "deleted meanwhile".to_owned() }
}
