//! What is stored of a session, folded to the host's half of it: no device is needed for that.

use crate::core::record::{Identity, Stored};
use crate::core::session::{Change, Command, Orders, SessionError, SessionState};
use crate::core::snapshot::Snapshot;

/// The host's half of a session, at some point of its journal.
pub(crate) struct Fold {
    /// As it was created.
    origin: SessionState,
    state: SessionState,
}

impl Fold {
    /// A session at its checkpoint, or as it was created.
    ///
    /// # Errors
    /// Where one of them can't be read.
    pub fn begin(
        identity: &Identity,
        origin: Option<&[u8]>,
        checkpoint: Option<&[u8]>,
    ) -> Result<Fold, SessionError> {
        let begin = || SessionState::new(&identity.spec);
        let origin = origin.map(Snapshot::state).transpose()?.unwrap_or_else(begin);
        let state = checkpoint.map(Snapshot::state).transpose()?;
        Ok(Fold { state: state.unwrap_or_else(|| origin.clone()), origin })
    }

    /// A session at the end of its journal.
    ///
    /// # Errors
    /// Where what is stored can't be read.
    pub fn of(stored: &Stored) -> Result<Fold, SessionError> {
        let checkpoint = stored.checkpoint.as_ref().map(|checkpoint| &checkpoint.snapshot[..]);
        let mut fold = Fold::begin(&stored.identity, stored.origin.as_deref(), checkpoint)?;
        for entry in &stored.entries {
            fold.pass(entry.tick);
            entry.commands.iter().for_each(|command| fold.apply(command));
        }
        Ok(fold)
    }

    /// Goes on to a tick.
    pub fn pass(&mut self, tick: u64) {
        self.state.clock.pass(tick.saturating_sub(self.state.clock.tick()));
    }

    /// Applies a command.
    pub fn apply(&mut self, command: &Command) {
        match command {
            Command::Reset => self.state = self.origin.clone(),
            command => drop(self.state.apply(command, &mut Orders::default())),
        }
    }

    /// What a change does that was allowed before.
    ///
    /// # Errors
    /// Where it can't be done.
    pub fn decide(&self, change: &Change) -> Result<Command, SessionError> {
        Ok(self.state.decide(change, None)?.command)
    }
}
