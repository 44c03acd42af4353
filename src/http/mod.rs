//! The REST interface: `docs/architecture.md` describes the layers, `api/openapi.json` the calls.

mod accept;
pub(crate) mod answers;
pub(crate) mod bodies;
pub(crate) mod compression;
mod docs;
mod etag;
mod extract;
pub(crate) mod gate;
pub(crate) mod handlers;
mod npy;
pub(crate) mod observe;
mod page;
mod query;
pub(crate) mod reference;
mod refusals;
pub(crate) mod repeat;
mod state;
mod target;
pub(crate) mod viewer;

pub use answers::Leave;
pub use extract::{FromQuery, Query, Segments};
pub use gate::{Admitted, Caller, Gate, Peer, Unfinished, Visitor, admit, bearer, reload};
pub use query::Params;
pub use state::App;
