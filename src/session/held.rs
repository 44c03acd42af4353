//! Changes that arrive in the middle of a run, and wait for its end: only then is the session between
//! two ticks again, and what is told, journaled and saved of it is of one moment.

use std::collections::VecDeque;
use std::fmt;

use super::error::SessionError;
use super::orders::{Answer, MOST_EDITS, refuse};
use super::simulation::Simulation;

/// What is to be done with the session, or why it won't be.
type Act = Box<dyn FnOnce(Result<&mut Simulation, &SessionError>) + Send>;

/// Changes that wait, the oldest first.
#[derive(Default)]
pub(super) struct Held(VecDeque<Act>);

impl Held {
    /// How many wait.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// Tells everybody who waits why there is no answer.
    pub fn refuse(self, why: &SessionError) {
        self.0.into_iter().for_each(|act| act(Err(why)));
    }
}

impl Simulation {
    /// Makes a change between two ticks: now, or at the end of the run under way. Changes are made
    /// in the order in which they have arrived.
    pub(super) fn between_ticks<T: Send + 'static>(
        &mut self,
        answer: Answer<T>,
        act: impl FnOnce(&mut Simulation, Answer<T>) + Send + 'static,
    ) {
        if !self.portions.are_under_way() && self.held.count() == 0 {
            act(self, answer);
            return;
        }
        self.held.0.push_back(Box::new(|simulation| match simulation {
            Ok(simulation) => act(simulation, answer),
            Err(why) => refuse(answer, why),
        }));
    }

    /// Makes the changes that have waited for the end of a run: as many as one frame should carry.
    pub(super) fn release_held(&mut self) {
        while !self.portions.are_under_way()
            && self.next.edits.len() < MOST_EDITS
            && let Some(act) = self.held.0.pop_front()
        {
            act(Ok(self));
        }
    }
}

impl fmt::Debug for Held {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Held").field(&self.count()).finish()
    }
}
