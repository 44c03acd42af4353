//! Snowfalls.

use axum::extract::State;
use axum::response::Response;

use crate::http::docs::{BodyProblems, SessionPath, SessionProblems};
use crate::http::extract::{Json, Segments};
use crate::http::repeat::Keyed;
use crate::http::state::App;
use crate::problem::Problem;
use crate::session::{Change, Snowfall, SnowfallReply};

/// Let snow fall
///
/// On the whole grid or a region. What finds no room is refused, and told; it is no error.
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
    State(app): State<App>,
    Segments(id): Segments<String>,
    Keyed(once): Keyed,
    Json(body): Json<Snowfall>,
) -> Result<Response, Problem> {
    let session = app.sessions.get(&id)?;
    Ok(super::applied(session.change_once(Change::Snowfall(body), once).await?))
}
