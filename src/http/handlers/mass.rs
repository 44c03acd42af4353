//! The mass ledger.

use axum::Json as Answer;
use firn_protocol::MassView;

use crate::http::docs::{SessionPath, SessionProblems};
use crate::http::target::Target;
use crate::problem::Problem;

/// Read the mass ledger
///
/// What fell, what was refused and cleared, what lies on objects (`carried`), and what lies in the columns (`present`), in kilograms.
/// Nothing is ever lost: `imbalance_quanta` is always 0.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/mass",
    operation_id = "get_mass",
    tag = "snow",
    params(SessionPath),
    responses((status = 200, description = "The ledger", body = MassView), SessionProblems)
)]
pub async fn get(Target(session): Target) -> Result<Answer<MassView>, Problem> {
    Ok(Answer(session.mass().await?))
}
