//! Changes that arrive in the middle of a run, and wait for its end: only then is the session between
//! two ticks again, and what is told, journaled and saved of it is of one moment.

use std::collections::VecDeque;
use std::fmt;

use super::error::SessionError;
use super::orders::{Answer, MOST_EDITS, refuse};
use super::simulation::Simulation;
use super::snapshot::Snapshot;

/// What is to be done with the session, or why it won't be.
type Act = Box<dyn FnOnce(Result<&mut Simulation, &SessionError>) + Send>;

/// Changes to one session that may wait; more are refused.
const MOST_HELD: usize = 1024;

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
        if self.held.count() >= MOST_HELD {
            let many = format!("{MOST_HELD} changes wait for the end of a long tick already");
            refuse(answer, &SessionError::Unavailable(many));
            return;
        }
        self.held.acts.push_back(Box::new(|simulation| match simulation {
            Ok(simulation) => act(simulation, answer),
            Err(why) => refuse(answer, why),
        }));
    }

    /// Makes a reset between two ticks. Only one may wait: each brings a whole snowpack along.
    pub(super) fn reset_between_ticks(&mut self, saved: Option<Box<Snapshot>>, answer: Answer<()>) {
        if self.step.is_some() || self.held.resets {
            let conflict = "the session is being stepped or reset; wait for that".to_owned();
            refuse(answer, &SessionError::Conflict(conflict));
            return;
        }
        self.between_ticks(answer, move |simulation, answer| {
            simulation.begin_reset(saved.as_deref(), answer);
        });
        self.held.resets = self.held.count() > 0;
    }

    /// Refuses the changes that have waited for the end of a run.
    pub(super) fn refuse_held(&mut self, why: &SessionError) {
        std::mem::take(&mut self.held).refuse(why);
    }

    /// Makes the changes that have waited for the end of a run: as many as one frame should carry.
    pub(super) fn release_held(&mut self) {
        while !self.portions.are_under_way()
            && self.next.edits.len() < MOST_EDITS
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
