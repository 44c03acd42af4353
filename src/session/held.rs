//! Changes that wait: for the end of work that takes several frames, because only then is the session
//! between two ticks again, and what is told, journaled and saved of it is of one moment; or for the next
//! frame, because this one has as many as it should carry.

use std::collections::VecDeque;
use std::fmt;

use super::answer::Answer;
use super::error::SessionError;
use super::orders::MOST_CHANGES;
use super::simulation::Simulation;
use super::snapshot::Snapshot;

/// What is to be done with the session, or why it won't be.
type Act = Box<dyn FnOnce(Result<&mut Simulation, &SessionError>) + Send>;

/// Changes that wait, the oldest first.
#[derive(Default)]
pub(super) struct Held {
    acts: VecDeque<Act>,
    /// A reset is among them.
    resets: bool,
}

impl Held {
    /// How many wait.
    pub fn count(&self) -> usize {
        self.acts.len()
    }

    /// Tells everybody who waits why there is no answer.
    pub fn refuse(self, why: &SessionError) {
        self.acts.into_iter().for_each(|act| act(Err(why)));
    }
}

impl Simulation {
    /// Makes a change between two ticks, where the coming frame carries more of them: now or later, in the
    /// order in which they have arrived.
    pub(super) fn between_ticks<T: Send + 'static>(
        &mut self,
        answer: Answer<T>,
        act: impl FnOnce(&mut Simulation, Answer<T>) + Send + 'static,
    ) {
        if self.takes_changes() && self.held.count() == 0 {
            act(self, answer);
            return;
        }
        self.held.acts.push_back(Box::new(|simulation| match simulation {
            Ok(simulation) => act(simulation, answer),
            Err(why) => answer.refuse(why),
        }));
    }

    /// Makes a reset between two ticks. Only one may wait: each brings a whole snowpack along.
    pub(super) fn reset_between_ticks(&mut self, saved: Option<Box<Snapshot>>, answer: Answer<()>) {
        if self.step.is_some() || self.held.resets {
            let conflict = "the session is being stepped or reset; wait for that".to_owned();
            answer.refuse(&SessionError::Conflict(conflict));
            return;
        }
        self.between_ticks(answer, move |simulation, answer| {
            simulation.begin_reset(saved.as_deref(), answer);
        });
        self.held.resets = self.held.count() > 0;
    }

    /// Whether a change can be made now.
    fn takes_changes(&self) -> bool {
        !self.portions.are_under_way() && self.next.changes < MOST_CHANGES
    }

    /// Makes the changes that wait, or refuses them where changes are refused.
    pub(super) fn let_go_held(&mut self, refusal: Option<&SessionError>) {
        match refusal {
            Some(why) => std::mem::take(&mut self.held).refuse(why),
            None => self.release_held(),
        }
    }

    /// Makes the changes that wait, as many as the coming frame should carry.
    pub(super) fn release_held(&mut self) {
        while self.takes_changes()
            && let Some(act) = self.held.acts.pop_front()
        {
            act(Ok(self));
        }
        self.held.resets &= self.held.count() > 0;
    }
}

impl fmt::Debug for Held {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Held").field(&self.count()).finish()
    }
}
