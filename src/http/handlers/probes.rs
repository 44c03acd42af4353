//! Probes: how deep something would sink.

use axum::extract::State;
use axum::response::Response;
use firn_protocol::{ProbeBatch, ProbeReply};

use crate::http::docs::{BodyProblems, SessionPath, SessionProblems};
use crate::http::extract::Json;
use crate::http::state::App;
use crate::http::target::Target;
use crate::problem::Problem;

use super::{json, respond};

/// Probe the snow
///
/// Says how deep loads would sink, each as if it were the only one: by the time the snow has come to
/// rest, or in a `duration` of simulated time, as the session's `pressing` is now. Nothing is put on the snow. Where snow creeps, loads heavy enough to press
/// snow past its equilibrium in one cycle depend on the length of the cycles; the session's present
/// `time_scale` and `tick_rate` count. Durations of one request may take 2²⁰ cycles together.
#[utoipa::path(
    post,
    path = "/v1/sessions/{id}/probes",
    operation_id = "probe",
    tag = "snow",
    params(SessionPath),
    request_body = ProbeBatch,
    responses(
        (status = 200, description = "What becomes of each load", body = ProbeReply),
        SessionProblems,
        BodyProblems
    )
)]
pub async fn create(
    State(app): State<App>,
    Target(session): Target,
    Json(batch): Json<ProbeBatch>,
) -> Result<Response, Problem> {
    let reading = session.probe(batch)?;
    let bytes = reading.answer_bytes();
    respond(&app, reading, move |reply| json(&reply, bytes)).await
}
