//! The weather of alpine snow.

use std::sync::Arc;

use axum::Json as Answer;
use axum::extract::State;
use axum::response::{IntoResponse, Response};
use firn_protocol::{Stamp, WeatherInput, WeatherView};

use crate::http::docs::{AlpineProblems, BodyProblems, SessionPath, SessionProblems};
use crate::http::extract::Json;
use crate::http::state::App;
use crate::http::target::Target;
use crate::problem::Problem;
use crate::session::Change;

/// Memory that a row of a series takes in an answer, about.
const TEXT: u64 = 4;

/// Read the weather
///
/// Of alpine snow: what was told, what holds now, and what of that was worked out because nobody told it. 409 where the session has
/// other physics.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/weather",
    operation_id = "get_weather",
    tag = "weather",
    params(SessionPath),
    responses((status = 200, description = "The weather", body = WeatherView), AlpineProblems,
        SessionProblems)
)]
pub async fn get(State(app): State<App>, Target(session): Target) -> Result<Response, Problem> {
    let view = session.weather()?;
    let leave = app.answers.admit(TEXT * view.weather.heap_bytes() as u64).await?;
    leave.make(move || Ok(Answer(view).into_response())).await
}

/// Set the weather
///
/// Of alpine snow: one that holds until it is replaced, or a series that changes with simulated time. Before its first row and after
/// its last these hold. The snow feels it in steps of `weather_step` seconds: the step under way is the first that is made of it, as
/// it is at the step's beginning. What lies between two steps, a row of a series or another weather in between, is not felt.
///
/// Radiation that is left out is worked out from the site, the clock and the cloud cover. 409 where the session has other physics.
#[utoipa::path(
    put,
    path = "/v1/sessions/{id}/weather",
    operation_id = "put_weather",
    tag = "weather",
    params(SessionPath),
    request_body = WeatherInput,
    responses(
        (status = 200, description = "When it was set", body = Stamp),
        AlpineProblems,
        SessionProblems,
        BodyProblems
    )
)]
pub async fn put(
    Target(session): Target,
    Json(body): Json<WeatherInput>,
) -> Result<Response, Problem> {
    Ok(super::applied(session.change(Change::Weather(Arc::new(body))).await?))
}
