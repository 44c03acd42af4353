//! Rows that outlive the process: a small key-value store whose batches are written whole or not
//! at all. What rows mean is the business of the journal.

mod clock;
mod directory;
mod frame;
mod moment;
mod open;
mod redb;
mod refusal;
mod roster;
mod salvage;
mod secret;
mod tables;

use std::collections::BTreeMap;
use std::fmt;

pub use self::clock::StoreClock;
pub(crate) use self::directory::{link_or_copy, new_file, sync_names};
pub use self::moment::{Flaw, Moment, Verified};
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
    /// How far a session had come, of the first format.
    Mark = 5,
    /// The answer to a request that may be repeated.
    Answer = 6,
    /// How far everything has come, of no session.
    Heartbeat = 7,
    /// That a session was deleted. The store keeps it for itself.
    Tombstone = 8,
    /// Which sessions live. The store keeps it for itself.
    Roster = 9,
    /// That a session came back from a damaged file and takes no changes.
    Lock = 10,
    /// How far the store's clock has come. The store keeps it for itself.
    Clock = 11,
    /// What tells the store's own tombstones from bytes that a client sent. The store keeps it for
    /// itself.
    Secret = 12,
    /// How far a session has come, and how it goes on.
    Anchor = 13,
    /// What a session was published in.
    Epochs = 14,
    /// How many entries a session has.
    Head = 15,
    /// The format of all rows. The store keeps it for itself.
    Format = 16,
    /// Which restore points a session has.
    Points = 17,
    /// The snapshot of a restore point.
    Point = 18,
}

/// What rows mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    /// That of Firn 0.1.
    First,
    /// That of this program.
    #[default]
    Present,
}

impl Format {
    /// Its number, as it stands on disk.
    pub const fn number(self) -> u32 {
        match self {
            Format::First => 1,
            Format::Present => 2,
        }
    }

    fn magic(self) -> &'static [u8; 8] {
        match self {
            Format::First => frame::FIRST_MAGIC,
            Format::Present => frame::MAGIC,
        }
    }
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
    /// Removes all rows of a session but some, for what is written anew in the same batch.
    RemoveOthers {
        /// The session.
        session: u64,
        /// The rows that stay, where they are there.
        kept: Vec<Row>,
    },
    /// Removes all rows of a session. Where no identity follows in the same batch the session is dead:
    /// nothing brings it back from a damaged file.
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
    /// Every sound row; those of restore points without their bytes, unless something is damaged.
    pub rows: BTreeMap<Row, Content>,
    /// The lowest key that no session has had.
    pub next_key: u64,
    /// The store's own clock, which goes on.
    pub clock: StoreClock,
    /// What the rows mean.
    pub format: Format,
    /// What was found to be damaged, if anything was.
    pub damage: Option<Damage>,
}

/// What is wrong with what a store holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// What was found, and where.
    pub what: String,
    /// Keys of sessions that should be there and were not found.
    pub missing: Vec<u64>,
}

/// Why a store could not do something.
#[derive(Clone, Debug, thiserror::Error)]
pub enum StoreError {
    /// It can't be read or written.
    #[error("{0}")]
    Failed(String),
    /// What it has written is not where it was any more.
    #[error("{0}")]
    Gone(String),
    /// A running server uses it.
    #[error("{0}")]
    InUse(String),
}

/// Bytes of the file before and after unused pages were given back.
#[derive(Clone, Copy, Debug)]
pub struct Compacted {
    /// Before.
    pub before: u64,
    /// After.
    pub after: u64,
}

/// Keeps rows. One thread uses it.
pub trait Store: Send + fmt::Debug {
    /// Everything that is held, read once at the start.
    ///
    /// # Errors
    /// Where it can't be read. Damage is no error: what is sound is returned.
    fn load(&mut self) -> Result<Loaded, StoreError>;

    /// Puts rows in the place of a file that is damaged or of another format, and keeps the file beside it.
    /// Until then nothing is changed.
    ///
    /// # Errors
    /// Where that can't be done; the file is where it was then, or beside it.
    fn take_over(&mut self, rows: &BTreeMap<Row, Content>) -> Result<(), StoreError> {
        let _ = rows;
        Err(StoreError::Failed("there is no file that could be replaced".to_owned()))
    }

    /// Whether what it has written can still be found by the next start.
    ///
    /// # Errors
    /// [`StoreError::Gone`] where it can't.
    fn check(&mut self) -> Result<(), StoreError> {
        Ok(())
    }

    /// Carries out a batch in its order, whole or not at all. It is durable when this returns.
    ///
    /// # Errors
    /// Where it may not be durable. Trying again later may succeed.
    fn commit(&mut self, writes: &[Write]) -> Result<(), StoreError>;

    /// What a row holds now; `None` where there is no such row.
    ///
    /// # Errors
    /// Where there is no file, or the row can't be read.
    fn read(&mut self, row: Row) -> Result<Option<Vec<u8>>, StoreError> {
        let _ = row;
        Err(no_file())
    }

    /// All that is committed now, to be read by another thread while more is committed.
    ///
    /// # Errors
    /// Where there is no file, or it can't be read.
    fn moment(&mut self) -> Result<Moment, StoreError> {
        Err(no_file())
    }

    /// Gives unused pages of the file back to the file system, which may take long. No [`Moment`] may be left.
    ///
    /// # Errors
    /// Where there is no file, or it can't be written. No row is lost.
    fn compact(&mut self) -> Result<Compacted, StoreError> {
        Err(no_file())
    }

    /// Whether rows outlive the process.
    fn is_durable(&self) -> bool {
        true
    }
}

fn no_file() -> StoreError {
    StoreError::Failed("this store is no file".to_owned())
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
