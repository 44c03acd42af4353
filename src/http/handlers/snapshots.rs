//! A whole session in one piece, and its digest.

use axum::Json as Answer;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use crate::http::docs::{SessionPath, SessionProblems};
use crate::http::extract::Segments;
use crate::http::state::App;
use crate::problem::Problem;
use crate::session::{SNAPSHOT_MEDIA_TYPE, Stamp};

use super::{off_thread, stamp_headers};

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
pub async fn get(
    State(app): State<App>,
    Segments(id): Segments<String>,
) -> Result<Response, Problem> {
    let snapshot = app.sessions.get(&id)?.snapshot().await?;
    let stamp = snapshot.stamp;
    let bytes = off_thread(move || snapshot.encode()).await??;
    let media_type = [(header::CONTENT_TYPE, SNAPSHOT_MEDIA_TYPE)];
    Ok((stamp_headers(stamp), media_type, bytes).into_response())
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
pub async fn digest(
    State(app): State<App>,
    Segments(id): Segments<String>,
) -> Result<Answer<DigestView>, Problem> {
    let snapshot = app.sessions.get(&id)?.snapshot().await?;
    let stamp = snapshot.stamp;
    let digest = off_thread(move || snapshot.digest()).await??;
    Ok(Answer(DigestView { stamp, digest }))
}
