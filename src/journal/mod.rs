//! What makes changes last: rows of them in a store, and a thread that commits those.
//!
//! The core hands over the changes of each frame; it never waits for a disk. All that has been
//! handed over while one batch was written goes into the next. The store itself is read only
//! once, at the start.

mod assemble;
mod check;
mod handle;
mod keeper;
pub(crate) mod keyed;
mod migrate;
mod rows;
mod writer;

pub(crate) use assemble::{Assembled, assemble};
pub use check::{StoreReport, StoredSession, check_store, verify_store};
pub(crate) use handle::{Journal, Workers};
pub use keeper::{Backup, StoreKeeper};
pub use keyed::{KeyedRequests, NoPlace};
pub(crate) use migrate::migrate;
