//! The mass ledger.

use axum::Json as Answer;
use axum::extract::State;

use crate::http::docs::{SessionPath, SessionProblems};
use crate::http::extract::Segments;
use crate::http::state::App;
use crate::problem::Problem;
use crate::session::MassView;

/// Read the mass ledger
///
/// What fell, what was refused and cleared, and what is there. Nothing is ever lost.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/mass",
    operation_id = "get_mass",
    tag = "snow",
    params(SessionPath),
    responses((status = 200, description = "The ledger", body = MassView), SessionProblems)
)]
pub async fn get(
    State(app): State<App>,
    Segments(id): Segments<String>,
) -> Result<Answer<MassView>, Problem> {
    Ok(Answer(app.sessions.get(&id)?.mass().await?))
}
