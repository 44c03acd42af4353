//! Rows, as they are found at the start, put together to sessions.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::Arc;

use serde::de::DeserializeOwned;

use crate::session::once::Done;
use crate::store::{Content, Kind, Row};

use super::record::{HEARTBEAT, Stored};
use super::weight::bytes_of;
use super::{Checkpoint, Entry, Heartbeat, Identity, Lock, Mark};

/// What rows are put together to.
pub(crate) struct Assembled {
    pub sessions: BTreeMap<u64, Stored>,
    /// What is missing of each session that is not whole.
    pub broken: Vec<String>,
    /// Frame that the world has come to.
    pub frame: u64,
}

/// Puts rows together.
pub(crate) fn assemble(mut rows: BTreeMap<Row, Content>) -> Assembled {
    let heartbeat = rows.remove(&HEARTBEAT);
    let (sessions, broken) = by_session(rows);
    let heartbeat = heartbeat.and_then(|content| parse::<Heartbeat>(&content.bytes));
    // A damaged file may have lost it, or hold an older one.
    let rests = sessions.values().filter_map(|stored| Some(stored.mark.rest?.since));
    let frame = rests.chain(heartbeat.map(|heartbeat| heartbeat.frame)).max().unwrap_or(0);
    Assembled { sessions, broken, frame }
}

/// Puts rows together to sessions; and says of each that is not whole what is missing.
fn by_session(rows: BTreeMap<Row, Content>) -> (BTreeMap<u64, Stored>, Vec<String>) {
    let mut by_session: BTreeMap<u64, Vec<(Row, Content)>> = BTreeMap::new();
    for (row, content) in rows {
        by_session.entry(row.session).or_default().push((row, content));
    }
    let mut names: HashMap<String, u64> = HashMap::new();
    let (mut whole, mut broken) = (BTreeMap::new(), Vec::new());
    for (key, rows) in by_session {
        match put_together(rows) {
            Ok(stored) => {
                // The newer of two sessions of one name has it.
                if let Some(older) = names.insert(stored.identity.id.clone(), key) {
                    whole.remove(&older);
                    let id = &stored.identity.id;
                    broken.push(format!("an older session '{id}' (key {older}): name taken"));
                }
                whole.insert(key, stored);
            }
            Err(why) => broken.push(format!("{why} (key {key})")),
        }
    }
    (whole, broken)
}

fn put_together(rows: Vec<(Row, Content)>) -> Result<Stored, String> {
    let all =
        |kind| rows.iter().filter(move |(row, _)| row.kind == kind).map(|(_, content)| content);
    let one = |kind| all(kind).next();
    let identity: Identity = one(Kind::Identity)
        .and_then(|content| parse(&content.bytes))
        .ok_or("a session without a name")?;
    let id = identity.id.clone();
    let missing = |what: &str| format!("the session '{id}': {what}");
    let mark = one(Kind::Mark).ok_or_else(|| missing("how far it had come is not known"))?;
    let marked = mark.batch;
    if rows.iter().any(|(row, content)| row.kind == Kind::Entry && content.batch > marked) {
        // A batch with an entry has a mark too.
        return Err(missing("how far it had come last is not known"));
    }
    let mark: Mark = parse(&mark.bytes).ok_or_else(|| missing("its mark can't be read"))?;
    let checkpoint = match one(Kind::Checkpoint) {
        None => None,
        Some(content) => Some(
            Checkpoint::decode(&content.bytes)
                .ok_or_else(|| missing("its checkpoint can't be read"))?,
        ),
    };
    let base = checkpoint.as_ref().map_or(0, |checkpoint| checkpoint.base);
    let mut entries = VecDeque::new();
    for (row, content) in &rows {
        // Left over in a damaged file: replaced by the checkpoint, or undone before the mark.
        let undone = row.number >= mark.next && content.batch < marked;
        if row.kind != Kind::Entry || row.number < base || undone {
            continue;
        }
        let entry: Entry = parse(&content.bytes)
            .filter(|_| row.number == base + entries.len() as u64)
            .ok_or_else(|| missing("changes are missing from its journal"))?;
        entries.push_back(Arc::new(entry));
    }
    if base + (entries.len() as u64) < mark.next {
        return Err(missing("the last changes are missing from its journal"));
    }
    let done = all(Kind::Answer).filter_map(|content| parse::<Done>(&content.bytes));
    let mut done: Vec<Arc<Done>> = done.map(Arc::new).collect();
    done.sort_by_key(|done| done.at_ms);
    let done = VecDeque::from(done);
    Ok(Stored {
        identity: Arc::new(identity),
        origin: one(Kind::Origin).map(|content| content.bytes.clone().into()),
        checkpoint: checkpoint.map(Arc::new),
        entry_bytes: bytes_of(&entries),
        entries,
        mark,
        done,
        lock: one(Kind::Lock).map(|content| Lock::read(&content.bytes)),
    })
}

fn parse<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    serde_json::from_slice(bytes).ok()
}
