//! Clearings: a plough.

use axum::response::Response;
use firn_protocol::{Clearing, ClearingReply};

use crate::http::docs::{BodyProblems, SessionPath, SessionProblems};
use crate::http::extract::Json;
use crate::http::repeat::Keyed;
use crate::http::target::Target;
use crate::problem::Problem;
use crate::session::Change;

/// Clear snow
///
/// Leaves at most a depth standing: on the whole grid, in a region, or along a path of a width. Legs of a path may
/// cross 4 194 304 rows of columns together. The snow under objects stays, except under `airborne` ones. What lies on objects
/// stays too.
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
    Target(session): Target,
    Keyed(once): Keyed,
    Json(body): Json<Clearing>,
) -> Result<Response, Problem> {
    Ok(super::applied(session.change_once(Change::Clearing(body), once).await?))
}
