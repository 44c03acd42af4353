//! Looking into a store, without a server or beside one.

use std::collections::BTreeMap;

use firn_protocol::VerifyReply;

use crate::core::record::{Fold, Identity, Stored};
use crate::core::session::{Limits, SessionError};
use crate::core::snapshot::Snapshot;
use crate::journal::assemble::parse;
use crate::journal::{Assembled, assemble, migrate};
use crate::store::{
    Content, Damage, Flaw, Format, Kind, Loaded, Moment, Row, Store, StoreError, Verified,
};

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
    /// Changes since its checkpoint, which a start makes again.
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
    Ok(report(rows, format, damage))
}

/// The same, and looks at every row where it lies; see [`Moment::verify`].
///
/// # Errors
/// Where it can't be read at all.
pub fn verify_store(store: &mut dyn Store) -> Result<VerifyReply, StoreError> {
    let Loaded { rows, format, damage, .. } = store.load()?;
    if damage.is_none() {
        return verify(&store.moment()?);
    }
    let count = rows.len() as u64;
    let bytes = rows.values().map(|content| content.bytes.len() as u64).sum();
    Ok(reply(report(rows, format, damage), Vec::new(), [count, bytes, 0]))
}

/// Reads all of a moment, as a start would, and every row where it lies.
///
/// # Errors
/// Where it can't be read at all.
pub fn verify(moment: &Moment) -> Result<VerifyReply, StoreError> {
    let Verified { rows, format, flaws, count, bytes, file_bytes } = moment.verify()?;
    let name = |session| {
        let row = Row { session, kind: Kind::Identity, number: 0 };
        let identity: Identity = parse(&rows.get(&row)?.bytes)?;
        Some(identity.id)
    };
    let whose = |Row { session, kind, number }: Row| match (session, name(session)) {
        (u64::MAX, _) => format!("the store's own row {kind:?}"),
        (_, Some(id)) => format!("the session '{id}': the row {kind:?} {number}"),
        (key, None) => format!("a session without a name (key {key}): the row {kind:?} {number}"),
    };
    let damage = flaws.into_iter().map(|Flaw { row, what }| match row {
        Some(row) => format!("{}: {what}", whose(row)),
        None => what,
    });
    let damage = damage.collect();
    Ok(reply(report(rows, format, None), damage, [count, bytes, file_bytes]))
}

fn reply(report: StoreReport, mut damage: Vec<String>, counts: [u64; 3]) -> VerifyReply {
    damage.extend(report.damage);
    let [rows, bytes, file_bytes] = counts;
    let (sessions, broken) = (report.sessions.len() as u64, report.broken);
    let sound = broken.is_empty() && damage.is_empty();
    VerifyReply { sound, sessions, broken, damage, rows, bytes, file_bytes }
}

/// What some rows come to.
fn report(rows: BTreeMap<Row, Content>, format: Format, damage: Option<Damage>) -> StoreReport {
    let (rows, mut broken) =
        if format == Format::First { migrate(rows) } else { (rows, Vec::new()) };
    let points = read_points(&rows);
    let Assembled { sessions, broken: parted, heartbeat } = assemble(rows);
    broken.extend(parted);
    let mut whole = Vec::with_capacity(sessions.len());
    for (key, stored) in sessions {
        let id = stored.identity.id.clone();
        for point in stored.points.iter() {
            let missing = || Err("it is missing".to_owned());
            let read = points.get(&(key, point.number)).cloned().unwrap_or_else(missing);
            if let Err(why) = read {
                broken
                    .push(format!("the session '{id}': its restore point '{}': {why}", point.name));
            }
        }
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
    broken.extend(missing.map(|key| format!("a session that was not found (key {key})")));
    let damage = damage.map(|damage| damage.what);
    StoreReport { format, sessions: whole, broken, damage }
}

/// Which restore points can be read, by session and number. Those of which only the name was read count as such.
fn read_points(rows: &BTreeMap<Row, Content>) -> BTreeMap<(u64, u64), Result<(), String>> {
    let points = rows.iter().filter(|(row, _)| row.kind == Kind::Point);
    let read = |bytes: &[u8]| match bytes {
        [] => Ok(()),
        bytes => Snapshot::decode(bytes, &Limits::NONE).map(drop).map_err(|why| why.to_string()),
    };
    points.map(|(row, content)| ((row.session, row.number), read(&content.bytes))).collect()
}

/// Reads all of a session.
fn read(stored: &Stored) -> Result<(), SessionError> {
    if let Some(checkpoint) = &stored.checkpoint {
        Snapshot::decode(&checkpoint.snapshot, &Limits::NONE)?;
    }
    Fold::of(stored).map(drop)
}
