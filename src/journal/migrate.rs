//! Rows of the first format, made those of the present one: no device is needed for that.

use std::collections::BTreeMap;

use firn_protocol::SessionSpec;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use tracing::{info, warn};
use ulid::Ulid;

use crate::core::record::{Anchor, Checkpoint, Entry, Epochs, Exact, Fold, Head, Identity, Weight};
use crate::core::session::{Change, Command, SessionError, TokenHashes};
use crate::journal::rows::json;
use crate::store::{Content, Kind, Row};

/// Who a session is, in the first format.
#[derive(Deserialize)]
struct FirstIdentity {
    id: String,
    epoch: String,
    created_at: String,
    #[serde(default)]
    owner: Option<String>,
    #[serde(flatten)]
    tokens: TokenHashes,
    spec: SessionSpec,
}

/// What happened to a session in one frame, in the first format.
#[derive(Deserialize)]
struct FirstEntry {
    tick: u64,
    events: Vec<FirstEvent>,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum FirstEvent {
    Change(Box<Change>),
    Reset,
}

/// How far a session has come, in the first format.
#[derive(Deserialize)]
struct FirstMark {
    tick: u64,
    seq: u64,
    next: u64,
    /// Seqs, first and last, whose states were lost.
    lost: Vec<(u64, u64)>,
    #[serde(default)]
    rest: Option<FirstRest>,
}

/// Where its ticks pass by themselves from some frame on.
#[derive(Deserialize)]
struct FirstRest {
    since: u64,
    tick_rate: f64,
}

/// Makes rows of the first format those of the present one; and says of each session that can't be read what
/// is wrong with it.
pub(crate) fn migrate(rows: BTreeMap<Row, Content>) -> (BTreeMap<Row, Content>, Vec<String>) {
    let (mut migrated, mut broken) = (BTreeMap::new(), Vec::new());
    let mut sessions: BTreeMap<u64, BTreeMap<Row, Content>> = BTreeMap::new();
    for (row, content) in rows {
        match row.kind {
            Kind::Heartbeat => drop(migrated.insert(row, content)),
            _ => drop(sessions.entry(row.session).or_default().insert(row, content)),
        }
    }
    let count = sessions.len();
    for (key, rows) in sessions {
        match migrate_session(key, &rows) {
            Ok(session) => migrated.extend(session),
            Err(why) => broken.push(format!("{} (key {key}): {why}", name(key, &rows))),
        }
    }
    info!("{} of {count} sessions of the format of Firn 0.1 were read", count - broken.len());
    (migrated, broken)
}

/// What a session is called, where that can be read.
fn name(session: u64, rows: &BTreeMap<Row, Content>) -> String {
    let identity = rows.get(&Row { session, kind: Kind::Identity, number: 0 });
    let identity = identity.and_then(|content| parse::<FirstIdentity>(content).ok());
    identity.map_or("a session without a name".to_owned(), |it| format!("the session '{}'", it.id))
}

fn migrate_session(
    session: u64,
    rows: &BTreeMap<Row, Content>,
) -> Result<BTreeMap<Row, Content>, SessionError> {
    let row = |kind| Row { session, kind, number: 0 };
    let one = |kind| rows.get(&row(kind));
    let missing = |what: &str| SessionError::Internal(format!("{what} is missing"));
    let identity = one(Kind::Identity).ok_or_else(|| missing("its name"))?;
    let first: FirstIdentity = parse(identity)?;
    let mark_row = one(Kind::Mark).ok_or_else(|| missing("how far it had come"))?;
    let mark: FirstMark = parse(mark_row)?;
    let name = Ulid::from_string(&first.epoch).unwrap_or_default();
    let id = first.id.clone();
    let own = Identity {
        sid: name,
        id: first.id,
        created_at: first.created_at,
        owner: first.owner,
        weight: Weight::default(),
        tokens: first.tokens,
        spec: first.spec,
    };
    let checkpoint = one(Kind::Checkpoint).and_then(|content| Checkpoint::decode(&content.bytes));
    let base = checkpoint.as_ref().map_or(0, |checkpoint| checkpoint.base);

    let mut migrated = BTreeMap::new();
    let mut put = |row: Row, batch: u64, bytes: Vec<u8>| {
        migrated.insert(row, Content { batch, bytes });
    };
    // What is known begins after what was lost last.
    let known = mark.lost.last().map_or(1, |(_, last)| last.saturating_add(1));
    put(row(Kind::Identity), identity.batch, json(&own));
    put(row(Kind::Epochs), identity.batch, json(&Epochs::first(name, known)));
    put(row(Kind::Head), mark_row.batch, json(&Head { next: mark.next }));
    let (frame, rate) = mark.rest.map_or((0, 0.0), |rest| (rest.since, rest.tick_rate));
    let (tick, exact) = (mark.tick, Exact::Stands(mark.seq));
    let anchor = Anchor { tick, frame, rate, offset: 0, exact, adapter: 0 };
    put(row(Kind::Anchor), mark_row.batch, json(&anchor));
    for (row, content) in rows {
        if matches!(row.kind, Kind::Origin | Kind::Checkpoint | Kind::Answer | Kind::Lock) {
            put(*row, content.batch, content.bytes.clone());
        }
    }
    let entries = rows.range(row(Kind::Entry)..=Row { number: u64::MAX, ..row(Kind::Entry) });
    let entries: Vec<_> = entries.filter(|(row, _)| row.number >= base).collect();
    if entries.is_empty() {
        return Ok(migrated);
    }
    let origin = one(Kind::Origin).map(|content| &content.bytes[..]);
    let snapshot = checkpoint.as_ref().map(|checkpoint| &checkpoint.snapshot[..]);
    let mut fold = Fold::begin(&own, origin, snapshot)?;
    for (row, content) in entries {
        let FirstEntry { tick, events } = parse(content)?;
        fold.pass(tick);
        let mut commands = Vec::with_capacity(events.len());
        for event in events {
            let command = match event {
                FirstEvent::Reset => Command::Reset,
                FirstEvent::Change(change) => match fold.decide(&let_snow_through(*change)) {
                    Ok(command) => spare_nothing(command),
                    Err(why) => {
                        warn!(session = id, "a change can't be repeated, and is left out: {why}");
                        continue;
                    }
                },
            };
            fold.apply(&command);
            commands.push(command);
        }
        // How they were published is not known any more.
        put(*row, content.batch, json(&Entry { tick, seq: 0, reached: tick, commands }));
    }
    Ok(migrated)
}

/// In the first format snow falls under objects.
fn let_snow_through(mut change: Change) -> Change {
    match &mut change {
        Change::CreateCollider(spec) | Change::PutCollider(spec) => spec.shelters = false,
        Change::Colliders(batch) => batch.put.iter_mut().for_each(|spec| spec.shelters = false),
        _ => {}
    }
    change
}

/// In the first format clearings clear under objects too.
fn spare_nothing(mut command: Command) -> Command {
    if let Command::Clear { spares, .. } = &mut command {
        *spares = false;
    }
    command
}

fn parse<T: DeserializeOwned>(content: &Content) -> Result<T, SessionError> {
    serde_json::from_slice(&content.bytes)
        .map_err(|error| SessionError::Internal(format!("a row can't be read: {error}")))
}
