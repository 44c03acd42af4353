//! The REST interface: `docs/architecture.md` describes the layers, `api/openapi.json` the calls.

mod accept;
mod docs;
mod etag;
mod extract;
mod gate;
mod handlers;
mod observe;
mod page;
mod query;
mod reference;
mod repeat;
mod router;
mod run;
mod state;
mod viewer;

pub use docs::document;
pub use extract::{FromQuery, Query, Segments};
pub use gate::{Caller, Gate, bearer};
pub use query::Params;
pub use router::router;
pub use run::run;
pub use state::App;
