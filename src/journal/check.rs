//! Looking into a store without a server.

use crate::core::record::{Fold, Stored};
use crate::core::session::error::SessionError;
use crate::core::session::spec::Limits;
use crate::core::snapshot::Snapshot;
use crate::journal::{Assembled, assemble, migrate};
use crate::store::{Format, Loaded, Store, StoreError};

/// What a store holds.
#[derive(Debug)]
pub struct StoreReport {
    /// The format that it is in.
    pub format: Format,
    /// Each session that can be brought back, in the order in which they were made.
    pub sessions: Vec<StoredSession>,
    /// What is wrong with each session that can't be.
    pub broken: Vec<String>,
    /// What is wrong with the file.
    pub damage: Option<String>,
}

/// A session that can be brought back.
#[derive(Debug)]
pub struct StoredSession {
    /// Its name.
    pub id: String,
    /// Tick that it comes back at.
    pub tick: u64,
    /// Changes that it goes through again after its checkpoint.
    pub changes: usize,
    /// Whether it takes no changes until an administrator unlocks it.
    pub locked: bool,
}

impl StoreReport {
    /// Whether nothing is wrong.
    pub fn is_sound(&self) -> bool {
        self.broken.is_empty() && self.damage.is_none()
    }
}

/// Reads all that a store holds, as a start would, and writes nothing. What is of an earlier format is read as
/// a start would make it anew.
///
/// # Errors
/// Where it can't be read at all.
pub fn check_store(store: &mut dyn Store) -> Result<StoreReport, StoreError> {
    let Loaded { rows, format, damage, .. } = store.load()?;
    let (rows, mut broken) =
        if format == Format::First { migrate(rows) } else { (rows, Vec::new()) };
    let Assembled { sessions, broken: parted, heartbeat } = assemble(rows);
    broken.extend(parted);
    let mut whole = Vec::with_capacity(sessions.len());
    for stored in sessions.into_values() {
        let id = stored.identity.id.clone();
        match read(&stored) {
            Ok(()) => whole.push(StoredSession {
                id,
                tick: stored.tick_at(heartbeat.frame),
                changes: stored.entries.iter().map(|entry| entry.commands.len()).sum(),
                locked: stored.lock.is_some(),
            }),
            Err(why) => broken.push(format!("the session '{id}': {why}")),
        }
    }
    let missing = damage.iter().flat_map(|damage| &damage.missing);
    broken.extend(missing.map(|key| format!("a session of which nothing was found (key {key})")));
    let damage = damage.map(|damage| damage.what);
    Ok(StoreReport { format, sessions: whole, broken, damage })
}

/// Reads all of a session.
fn read(stored: &Stored) -> Result<(), SessionError> {
    if let Some(checkpoint) = &stored.checkpoint {
        Snapshot::decode(&checkpoint.snapshot, &Limits::NONE)?;
    }
    Fold::of(stored).map(drop)
}
