//! Stamps: prints that loads press into the snow at once.

use axum::response::Response;
use firn_protocol::{StampBatch, StampReply};

use crate::http::docs::{BodyProblems, SessionPath, SessionProblems};
use crate::http::extract::Json;
use crate::http::repeat::Keyed;
use crate::http::target::Target;
use crate::problem::Problem;
use crate::session::Change;

/// Press prints into the snow
///
/// Each load presses the snow below it to where that carries it, at once; nothing stays but the print. A column
/// that it covers in part is pressed by that part of the way, so that a print does not depend on how it lies
/// on the grid. All in one frame, or none.
#[utoipa::path(
    post,
    path = "/v1/sessions/{id}/stamps",
    operation_id = "create_stamps",
    tag = "colliders",
    params(SessionPath),
    request_body = StampBatch,
    responses(
        (status = 200, description = "How deep each has pressed", body = StampReply),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn create(
    Target(session): Target,
    Keyed(once): Keyed,
    Json(batch): Json<StampBatch>,
) -> Result<Response, Problem> {
    Ok(super::applied(session.change_once(Change::Stamps(batch), once).await?))
}
