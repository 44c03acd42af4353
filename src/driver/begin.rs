//! The beginning of a life of the server: sessions that outlived the last one are made again.

use std::collections::BTreeMap;

use firn_engine::frame::DeviceInfo;
use tracing::{info, warn};

use crate::core::back::Coming;
use crate::core::begin::begin_epoch;
use crate::core::record::{Heartbeat, Part, Record, Stored};
use crate::driver::{Durability, StartError};
use crate::journal::{Assembled, assemble, migrate};
use crate::machine;
use crate::session::handle::Session;
use crate::session::registry::Sessions;
use crate::store::{Damage, Format, Loaded, StoreClock};

/// What outlived the last server.
pub(crate) struct Outlived {
    pub sessions: BTreeMap<u64, Stored>,
    /// How far it had come.
    pub heartbeat: Heartbeat,
    /// The lowest key that no session has had.
    pub next_key: u64,
    /// The store's own clock.
    pub clock: StoreClock,
    /// Sessions that are lost.
    pub lost: usize,
    /// Whether the store was damaged.
    pub damaged: bool,
}

/// Reads the store. What is damaged, or of the first format, is put into a new file.
///
/// # Errors
/// Where it can't be read, or all is lost that it held.
pub(crate) fn read_store(durability: &mut Durability) -> Result<Outlived, StartError> {
    let Loaded { rows, next_key, clock, format, damage } = durability.store.load()?;
    let (rows, mut broken) = match format {
        Format::First => migrate(rows),
        Format::Present => (rows, Vec::new()),
    };
    // What is in the file is not to be written into.
    let replacement = (format == Format::First || damage.is_some()).then(|| rows.clone());
    let Assembled { sessions, broken: parted, heartbeat } = assemble(rows);
    broken.extend(parted);
    let lost = tell_of_damage(damage.as_ref(), &broken, &sessions, durability.accept_loss)?;
    if let Some(rows) = replacement {
        durability.store.take_over(&rows)?;
    }
    Ok(Outlived { sessions, heartbeat, next_key, clock, lost, damaged: damage.is_some() })
}

/// Tells of what is lost. Returns how many sessions are.
///
/// # Errors
/// [`StartError::Lost`] where that is everything, and is not accepted.
fn tell_of_damage(
    damage: Option<&Damage>,
    broken: &[String],
    stored: &BTreeMap<u64, Stored>,
    accepted: bool,
) -> Result<usize, StartError> {
    for what in broken {
        warn!("can't be brought back: {what}");
    }
    let Some(Damage { what, missing }) = damage else { return Ok(broken.len()) };
    for key in missing {
        warn!("can't be brought back: a session that was not found (key {key})");
    }
    if stored.is_empty() && !accepted {
        return Err(StartError::Lost(what.clone()));
    }
    warn!("the store: {what}; its newest changes may be missing");
    Ok(broken.len() + missing.len())
}

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
        if !stored.gone_points.is_empty() {
            first.push(Part::RemovePoints(std::mem::take(&mut stored.gone_points)));
        }
        session.set_points(stored.points.clone());
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
