//! Changes, taken into the next frame.

use super::answer::Answer;
use super::apply::Disturbed;
use super::change::{Applied, Change};
use super::command::{Command, Decision};
use super::error::SessionError;
use super::keyed::Once;
use super::orders::Reply;
use super::receipt::Receipted;
use super::simulation::Simulation;

impl Simulation {
    /// Takes a change into the next frame, or refuses it whole.
    pub(super) fn change(
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
    pub(super) fn repeat(&mut self, command: &Command) {
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
    pub(super) fn carry_out(&mut self, command: &Command) {
        let Disturbed { tiles, all } = self.state.apply(command, &mut self.next);
        if let Some(tiles) = tiles {
            self.disturb(tiles);
        }
        if all {
            self.wake();
        }
    }
}
