//! What sessions come back from: what is durable of them, and what is on its way there.

mod anchor;
mod done;
mod entry;
mod fold;
mod lock;
mod log;
mod points;
#[expect(clippy::module_inception, reason = "it holds the record itself")]
mod record;
mod replay;
mod stored;
mod weight;

pub(crate) use anchor::{Anchor, Epochs, Exact, Heartbeat};
pub use done::Once;
pub(crate) use done::{Done, DoneResult, Hash, LIFETIME, OVERHEAD, Sealed, is_over};
pub(crate) use entry::{Checkpoint, Entry, Head, Identity};
pub(crate) use fold::Fold;
pub(crate) use lock::Lock;
pub(crate) use log::{Left, Log, Taken};
pub(crate) use points::{RestorePoint, RestorePoints};
pub(crate) use record::{Append, Part, Pending, Record};
pub(crate) use replay::Replay;
pub(crate) use stored::Stored;
pub(crate) use weight::{Weight, bytes_of, heap_bytes};
