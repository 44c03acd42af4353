//! Probes: how deep something would sink.

use axum::Json as Answer;
use firn_protocol::{ProbeBatch, ProbeReply};

use crate::http::docs::{BodyProblems, SessionPath, SessionProblems};
use crate::http::extract::Json;
use crate::http::target::Target;
use crate::problem::Problem;

/// Probe the snow
///
/// Says how deep loads would sink by the time the snow has come to rest, each as if it were the
/// only one. Nothing is put on the snow. Loads heavy enough to press snow past its equilibrium in
/// one cycle depend on the length of the cycles; the session's present `time_scale` and
/// `tick_rate` count.
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
    Target(session): Target,
    Json(batch): Json<ProbeBatch>,
) -> Result<Answer<ProbeReply>, Problem> {
    Ok(Answer(session.probe(batch).await?))
}
