//! Snowfalls.

use axum::response::Response;
use firn_protocol::{Snowfall, SnowfallReply};

use crate::http::docs::{BodyProblems, SessionPath, SessionProblems};
use crate::http::extract::Json;
use crate::http::repeat::Keyed;
use crate::http::target::Target;
use crate::problem::Problem;
use crate::session::Change;

/// Let snow fall
///
/// On the whole grid or a region. Above an object it lies on the object, as its `burden`, and not on the column under it, unless the
/// object's `shelters` is false. Where several objects cover a column, it lies on the one with the lowest id. What finds no room is
/// refused, and told; it is no error.
#[utoipa::path(
    post,
    path = "/v1/sessions/{id}/snowfalls",
    operation_id = "create_snowfall",
    tag = "weather",
    params(SessionPath),
    request_body = Snowfall,
    responses(
        (status = 200, description = "When it fell, and how much", body = SnowfallReply),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn create(
    Target(session): Target,
    Keyed(once): Keyed,
    Json(body): Json<Snowfall>,
) -> Result<Response, Problem> {
    Ok(super::applied(session.change_once(Change::Snowfall(body), once).await?))
}
