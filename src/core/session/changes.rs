//! Changes, taken into the next frame.

use crate::core::record::Once;
use crate::core::session::answer::Answer;
use crate::core::session::apply::Disturbed;
use crate::core::session::change::{Applied, Change};
use crate::core::session::command::{Command, Decision};
use crate::core::session::error::SessionError;
use crate::core::session::orders::Reply;
use crate::core::session::receipt::Receipted;
use crate::core::session::simulation::Simulation;

impl Simulation {
    /// Takes a change into the next frame, or refuses it whole.
    pub(crate) fn change(
        &mut self,
        change: Change,
        once: Option<Once>,
        most_colliders: usize,
        answer: Answer<Receipted<Applied>>,
    ) {
        self.next.changes += change.entries();
        let tick = self.state.clock.tick();
        match self.decide(&change, most_colliders) {
            Ok(Decision { command, told }) => {
                self.carry_out(&command);
                self.log.record(tick, command);
                let edit = self.next.edits.len().saturating_sub(1);
                self.next.replies.push(Reply::Change { told, edit, once, answer });
            }
            Err(why) => answer.refuse(&why),
        }
    }

    fn decide(&mut self, change: &Change, most: usize) -> Result<Decision, SessionError> {
        let decision = self.state.decide(change, Some(most))?;
        let (less, more) = self.state.object_words(&decision.command);
        self.object_rows.try_take(self.object_rows.taken() - less + more)?;
        Ok(decision)
    }

    /// Takes a command into the next frame that was carried out before.
    pub(crate) fn repeat(&mut self, command: &Command) {
        if *command == Command::Reset {
            let origin = self.session.origin_snapshot();
            self.begin_anew(origin.as_ref());
        } else {
            let (less, more) = self.state.object_words(command);
            self.object_rows.take(self.object_rows.taken() - less + more);
            self.carry_out(command);
        }
    }

    /// Has the next frame carry out a command.
    pub(crate) fn carry_out(&mut self, command: &Command) {
        let Disturbed { tiles, all } = self.state.apply(command, &mut self.next);
        if let Some(tiles) = tiles {
            self.disturb(tiles);
        }
        if all {
            self.wake();
        }
    }
}
