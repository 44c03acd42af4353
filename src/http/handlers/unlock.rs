//! Sessions that came back from a damaged store, and take no changes until they are unlocked.

use axum::Json as Answer;
use firn_protocol::SessionView;

use crate::http::docs::{SessionPath, SessionProblems};
use crate::http::target::Target;
use crate::problem::Problem;

/// Unlock a session
///
/// A session that came back from a damaged store is paused and `locked`: it may be one that had been
/// deleted, so that its changes get 423. This says that it is as it should be. Takes an API key with the
/// scope `admin`. One that should not be there is deleted with such a key instead.
#[utoipa::path(
    post,
    path = "/v1/sessions/{id}/unlock",
    operation_id = "unlock_session",
    tag = "sessions",
    params(SessionPath),
    responses(
        (status = 200, description = "The session, which takes changes", body = SessionView),
        SessionProblems
    )
)]
pub async fn create(Target(session): Target) -> Result<Answer<SessionView>, Problem> {
    Ok(Answer(session.unlock().await?))
}
