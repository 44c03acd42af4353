//! The beginning of a life of the server: what outlived the last one begins another epoch, and is on its way
//! back.

use ulid::Ulid;

use crate::core::World;
use crate::core::back::Coming;
use crate::core::record::{Anchor, Exact, Heartbeat, Part, Stored};
use crate::core::session::SessionError;

/// How far it is written where this life of the server begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Beginning {
    Unwritten,
    /// The journal has it.
    HandedOver,
    OnDisk,
}

impl World {
    /// Writes where this life begins, and whether that is on disk: seqs that anybody is told from here on are
    /// never given out again, nor is the time since the last heartbeat ever counted.
    pub(crate) fn has_begun(&mut self) -> bool {
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

    /// Why nothing can be asked before this life has begun, if it has not.
    pub(crate) fn not_begun(&self) -> Option<SessionError> {
        (self.beginning != Beginning::OnDisk).then(|| {
            SessionError::Unavailable(
                "sessions come back as soon as the data directory can be written to".to_owned(),
            )
        })
    }
}

/// Begins another epoch of a session that outlived the last stop. Returns what has to be written of that.
pub(crate) fn begin_epoch(
    stored: &mut Stored,
    name: Ulid,
    heartbeat: Heartbeat,
    adapter: u64,
) -> Vec<Part> {
    let newest_entry = stored.entries.back().map_or(0, |entry| entry.seq);
    let saved = stored.checkpoint.as_ref().map_or(0, |checkpoint| checkpoint.seq);
    let mut durable = stored.anchor.durable(heartbeat, newest_entry).max(saved);
    // What was migrated from the first format does not say on which one it was.
    if ![adapter, 0].contains(&stored.anchor.adapter) {
        // What has happened since may come out otherwise there.
        durable = durable.min(saved);
        stored.epochs.bound(saved);
    }
    stored.epochs.begin(name, durable);
    let first = stored.epochs.first_seq();
    let (tick, exact) = (stored.tick_at(heartbeat.frame), Exact::Stands(first));
    let mut anchor = Anchor { tick, frame: heartbeat.frame, rate: 0.0, offset: 0, exact, adapter };
    anchor.set_seq(heartbeat.round, first);
    stored.anchor = anchor;
    vec![Part::Epochs(stored.epochs.clone()), Part::Anchor(anchor)]
}
