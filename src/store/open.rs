//! Opening the file, and telling damage from all that may keep it from being opened.

use std::io::ErrorKind;
use std::panic::{AssertUnwindSafe, catch_unwind};

use redb::{Builder, Database, DatabaseError, StorageError};

/// Memory for pages of the file \[bytes\]. Rows are read once, at the start.
const CACHE: usize = 64 << 20;

/// What opens the file; `check` has everything in it looked at.
pub(super) fn builder(check: bool) -> Builder {
    let mut builder = Builder::new();
    builder.set_cache_size(CACHE).set_check_integrity_on_open(check);
    builder
}

/// Why a file could not be opened.
pub(super) enum Failure {
    /// What is in it is not what was written.
    Damage(String),
    /// Another process has it open.
    InUse,
    /// Something that has nothing to do with what is in it.
    Other(String),
}

/// Opens it.
pub(super) fn attempt(
    open: impl Fn() -> Result<Database, DatabaseError>,
) -> Result<Database, Failure> {
    let opened = catch_unwind(AssertUnwindSafe(open))
        .map_err(|_| Failure::Damage("reading it panicked".to_owned()))?;
    opened.map_err(|error| match &error {
        DatabaseError::DatabaseAlreadyOpen => Failure::InUse,
        DatabaseError::Storage(StorageError::Io(io)) => match io.kind() {
            ErrorKind::UnexpectedEof | ErrorKind::InvalidData | ErrorKind::InvalidInput => {
                Failure::Damage(io.to_string())
            }
            _ => Failure::Other(io.to_string()),
        },
        DatabaseError::Storage(StorageError::Corrupted(why)) => Failure::Damage(why.clone()),
        // No version of Firn has written such a file: the byte that says so is wrong.
        DatabaseError::UpgradeRequired(format) => {
            Failure::Damage(format!("it says that its format is {format}"))
        }
        _ => Failure::Other(error.to_string()),
    })
}
