//! What is made durable of sessions, as rows.

use crate::core::record::{Done, Head, Heartbeat, Part};
use crate::store::{Kind, Row, Write};

/// The row that says how far the world has come. Sessions have keys that are counted from 0.
pub(crate) const HEARTBEAT: Row = Row { session: u64::MAX, kind: Kind::Heartbeat, number: 0 };

/// What some parts of a session write.
pub(crate) fn write(session: u64, parts: &[Part], writes: &mut Vec<Write>) {
    let row = |kind, number| Row { session, kind, number };
    for part in parts {
        match part {
            Part::Create(identity, origin, epochs) => {
                writes.push(Write::Put(row(Kind::Epochs, 0), json(epochs)));
                writes.push(Write::Put(row(Kind::Identity, 0), json(&**identity)));
                writes.push(Write::Put(row(Kind::Head, 0), json(&Head { next: 0 })));
                if let Some(origin) = origin {
                    writes.push(Write::Put(row(Kind::Origin, 0), origin.to_vec()));
                }
            }
            Part::Identity(identity) => {
                writes.push(Write::Put(row(Kind::Identity, 0), json(&**identity)));
            }
            Part::Entry(number, entry) => {
                writes.push(Write::Put(row(Kind::Entry, *number), json(&**entry)));
                let head = Head { next: number + 1 };
                writes.push(Write::Put(row(Kind::Head, 0), json(&head)));
            }
            Part::Anchor(anchor) => writes.push(Write::Put(row(Kind::Anchor, 0), json(anchor))),
            Part::Epochs(epochs) => writes.push(Write::Put(row(Kind::Epochs, 0), json(epochs))),
            Part::Checkpoint(checkpoint) => {
                let before = checkpoint.base;
                writes.push(Write::Put(row(Kind::Checkpoint, 0), checkpoint.encode()));
                writes.push(Write::RemoveEntries { session, before });
            }
            Part::Reset(checkpoint) => {
                let before = checkpoint.base;
                writes.push(Write::Put(row(Kind::Checkpoint, 0), checkpoint.encode()));
                writes.push(Write::RemoveEntries { session, before });
                // An older checkpoint in a damaged file lacks what this has replaced.
                writes.push(Write::Put(row(Kind::Head, 0), json(&Head { next: before })));
            }
            Part::Done(done) => writes.push(Write::Put(row_of(session, done), json(&**done))),
            Part::Lock(lock) => writes.push(match lock {
                Some(lock) => Write::Put(row(Kind::Lock, 0), json(lock)),
                None => Write::Remove(row(Kind::Lock, 0)),
            }),
            Part::Points(points) => writes.push(Write::Put(row(Kind::Points, 0), json(&**points))),
            Part::Point(number, snapshot) => {
                writes.push(Write::Put(point_row(session, *number), snapshot.to_vec()));
            }
            Part::RemovePoints(numbers) => {
                let rows = numbers.iter().map(|number| point_row(session, *number));
                writes.extend(rows.map(Write::Remove));
            }
            Part::Anew(points) => {
                let kept = points.numbers().map(|number| point_row(session, number)).collect();
                writes.push(Write::RemoveOthers { session, kept });
            }
            Part::Delete => writes.push(Write::RemoveSession(session)),
        }
    }
}

/// The row of a restore point's snapshot.
pub(crate) fn point_row(session: u64, number: u64) -> Row {
    Row { session, kind: Kind::Point, number }
}

/// The row of what was done for a request with a key.
pub(crate) fn row_of(session: u64, done: &Done) -> Row {
    let (first, _) = done.key.split_first_chunk().expect("32 bytes");
    Row { session, kind: Kind::Answer, number: u64::from_be_bytes(*first) }
}

/// The row of a heartbeat.
pub(crate) fn beat(heartbeat: Heartbeat) -> Write {
    Write::Put(HEARTBEAT, json(&heartbeat))
}

pub(crate) fn json(value: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("what is journaled has string keys and finite numbers")
}
