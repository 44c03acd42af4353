//! What sessions are asked: it waits in their inboxes, wherever their snow is, and is taken in between two
//! frames.

use crate::core::World;
use crate::core::inputs::gone;
use crate::core::session::error::SessionError;
use crate::core::session::inbox::Request;
use crate::core::session::simulation::Simulation;

impl World {
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
}
