//! Clearings: a plough.

use axum::extract::State;
use axum::response::Response;

use crate::http::docs::{BodyProblems, SessionPath, SessionProblems};
use crate::http::extract::{Json, Segments};
use crate::http::repeat::Keyed;
use crate::http::state::App;
use crate::problem::Problem;
use crate::session::{Change, Clearing, ClearingReply};

/// Clear snow
///
/// Leaves at most a depth standing, on the whole grid or in a region.
#[utoipa::path(
    post,
    path = "/v1/sessions/{id}/clearings",
    operation_id = "create_clearing",
    tag = "weather",
    params(SessionPath),
    request_body = Clearing,
    responses(
        (status = 200, description = "When it was cleared, and how much", body = ClearingReply),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn create(
    State(app): State<App>,
    Segments(id): Segments<String>,
    Keyed(once): Keyed,
    Json(body): Json<Clearing>,
) -> Result<Response, Problem> {
    let session = app.sessions.get(&id)?;
    Ok(super::applied(session.change_once(Change::Clearing(body), once).await?))
}
