//! The store as a whole, beside all that is written to it: a copy, a check, and a smaller file.

use axum::Json as Answer;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderName, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use firn_protocol::{CompactReply, VerifyReply};
use utoipa::{IntoResponses, ToSchema};

use crate::http::state::App;
use crate::problem::Problem;

/// A file for a data directory.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[expect(dead_code, reason = "it only describes the body")]
pub struct StoreBytes(Vec<u8>);

/// Problems of every call about the store.
#[derive(IntoResponses)]
#[expect(dead_code, reason = "it only describes the responses")]
pub enum StoreProblems {
    /// The server keeps nothing, or another of these calls is under way.
    #[response(status = 409, content_type = "application/problem+json")]
    Conflict(Problem),
    /// The store can't be read, or what is made of it can't be written.
    #[response(status = 500, content_type = "application/problem+json")]
    Internal(Problem),
    /// The server is stopping, or its data directory is gone.
    #[response(status = 503, content_type = "application/problem+json")]
    Unavailable(Problem),
}

/// Back up the store
///
/// All sessions as they are at one moment, as a file `firn.redb` that a server starts from. Changes go on meanwhile.
/// Everything that was acknowledged before the request is in it. Takes an API key with the scope `admin`.
#[utoipa::path(
    get,
    path = "/v1/store/backup",
    operation_id = "back_up_store",
    tag = "operations",
    responses(
        (status = 200, description = "The file",
            content((StoreBytes = "application/octet-stream")),
            headers(("Content-Disposition" = String, description = "The file's name"))),
        StoreProblems
    )
)]
pub async fn backup(State(app): State<App>) -> Result<Response, Problem> {
    let backup = app.sessions.store().backup().await?;
    let headers: [(HeaderName, HeaderValue); 3] = [
        (header::CONTENT_TYPE, HeaderValue::from_static("application/octet-stream")),
        (header::CONTENT_LENGTH, HeaderValue::from(backup.bytes)),
        (
            header::CONTENT_DISPOSITION,
            HeaderValue::from_static("attachment; filename=\"firn.redb\""),
        ),
    ];
    Ok((headers, Body::from_stream(app.answers.pieces(backup))).into_response())
}

/// Verify the store
///
/// Reads everything that is stored at one moment: each row's checksum in the file, both copies of rows that are kept
/// twice, and every session as a start would. Changes go on meanwhile. What is found to be wrong is no problem of the
/// call: it is answered with 200 and `sound: false`. Takes an API key with the scope `admin`.
#[utoipa::path(
    post,
    path = "/v1/store/verify",
    operation_id = "verify_store",
    tag = "operations",
    responses((status = 200, description = "What was found", body = VerifyReply), StoreProblems)
)]
pub async fn verify(State(app): State<App>) -> Result<Answer<VerifyReply>, Problem> {
    Ok(Answer(app.sessions.store().verify().await?))
}

/// Compact the store
///
/// Gives unused pages of the file back to the file system. Changes wait until that is done; reads and streams go on.
/// It needs some room beside the file. Takes an API key with the scope `admin`.
#[utoipa::path(
    post,
    path = "/v1/store/compact",
    operation_id = "compact_store",
    tag = "operations",
    responses((status = 200, description = "What it has done", body = CompactReply), StoreProblems)
)]
pub async fn compact(State(app): State<App>) -> Result<Answer<CompactReply>, Problem> {
    Ok(Answer(app.sessions.store().compact().await?))
}
