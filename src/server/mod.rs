//! The whole server: every route of REST, stream and pages, what is around them, and how it begins and
//! ends.

mod document;
mod router;
mod run;

pub use document::document;
pub use router::router;
pub use run::run;
