//! What the rest of the server sees of sessions: names, handles, requests, views.

mod checkpoints;
pub(crate) mod handle;
mod lock;
mod memory;
mod names;
mod probe;
pub(crate) mod registry;
mod requests;
mod sealed;
mod tenants;
mod token;
mod totals;
mod visit;

pub use crate::core::record::Once;
pub use crate::core::session::Limits;
pub use crate::core::session::Publication;
pub use crate::core::session::Simulation;
pub use crate::core::session::{Applied, Change};
pub use crate::core::session::{Clock, FRAME_RATE};
pub use crate::core::session::{Gathered, MOST_SAMPLES, Sampled};
pub use crate::core::session::{Grant, TokenHashes};
pub use crate::core::session::{Invalid, SessionError};
pub use crate::core::session::{Mirror, TileColumns};
pub use crate::core::snapshot::{MEDIA_TYPE as SNAPSHOT_MEDIA_TYPE, Snapshot};
pub use crate::core::tenant::{Quotas, Tenant};
pub use crate::core::vitals::{FrameParts, FrameTime, StageTimes, StoreState, StoreVitals, Vitals};
pub use crate::journal::{KeyedRequests, NoPlace};
pub use handle::Session;
pub use memory::Companion;
pub(crate) use names::Names;
pub use registry::Sessions;
pub use tenants::Tenants;
pub use token::{Tokens, random_secret};
pub use totals::{TenantTotals, Totals};
pub use visit::Visit;
