//! A session's tokens.

use axum::Json as Answer;
use axum::http::{HeaderName, HeaderValue, header};
use serde::Serialize;
use utoipa::ToSchema;

use crate::http::docs::{SessionPath, SessionProblems};
use crate::http::target::Target;
use crate::problem::Problem;

/// Keeps an answer with a secret out of every cache.
pub const SECRET: (HeaderName, HeaderValue) =
    (header::CACHE_CONTROL, HeaderValue::from_static("no-store"));

/// The tokens of a session.
#[derive(Serialize, ToSchema)]
pub struct TokensReply {
    /// Allows everything about this session.
    token: String,
    /// Allows its reads and streams.
    viewer_token: String,
}

/// Give a session new tokens
///
/// The old ones stop working, and streams that were opened with them are closed with 3500. They are
/// told here and never again.
#[utoipa::path(
    post,
    path = "/v1/sessions/{id}/tokens",
    operation_id = "reissue_tokens",
    tag = "sessions",
    params(SessionPath),
    responses(
        (status = 200, description = "The new tokens", body = TokensReply),
        SessionProblems
    )
)]
pub async fn create(
    Target(session): Target,
) -> Result<([(HeaderName, HeaderValue); 1], Answer<TokensReply>), Problem> {
    let tokens = session.reissue_tokens().await?;
    let reply = TokensReply { token: tokens.token, viewer_token: tokens.viewer_token };
    Ok(([SECRET], Answer(reply)))
}
