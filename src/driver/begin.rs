//! The beginning of a life of the server: sessions that outlived the last one are made again.

use std::collections::BTreeMap;

use firn_engine::frame::DeviceInfo;
use tracing::{info, warn};

use crate::core::back::Coming;
use crate::core::begin::begin_epoch;
use crate::core::record::{Heartbeat, Record, Stored};
use crate::machine;
use crate::session::handle::Session;
use crate::session::registry::Sessions;

/// A number that tells devices apart that may give other snow.
pub(crate) fn fingerprint(device: &DeviceInfo) -> u64 {
    let text = format!("{}\n{}\n{}", device.adapter, device.backend, env!("CARGO_PKG_VERSION"));
    let hash = blake3::hash(text.as_bytes());
    u64::from_le_bytes(*hash.as_bytes().first_chunk().expect("a hash has more bytes"))
}

/// Sessions that outlived the last stop, with mirrors that know of which seqs they are: each begins another
/// epoch.
pub(crate) fn bring_back(
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
        let mut first = begin_epoch(&mut stored, machine::ulid(), heartbeat, adapter);
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
        coming.insert(key, Coming::at_start(session.outlet.clone(), stored, first));
        sessions.names.expect(session);
    }
    (records, coming)
}
