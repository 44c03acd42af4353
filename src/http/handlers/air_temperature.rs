//! The air's temperature.

use axum::extract::State;
use axum::response::Response;

use crate::http::docs::{BodyProblems, SessionPath, SessionProblems};
use crate::http::extract::{Json, Segments};
use crate::http::state::App;
use crate::problem::Problem;
use crate::session::{AirTemperature, AirTemperatureReply, Change};

/// Set the temperature of the air
///
/// Snow that falls from now on takes it; snow that lies keeps its own.
#[utoipa::path(
    put,
    path = "/v1/sessions/{id}/air-temperature",
    operation_id = "put_air_temperature",
    tag = "weather",
    params(SessionPath),
    request_body = AirTemperature,
    responses(
        (status = 200, description = "When it was set", body = AirTemperatureReply),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn put(
    State(app): State<App>,
    Segments(id): Segments<String>,
    Json(body): Json<AirTemperature>,
) -> Result<Response, Problem> {
    let session = app.sessions.get(&id)?;
    Ok(super::applied(session.change(Change::AirTemperature(body)).await?))
}
