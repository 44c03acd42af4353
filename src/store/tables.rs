//! The tables of the file, and how a batch changes them.

use std::fmt;

use redb::{Database, Durability, StorageError, Table, TableDefinition, WriteTransaction};

use super::frame::{self, NAME};
use super::roster::{NOBODY, is_kept_twice};
use super::{Content, Format, Kind, Row, StoreError, Write, refusal};

/// Every row.
pub(super) const ROWS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("rows2");

/// A second copy of rows that are kept twice, on other pages.
pub(super) const HEADS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("heads2");

/// Rows of the first format.
pub(super) const FIRST_ROWS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("rows");

/// The row of the format.
pub(super) const FORMAT: Row = Row { session: NOBODY, kind: Kind::Format, number: 0 };

/// The row of the store's clock.
pub(super) const CLOCK: Row = Row { session: NOBODY, kind: Kind::Clock, number: 0 };

/// Begins a batch, to be written whole or not at all.
pub(super) fn begin(database: &Database) -> Result<WriteTransaction, redb::Error> {
    let mut transaction = database.begin_write()?;
    transaction.set_durability(Durability::Immediate)?;
    // With one phase a damaged commit is taken for one that a crash cut off, and left out.
    transaction.set_two_phase_commit(true);
    Ok(transaction)
}

/// Says what the rows mean, and keeps programs away that would not understand them.
pub(super) fn stamp(transaction: &WriteTransaction, batch: u64) -> Result<(), redb::Error> {
    let number = Format::Present.number().to_le_bytes();
    transaction.open_table(refusal::ROWS)?;
    let mut rows = transaction.open_table(ROWS)?;
    rows.insert(&FORMAT.name()[..], &frame::seal(&FORMAT, batch, &number)[..])?;
    Ok(())
}

/// Whether this program understands a format.
pub(super) fn check_format(content: &Content) -> Result<(), StoreError> {
    let number = content.bytes.as_slice().try_into().map(u32::from_le_bytes);
    let known = Format::Present.number();
    match number {
        Ok(number) if number <= known => Ok(()),
        _ => Err(failed(format!(
            "the store has format {number}, and this is Firn {}, which knows formats up to {known}: a newer \
             version has written it, and only such a one reads it",
            env!("CARGO_PKG_VERSION"),
            number = number.unwrap_or(u32::MAX),
        ))),
    }
}

/// Writes sealed rows into an empty database, as they were.
///
/// # Errors
/// Where one is not to be had, or can't be written.
pub(super) fn put_all(
    database: &Database,
    rows: impl Iterator<Item = Result<(Row, Vec<u8>), StoreError>>,
    batch: u64,
) -> Result<(), StoreError> {
    let transaction = begin(database).map_err(failed)?;
    stamp(&transaction, batch).map_err(failed)?;
    {
        let mut table = transaction.open_table(ROWS).map_err(failed)?;
        let mut twice = transaction.open_table(HEADS).map_err(failed)?;
        for row in rows {
            let (row, sealed) = row?;
            table.insert(&row.name()[..], &sealed[..]).map_err(failed)?;
            if is_kept_twice(row.kind) {
                twice.insert(&row.name()[..], &sealed[..]).map_err(failed)?;
            }
        }
    }
    transaction.commit().map_err(failed)
}

pub(super) fn is_written_twice(write: &Write) -> bool {
    match write {
        Write::Put(row, _) | Write::Remove(row) => is_kept_twice(row.kind),
        Write::RemoveEntries { .. } => false,
        Write::RemoveOthers { .. } | Write::RemoveSession(_) => true,
    }
}

pub(super) fn carry_out(
    write: &Write,
    batch: u64,
    rows: &mut Table<&[u8], &[u8]>,
) -> Result<(), StorageError> {
    match write {
        Write::Put(row, content) => {
            rows.insert(&row.name()[..], &frame::seal(row, batch, content)[..])?;
        }
        Write::Remove(row) => {
            rows.remove(&row.name()[..])?;
        }
        Write::RemoveEntries { session, before } => {
            let entry = |number| Row { session: *session, kind: Kind::Entry, number }.name();
            let (from, to) = (entry(0), entry(*before));
            rows.retain_in(&from[..]..&to[..], |_, _| false)?;
        }
        Write::RemoveOthers { session, kept } => remove_others(*session, kept, rows)?,
        Write::RemoveSession(session) => remove_others(*session, &[], rows)?,
    }
    Ok(())
}

/// Removes all rows of a session but some.
fn remove_others(
    session: u64,
    kept: &[Row],
    rows: &mut Table<&[u8], &[u8]>,
) -> Result<(), StorageError> {
    let mut range = [[0; NAME], [0xff; NAME]];
    for end in &mut range {
        end[..8].copy_from_slice(&session.to_be_bytes());
    }
    let stays = |name: &[u8]| kept.iter().any(|row| row.name() == name);
    rows.retain_in(&range[0][..]..=&range[1][..], |name, _| stays(name))
}

pub(super) fn failed(error: impl fmt::Display) -> StoreError {
    StoreError::Failed(error.to_string())
}
