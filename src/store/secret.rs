//! A secret of the store, in each of its tombstones. Clients send bytes that are stored as they are, and
//! may look like a tombstone wherever an index is not followed; but none knows the secret.

use std::collections::BTreeMap;

use crate::machine;

use super::roster::NOBODY;
use super::{Content, Kind, Row};

/// Its row.
pub(super) const ROW: Row = Row { session: NOBODY, kind: Kind::Secret, number: 0 };

/// Random bytes.
pub(super) type Secret = [u8; LENGTH];

/// How many.
pub(super) const LENGTH: usize = 16;

/// The secret of a store, where it has one already.
pub(super) fn of(rows: &BTreeMap<Row, Content>) -> Option<Secret> {
    rows.get(&ROW).and_then(|content| content.bytes[..].try_into().ok())
}

/// A new one.
///
/// # Errors
/// Where the operating system has no random numbers.
pub(super) fn new() -> Result<Secret, getrandom::Error> {
    let mut secret = [0; LENGTH];
    machine::fill(&mut secret).map(|()| secret)
}
