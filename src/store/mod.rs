//! Rows that outlive the process: a small key-value store whose batches are written whole or not
//! at all. What rows mean is the business of `session::journal`.

mod frame;
mod redb;
mod salvage;

use std::collections::BTreeMap;
use std::fmt;

pub use self::redb::{Open, RedbStore};

/// What a row holds. The numbers stand on disk: none is ever used for anything else.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Kind {
    /// Who a session is.
    Identity = 1,
    /// The snapshot that a session was made from.
    Origin = 2,
    /// A session at some tick.
    Checkpoint = 3,
    /// Changes of a session in one frame.
    Entry = 4,
    /// How far a session has come.
    Mark = 5,
    /// The answer to a request that may be repeated.
    Answer = 6,
    /// How far everything has come, of no session.
    Heartbeat = 7,
}

/// Name of a row. Rows of a session lie together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Row {
    /// Key of the session.
    pub session: u64,
    /// What it holds.
    pub kind: Kind,
    /// Tells rows of one kind apart; 0 where there is only one.
    pub number: u64,
}

/// A part of a batch.
#[derive(Clone, Debug)]
pub enum Write {
    /// Writes a row, or replaces it.
    Put(Row, Vec<u8>),
    /// Removes a row, if it is there.
    Remove(Row),
    /// Removes the entries of a session below a number.
    RemoveEntries {
        /// The session.
        session: u64,
        /// First number that stays.
        before: u64,
    },
    /// Removes all rows of a session.
    RemoveSession(u64),
}

/// A row's content.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Content {
    /// Number of the batch that wrote it; later ones are higher.
    pub batch: u64,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// Everything that a store holds.
#[derive(Debug, Default)]
pub struct Loaded {
    /// Every sound row.
    pub rows: BTreeMap<Row, Content>,
    /// What was found to be damaged, if anything was: where it has been kept and what is missing.
    pub damage: Option<String>,
}

/// Why a store could not do something.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{0}")]
pub struct StoreError(pub String);

/// Keeps rows. One thread uses it.
pub trait Store: Send + fmt::Debug {
    /// Everything that is held, read once at the start.
    ///
    /// # Errors
    /// Where it can't be read. Damage is no error: what is sound is returned.
    fn load(&mut self) -> Result<Loaded, StoreError>;

    /// Carries out a batch in its order, whole or not at all. It is durable when this returns.
    ///
    /// # Errors
    /// Where it may not be durable. Trying again later may succeed.
    fn commit(&mut self, writes: &[Write]) -> Result<(), StoreError>;

    /// Whether rows outlive the process.
    fn is_durable(&self) -> bool {
        true
    }
}

/// Keeps nothing: sessions end with the process.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ephemeral;

impl Store for Ephemeral {
    fn load(&mut self) -> Result<Loaded, StoreError> {
        Ok(Loaded::default())
    }

    fn commit(&mut self, _: &[Write]) -> Result<(), StoreError> {
        Ok(())
    }

    fn is_durable(&self) -> bool {
        false
    }
}
