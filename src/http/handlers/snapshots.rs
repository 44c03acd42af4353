//! A whole session in one piece, and its digest.

use axum::Json as Answer;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use firn_protocol::Stamp;
use serde::Serialize;
use utoipa::ToSchema;

use crate::http::answers::carry_on;
use crate::http::docs::{SessionPath, SessionProblems};
use crate::http::state::App;
use crate::http::target::Target;
use crate::problem::Problem;
use crate::session::{SNAPSHOT_MEDIA_TYPE, Snapshot, Visit};

use super::stamp_headers;

/// A snapshot, as `api/snapshot.md` describes it.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[expect(dead_code, reason = "it only describes the body")]
pub struct SnapshotBytes(Vec<u8>);

/// The digest of a session.
#[derive(Debug, Serialize, ToSchema)]
pub struct DigestView {
    /// When this holds.
    #[serde(flatten)]
    stamp: Stamp,
    /// Hash of all that a snapshot holds: equal digests, equal snowpacks.
    digest: String,
}

/// Save a session
///
/// The whole snowpack with its configuration and colliders, without id, tokens and wall times.
/// `POST /v1/sessions` makes a session of it again.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/snapshot",
    operation_id = "get_snapshot",
    tag = "sessions",
    params(SessionPath),
    responses(
        (status = 200, description = "The snapshot",
            content((SnapshotBytes = "application/vnd.firn.snapshot")),
            headers(
                ("Firn-Tick" = u64, description = "Tick at which it was taken"),
                ("Firn-Seq" = u64, description = "Seq at which it was taken")
            )),
        SessionProblems
    )
)]
pub async fn get(State(app): State<App>, Target(session): Target) -> Result<Response, Problem> {
    make(&app, session, |snapshot| {
        let media_type = [(header::CONTENT_TYPE, SNAPSHOT_MEDIA_TYPE)];
        Ok((stamp_headers(snapshot.stamp), media_type, snapshot.encode()?).into_response())
    })
    .await
}

/// Read a session's digest
///
/// A hash of all that a snapshot holds: equal digests, equal snowpacks.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/digest",
    operation_id = "get_digest",
    tag = "sessions",
    params(SessionPath),
    responses((status = 200, description = "The digest", body = DigestView), SessionProblems)
)]
pub async fn digest(State(app): State<App>, Target(session): Target) -> Result<Response, Problem> {
    make(&app, session, |snapshot| {
        let view = DigestView { stamp: snapshot.stamp, digest: snapshot.digest()? };
        Ok(Answer(view).into_response())
    })
    .await
}

/// Makes an answer of a snapshot.
async fn make(
    app: &App,
    session: Visit,
    answer: impl FnOnce(Snapshot) -> Result<Response, Problem> + Send + 'static,
) -> Result<Response, Problem> {
    let leave = app.answers.admit_found(&session, session.snapshot_bytes()).await?;
    carry_on(async move {
        let snapshot = session.snapshot().await?;
        leave.make(move || answer(snapshot)).await
    })
    .await
}
