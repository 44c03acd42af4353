//! The store: what is kept of all sessions.

use serde::{Deserialize, Serialize};

/// What was found in the store.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct VerifyReply {
    /// Whether nothing is wrong.
    pub sound: bool,
    /// Sessions that can be brought back.
    pub sessions: u64,
    /// Each session that can't be, by its name, and why.
    pub broken: Vec<String>,
    /// Everything else that is wrong: with a row, and whose it is, or with the file.
    pub damage: Vec<String>,
    /// Sound rows, second copies among them.
    pub rows: u64,
    /// What they take \[bytes\].
    pub bytes: u64,
    /// Length of the file \[bytes\]. What it has beyond the rows is its index and unused pages.
    pub file_bytes: u64,
}

/// What giving back unused pages has done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct CompactReply {
    /// Length of the file before \[bytes\].
    pub bytes_before: u64,
    /// Length of the file after \[bytes\].
    pub bytes_after: u64,
}
