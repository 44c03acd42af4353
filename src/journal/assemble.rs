//! Rows, as they are found at the start, put together to sessions.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::Arc;

use serde::de::DeserializeOwned;

use crate::core::record::{
    Anchor, Checkpoint, Done, Entry, Epochs, Head, Heartbeat, Identity, Lock, RestorePoints,
    Stored, bytes_of,
};
use crate::journal::rows::HEARTBEAT;
use crate::store::{Content, Kind, Row};

/// What rows are put together to.
pub(crate) struct Assembled {
    pub sessions: BTreeMap<u64, Stored>,
    /// What is missing of each session that is not whole.
    pub broken: Vec<String>,
    /// How far the world has come.
    pub heartbeat: Heartbeat,
}

/// Puts rows together.
pub(crate) fn assemble(mut rows: BTreeMap<Row, Content>) -> Assembled {
    let heartbeat = rows.remove(&HEARTBEAT);
    let (sessions, broken) = by_session(rows);
    let heartbeat = heartbeat.and_then(|content| parse::<Heartbeat>(&content.bytes));
    // A damaged file may have lost it, or hold an older one.
    let mut heartbeat = heartbeat.unwrap_or_default();
    let frames = sessions.values().map(|stored| stored.anchor.frame);
    heartbeat.frame = frames.fold(heartbeat.frame, u64::max);
    Assembled { sessions, broken, heartbeat }
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
    let head = one(Kind::Head).ok_or_else(|| missing("how far it had come is not known"))?;
    let counted = head.batch;
    if rows.iter().any(|(row, content)| row.kind == Kind::Entry && content.batch > counted) {
        // A batch with an entry counts it too.
        return Err(missing("how far it had come last is not known"));
    }
    let head: Head = parse(&head.bytes).ok_or_else(|| missing("its changes are not counted"))?;
    let anchor: Anchor = one(Kind::Anchor)
        .and_then(|content| parse(&content.bytes))
        .ok_or_else(|| missing("how far its time had come is not known"))?;
    let epochs: Epochs = one(Kind::Epochs)
        .and_then(|content| parse(&content.bytes))
        .ok_or_else(|| missing("its epochs are not known"))?;
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
        // Left over in a damaged file: replaced by the checkpoint, or undone before they were counted.
        let undone = row.number >= head.next && content.batch < counted;
        if row.kind != Kind::Entry || row.number < base || undone {
            continue;
        }
        let entry: Entry = parse(&content.bytes)
            .filter(|_| row.number == base + entries.len() as u64)
            .ok_or_else(|| missing("changes are missing from its journal"))?;
        entries.push_back(Arc::new(entry));
    }
    if base + (entries.len() as u64) < head.next {
        return Err(missing("the last changes are missing from its journal"));
    }
    let done = all(Kind::Answer).filter_map(|content| parse::<Done>(&content.bytes));
    let mut done: Vec<Arc<Done>> = done.map(Arc::new).collect();
    done.sort_by_key(|done| done.at());
    let done = VecDeque::from(done);
    let points = one(Kind::Points).and_then(|content| parse::<RestorePoints>(&content.bytes));
    let points = points.unwrap_or_default();
    let kept: Vec<u64> = points.numbers().collect();
    let found = rows.iter().filter(|(row, _)| row.kind == Kind::Point).map(|(row, _)| row.number);
    let gone_points = found.filter(|number| !kept.contains(number)).collect();
    Ok(Stored {
        identity: Arc::new(identity),
        origin: one(Kind::Origin).map(|content| content.bytes.clone().into()),
        checkpoint: checkpoint.map(Arc::new),
        entry_bytes: bytes_of(&entries),
        entries,
        anchor,
        epochs,
        done,
        lock: one(Kind::Lock).map(|content| Lock::read(&content.bytes)),
        points: Arc::new(points),
        gone_points,
    })
}

/// What a row holds; none where it is something else.
pub(super) fn parse<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    serde_json::from_slice(bytes).ok()
}
