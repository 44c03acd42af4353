//! What the OpenAPI document says of several calls alike: parameters and problems.

use utoipa::{IntoParams, IntoResponses};

use crate::problem::Problem;

/// Path parameter of everything about a session.
#[derive(IntoParams)]
#[into_params(parameter_in = Path)]
#[expect(dead_code, reason = "it only describes the parameter")]
pub struct SessionPath {
    /// Name of the session.
    id: String,
}

/// Path parameters of everything about a collider.
#[derive(IntoParams)]
#[into_params(parameter_in = Path)]
#[expect(dead_code, reason = "it only describes the parameters")]
pub struct ColliderPath {
    /// Name of the session.
    id: String,
    /// Name of the collider, `[A-Za-z0-9_-]{1,64}`.
    cid: String,
}

/// Path parameters of everything about a restore point.
#[derive(IntoParams)]
#[into_params(parameter_in = Path)]
#[expect(dead_code, reason = "it only describes the parameters")]
pub struct CheckpointPath {
    /// Name of the session.
    id: String,
    /// Name of the restore point, `[A-Za-z0-9_-]{1,64}`.
    name: String,
}

/// What a client may hold already.
#[derive(IntoParams)]
#[into_params(parameter_in = Header)]
#[expect(dead_code, reason = "it only describes the parameter")]
pub struct Held {
    /// ETags of what the client holds, or `*`; compared weakly.
    #[param(rename = "If-None-Match")]
    if_none_match: Option<String>,
}

/// Problems of every call about a session.
#[derive(IntoResponses)]
#[expect(dead_code, reason = "it only describes the responses")]
pub enum SessionProblems {
    /// There is no such session, or nothing of that name in it.
    #[response(status = 404, content_type = "application/problem+json")]
    NotFound(Problem),
    /// The session came back from a damaged store, and takes no changes until it is unlocked.
    #[response(status = 423, content_type = "application/problem+json")]
    Locked(Problem),
    /// Handling the request failed inside the server.
    #[response(status = 500, content_type = "application/problem+json")]
    Internal(Problem),
    /// The server is bringing sessions back or stopping, its engine has failed, its data directory is
    /// gone, or the time limit of requests is over.
    #[response(status = 503, content_type = "application/problem+json")]
    Unavailable(Problem),
    /// The change can't be stored, and was not made; or the session hibernates and there is no
    /// device memory to wake it.
    #[response(status = 507, content_type = "application/problem+json")]
    Full(Problem),
}

/// Problems of what alpine snow only has.
#[derive(IntoResponses)]
#[expect(dead_code, reason = "it only describes the responses")]
pub enum AlpineProblems {
    /// The session's snow is not alpine.
    #[response(status = 409, content_type = "application/problem+json")]
    Conflict(Problem),
}

/// Problems of every call with a JSON body.
#[derive(IntoResponses)]
#[expect(dead_code, reason = "it only describes the responses")]
pub enum BodyProblems {
    /// The body is not JSON.
    #[response(status = 400, content_type = "application/problem+json")]
    Malformed(Problem),
    /// The body is larger than the server reads.
    #[response(status = 413, content_type = "application/problem+json")]
    TooLarge(Problem),
    /// The body is not `application/json`.
    #[response(status = 415, content_type = "application/problem+json")]
    UnsupportedMediaType(Problem),
    /// Fields are invalid, unknown, missing, or beyond a limit; the problem names each.
    #[response(status = 422, content_type = "application/problem+json")]
    Invalid(Problem),
}

/// Problems of calls with query or path parameters that have a range.
#[derive(IntoResponses)]
#[expect(dead_code, reason = "it only describes the responses")]
pub enum ParameterProblems {
    /// Parameters are invalid, unknown or missing; the problem names each.
    #[response(status = 422, content_type = "application/problem+json")]
    Invalid(Problem),
}
