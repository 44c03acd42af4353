//! What makes changes last: a journal of them, checkpoints that cut it short, and a thread that
//! commits both.
//!
//! The world hands over what came of each frame; it never waits for a disk. All that has been
//! handed over while one batch was written goes into the next. A record of each session is kept in
//! memory: what is durable of it, and what is on its way. It is what the session comes back from
//! when the device is lost, when a commit fails, and when it wakes. The store itself is read only
//! once, at the start.

mod anchor;
mod assemble;
mod check;
mod entry;
mod fold;
mod handle;
mod keeper;
mod lock;
mod log;
mod meter;
mod migrate;
mod record;
mod replay;
mod rows;
mod weight;
mod writer;

pub(super) use anchor::{Anchor, Epochs, Exact, Heartbeat};
pub(super) use assemble::{Assembled, assemble};
pub use check::{StoreReport, StoredSession, check_store, verify_store};
pub(super) use entry::{Checkpoint, Entry, Head, Identity};
pub(super) use handle::{Journal, Verdict, Workers, unstorable};
pub use keeper::{Backup, StoreKeeper};
pub(super) use lock::Lock;
pub(super) use log::{Left, Log, Taken};
pub use meter::{StoreState, StoreVitals};
pub(super) use migrate::migrate;
pub(super) use record::{Append, Part, Pending, Record, Stored};
pub(super) use replay::Replay;
pub(super) use weight::Weight;
