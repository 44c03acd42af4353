//! The beginning of a life of the server: what outlived the last one begins another epoch, and is on its way
//! back.

use std::collections::BTreeMap;
use std::sync::Arc;

use firn_engine::frame::DeviceInfo;
use tracing::{info, warn};

use crate::machine;
use crate::session::error::SessionError;
use crate::session::handle::Session;
use crate::session::journal::{Anchor, Exact, Heartbeat, Part, Record, Stored};
use crate::session::message::Message;
use crate::session::registry::Sessions;

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

/// A number that tells devices apart that may give other snow.
pub(super) fn fingerprint(device: &DeviceInfo) -> u64 {
    let text = format!("{}\n{}\n{}", device.adapter, device.backend, env!("CARGO_PKG_VERSION"));
    let hash = blake3::hash(text.as_bytes());
    u64::from_le_bytes(*hash.as_bytes().first_chunk().expect("a hash has more bytes"))
}

/// Begins another epoch of a session that outlived the last stop. Returns what has to be written of that.
fn begin_epoch(stored: &mut Stored, heartbeat: Heartbeat, adapter: u64) -> Vec<Part> {
    let newest_entry = stored.entries.back().map_or(0, |entry| entry.seq);
    let saved = stored.checkpoint.as_ref().map_or(0, |checkpoint| checkpoint.seq);
    let mut durable = stored.anchor.durable(heartbeat, newest_entry).max(saved);
    // What was migrated from the first format does not say on which one it was.
    if ![adapter, 0].contains(&stored.anchor.adapter) {
        // What has happened since may come out otherwise there.
        durable = durable.min(saved);
        stored.epochs.bound(saved);
    }
    stored.epochs.begin(machine::ulid(), durable);
    let first = stored.epochs.first_seq();
    let (tick, exact) = (stored.tick_at(heartbeat.frame), Exact::Stands(first));
    let mut anchor = Anchor { tick, frame: heartbeat.frame, rate: 0.0, offset: 0, exact, adapter };
    anchor.set_seq(heartbeat.round, first);
    stored.anchor = anchor;
    vec![Part::Epochs(stored.epochs.clone()), Part::Anchor(anchor)]
}

/// Sessions that outlived the last stop, with mirrors that know of which seqs they are: each begins another
/// epoch.
pub(super) fn bring_back(
    sessions: &Sessions,
    stored: BTreeMap<u64, Stored>,
    heartbeat: Heartbeat,
    adapter: u64,
) -> (BTreeMap<u64, Record>, BTreeMap<u64, Coming>) {
    if !stored.is_empty() {
        info!("bringing back {} sessions", stored.len());
    }
    let mut coming = BTreeMap::new();
    let mut records = BTreeMap::new();
    for (key, mut stored) in stored {
        let mut first = begin_epoch(&mut stored, heartbeat, adapter);
        let identity = (*stored.identity).clone();
        let (origin, epochs) = (stored.origin.clone(), stored.epochs.clone());
        let made = Session::identified(sessions, key, identity, epochs, origin)
            .and_then(|session| Ok((session, stored.pause()?)));
        let (session, paused) = match made {
            Ok(made) => made,
            Err(why) => {
                let id = &stored.identity.id;
                warn!("session '{id}' stays stored and is not brought back: {why}");
                sessions.vitals().store.lost(1);
                continue;
            }
        };
        first.extend(paused);
        if stored.lock.is_some() {
            session.set_locked(true);
            warn!(
                "session '{}' may have been deleted, as the store was damaged or a deletion was cut off: \
                 it is paused and locked until an administrator unlocks or deletes it",
                session.id
            );
            sessions.vitals().store.note_revived();
        }
        let versions = stored.checkpoint.as_ref().map(|saved| &saved.versions[..]);
        session.go_on_from(stored.epochs.first_seq(), versions);
        stored.weigh();
        sessions.keyed.bring_back(key, &stored.done);
        records.insert(key, Record::of(stored.clone(), session.receipts.clone()));
        coming.insert(key, Coming::at_start(Arc::new(session), stored, first));
    }
    (records, coming)
}
