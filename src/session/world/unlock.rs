//! Locked sessions: they come back so from a damaged file, until an administrator unlocks them.

use std::sync::Arc;

use tracing::info;

use crate::session::answer::Answer;
use crate::session::handle::Session;
use crate::session::journal::{Ack, Record, Submission};

use super::engine::Engine;

impl Engine {
    /// Unlocks a session, once that is durable.
    pub(super) fn unlock(&mut self, session: Arc<Session>, reply: Answer<()>) {
        if let Some(why) = self.journal.refusal() {
            reply.refuse(&why);
            return;
        }
        let key = session.key;
        let generation = self.generation(key);
        let ack: Ack = Box::new(move |durable| {
            if durable.is_ok() {
                info!(session = session.id, "unlocked");
                session.set_locked(false);
            }
            reply.give(durable);
        });
        let records = vec![Record::Lock(None)];
        self.journal.add(Submission { key, generation, records, acks: vec![ack] });
        self.journal.send();
    }
}
