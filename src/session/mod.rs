//! A session's life: its name, its commands, its clock, and the mirror that reads are served from.

mod answer;
mod apply;
mod change;
mod changes;
mod charge;
mod clock;
mod command;
mod decide;
mod error;
mod falling;
mod gather;
mod handle;
mod idempotency;
mod inbox;
mod journal;
mod lock;
mod memory;
mod message;
mod mirror;
mod names;
mod object_rows;
mod once;
mod orders;
mod pace;
mod portion;
mod probe;
mod publish;
mod reach;
mod receipt;
mod registry;
mod requests;
mod simulation;
mod snapshot;
mod spec;
mod state;
mod step;
mod tenant;
mod token;
mod totals;
mod turn;
mod visit;
mod vitals;
mod weak;
mod world;

pub use change::{Applied, Change};
pub use clock::{Clock, FRAME_RATE};
pub use error::{Invalid, SessionError};
pub use gather::{Gathered, MOST_SAMPLES, Sampled};
pub use handle::Session;
pub use idempotency::{Answer, Idempotency, NoPlace, Place, RequestKey, Share};
pub use journal::{
    Backup, StoreKeeper, StoreReport, StoreState, StoreVitals, StoredSession, check_store,
    verify_store,
};
pub use memory::Companion;
pub use mirror::{Mirror, TileColumns};
pub use once::Once;
pub use publish::Publication;
pub use registry::Sessions;
pub use simulation::Simulation;
pub use snapshot::{MEDIA_TYPE as SNAPSHOT_MEDIA_TYPE, Snapshot};
pub use spec::Limits;
pub use tenant::{Quotas, Tenant, Tenants};
pub use token::{Grant, TokenHashes, Tokens, random_secret};
pub use totals::{TenantTotals, Totals};
pub use visit::Visit;
pub use vitals::{FrameParts, FrameTime, StageTimes, Vitals};
pub use world::{
    Durability, Fault, ManualJournal, ManualWorld, OpenBackend, StartError, World, WorldConfig,
};
