//! The beginning of a life of the server.

use crate::session::error::SessionError;
use crate::session::message::Message;

use super::back::Coming;
use super::engine::Engine;

/// How far it is written where this life of the server begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Beginning {
    Unwritten,
    /// The journal has it.
    HandedOver,
    OnDisk,
}

impl Engine {
    /// Writes where this life begins, and whether that is on disk: seqs that anybody is told from here on are
    /// never given out again, nor is the time since the last heartbeat ever counted.
    pub(super) fn has_begun(&mut self) -> bool {
        if self.beginning == Beginning::Unwritten {
            let begun = self.coming.values_mut().map(Coming::begin).collect();
            self.begin_record(begun);
            self.beginning = Beginning::HandedOver;
        }
        // What could not be written is written as soon as the store can be.
        if self.beginning == Beginning::HandedOver && self.storage.is_settled() {
            self.beginning = Beginning::OnDisk;
        }
        self.beginning == Beginning::OnDisk
    }

    /// Refuses what is asked before this life has begun. False means that it was told to stop.
    pub(super) fn turn_away(&mut self, first: Option<Message>) -> bool {
        let why = SessionError::Unavailable(
            "sessions come back as soon as the data directory can be written to".to_owned(),
        );
        let waiting = std::iter::from_fn(|| self.inbox.try_recv().ok());
        for message in first.into_iter().chain(waiting) {
            if let Message::Stop(until) = message {
                self.stop = Some(until);
                return false;
            }
            message.refuse(&why);
        }
        true
    }
}
