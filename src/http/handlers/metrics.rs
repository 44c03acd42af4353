//! What the server counts.

use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};

use crate::http::state::App;
use crate::metrics::MEDIA_TYPE;
use crate::problem::Problem;

/// What has the server counted?
///
/// For Prometheus, in the OpenMetrics text format; every name begins with `firn_`.
#[utoipa::path(
    get,
    path = "/metrics",
    operation_id = "metrics",
    tag = "operations",
    responses((status = 200, description = "Counters, gauges and histograms", body = String,
        content_type = "application/openmetrics-text"))
)]
pub async fn get(State(app): State<App>) -> Result<Response, Problem> {
    let text = app
        .metrics
        .encode()
        .map_err(|error| Problem::internal(format!("the metrics can't be written: {error}")))?;
    Ok(([(CONTENT_TYPE, MEDIA_TYPE)], text).into_response())
}
