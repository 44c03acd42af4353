//! What makes changes last: a journal of them, checkpoints that cut it short, and a thread that
//! commits both and answers whoever waits for that.
//!
//! The world hands over what came of each frame; it never waits for a disk. All that has been
//! handed over while one batch was written goes into the next. An image of what is durable is kept
//! in memory: it is what sessions are brought back from when the device is lost, when a commit
//! fails, and when they wake. The store itself is read only once, at the start.

mod assemble;
mod entry;
mod handle;
mod lock;
mod log;
mod meter;
mod record;
mod replay;
mod weight;
mod writer;

pub(super) use assemble::{Assembled, assemble};
pub(super) use entry::{Checkpoint, Entry, Event, Heartbeat, Identity, Mark, Rest};
pub(super) use handle::{Journal, Verdict, Workers, unstorable};
pub(super) use lock::Lock;
pub(super) use log::{Left, Log, Taken};
pub use meter::{StoreState, StoreVitals};
pub(super) use record::{Append, Part, Pending, Record, Stored};
pub(super) use replay::Replay;
pub(super) use weight::Weight;

/// Seqs that may be published beyond the last durable one: more than anybody publishes before the
/// next is durable, or before a file is put back that was copied. At a start numbering goes on
/// above them.
pub(super) const SEQ_RESERVE: u64 = 1 << 30;
