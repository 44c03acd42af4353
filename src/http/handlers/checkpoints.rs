//! Restore points: states of a session that are kept under names, to go back to.

use axum::Json as Answer;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use firn_protocol::{CheckpointList, CheckpointView};

use crate::http::accept::choose;
use crate::http::answers::carry_on;
use crate::http::docs::{CheckpointPath, ParameterProblems, SessionPath, SessionProblems};
use crate::http::extract::Segments;
use crate::http::handlers::snapshots::SnapshotBytes;
use crate::http::state::App;
use crate::http::target::{Target, Unvisited};
use crate::problem::Problem;
use crate::session::SNAPSHOT_MEDIA_TYPE;

/// Media types of a restore point.
const MEDIA_TYPES: [&str; 2] = ["application/json", SNAPSHOT_MEDIA_TYPE];

/// List restore points
///
/// In ascending order of their names; at most 16.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/checkpoints",
    operation_id = "list_checkpoints",
    tag = "sessions",
    params(SessionPath),
    responses(
        (status = 200, description = "The restore points", body = CheckpointList),
        SessionProblems
    )
)]
pub async fn list(Unvisited(session): Unvisited) -> Answer<CheckpointList> {
    Answer(CheckpointList { items: session.checkpoints() })
}

/// Get a restore point
///
/// What is known of it, or its snapshot, by `Accept`.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/checkpoints/{name}",
    operation_id = "get_checkpoint",
    tag = "sessions",
    params(CheckpointPath),
    responses(
        (status = 200, description = "The restore point", content(
            (CheckpointView = "application/json"),
            (SnapshotBytes = "application/vnd.firn.snapshot")
        )),
        (status = 406, description = "The client accepts none of the media types", body = Problem,
            content_type = "application/problem+json"),
        SessionProblems
    )
)]
pub async fn get(
    State(app): State<App>,
    Unvisited(session): Unvisited,
    Segments((_id, name)): Segments<(String, String)>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let known = session.checkpoint(&name)?;
    let chosen = choose(&headers, &MEDIA_TYPES).ok_or_else(|| {
        Problem::not_acceptable(format!("restore points exist as {}", MEDIA_TYPES.join(", ")))
    })?;
    if chosen != SNAPSHOT_MEDIA_TYPE {
        return Ok(Answer(known).into_response());
    }
    let leave = app.answers.admit(known.bytes).await?;
    let snapshot = session.checkpoint_snapshot(&name).await?;
    let media_type = [(header::CONTENT_TYPE, SNAPSHOT_MEDIA_TYPE)];
    Ok(leave.take((media_type, snapshot).into_response()).await)
}

/// Keep a restore point
///
/// The session's present state, under a name, `[A-Za-z0-9_-]{1,64}`: another one of that name is replaced. A
/// session has at most 16. They are as durable as the session, and end with it.
#[utoipa::path(
    put,
    path = "/v1/sessions/{id}/checkpoints/{name}",
    operation_id = "put_checkpoint",
    tag = "sessions",
    params(CheckpointPath),
    responses(
        (status = 200, description = "The restore point, replaced", body = CheckpointView),
        (status = 201, description = "The restore point, which is new", body = CheckpointView,
            headers(("Location" = String, description = "Path of the restore point"))),
        (status = 409, description = "The session has as many as it may", body = Problem,
            content_type = "application/problem+json"),
        SessionProblems,
        ParameterProblems
    )
)]
pub async fn put(
    State(app): State<App>,
    Target(session): Target,
    Segments((_id, name)): Segments<(String, String)>,
) -> Result<Response, Problem> {
    let leave = app.answers.admit_found(&session, session.snapshot_bytes()).await?;
    carry_on(async move {
        let (kept, is_new) = session.keep_checkpoint(&name).await?;
        let answer = if is_new {
            let location = format!("/v1/sessions/{}/checkpoints/{name}", session.id);
            (StatusCode::CREATED, [(header::LOCATION, location)], Answer(kept)).into_response()
        } else {
            Answer(kept).into_response()
        };
        Ok(leave.take(answer).await)
    })
    .await
}

/// Delete a restore point
#[utoipa::path(
    delete,
    path = "/v1/sessions/{id}/checkpoints/{name}",
    operation_id = "delete_checkpoint",
    tag = "sessions",
    params(CheckpointPath),
    responses((status = 204, description = "It is gone"), SessionProblems)
)]
pub async fn delete(
    Unvisited(session): Unvisited,
    Segments((_id, name)): Segments<(String, String)>,
) -> Result<StatusCode, Problem> {
    session.delete_checkpoint(&name).await?;
    Ok(StatusCode::NO_CONTENT)
}
