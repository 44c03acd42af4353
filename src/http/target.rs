//! The session that a request is about.

use std::sync::Arc;

use axum::extract::FromRequestParts;
use axum::http::request::Parts;

use crate::problem::Problem;
use crate::session::{Session, Visit};

use super::state::App;

/// The session that a request is about: the very one for which its caller was let in. Another may get
/// the name while the request's body is still arriving, and is somebody else's.
pub struct Target(pub Visit);

impl FromRequestParts<App> for Target {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Target, Problem> {
        let Unvisited(session) = Unvisited::from_request_parts(parts, app).await?;
        Ok(Target(app.sessions.visit(session)))
    }
}

/// The same, where that is no visit: the session is neither woken nor kept awake.
pub struct Unvisited(pub Arc<Session>);

impl FromRequestParts<App> for Unvisited {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &App) -> Result<Unvisited, Problem> {
        // The gate puts it there for every path with a name of a session.
        let session = parts.extensions.get::<Arc<Session>>().cloned();
        let no_name = || Problem::not_found("the path is not valid UTF-8 text once decoded");
        session.map(Unvisited).ok_or_else(no_name)
    }
}
