//! What a session takes of the server.

use axum::Json as Answer;
use firn_protocol::UsageView;

use crate::http::docs::{SessionPath, SessionProblems};
use crate::http::target::Target;
use crate::problem::Problem;

/// Read what a session takes of the server
///
/// Device time and memory. A read takes some memory itself, so that two answers may differ where nothing
/// was changed.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/usage",
    operation_id = "get_usage",
    tag = "sessions",
    params(SessionPath),
    responses(
        (status = 200, description = "What it takes", body = UsageView),
        SessionProblems
    )
)]
pub async fn get(Target(session): Target) -> Result<Answer<UsageView>, Problem> {
    Ok(Answer(session.usage()))
}
