//! The air's temperature.

use axum::response::Response;
use firn_protocol::{AirTemperature, AirTemperatureReply};

use crate::http::docs::{BodyProblems, SessionPath, SessionProblems};
use crate::http::extract::Json;
use crate::http::target::Target;
use crate::problem::Problem;
use crate::session::Change;

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
    Target(session): Target,
    Json(body): Json<AirTemperature>,
) -> Result<Response, Problem> {
    Ok(super::applied(session.change(Change::AirTemperature(body)).await?))
}
