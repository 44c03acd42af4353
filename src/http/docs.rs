//! The OpenAPI document, made from the handlers' annotations.

use utoipa::openapi::{RefOr, Required};
use utoipa::{IntoParams, IntoResponses, OpenApi};

use crate::problem::Problem;

use super::router;

/// The OpenAPI document of the REST interface.
pub fn document() -> utoipa::openapi::OpenApi {
    let mut document = router::routes().into_openapi();
    // The one body that may be left out; the annotations can't say so.
    let creation = document.paths.paths.get_mut("/v1/sessions").and_then(|path| path.post.as_mut());
    if let Some(RefOr::T(body)) = creation.and_then(|post| post.request_body.as_mut()) {
        body.required = Some(Required::False);
    }
    document
}

/// What the document says beside the calls.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "Firn",
        description = "Simulates snowpacks on the GPU: create a session, let snow fall, put \
            objects on it, and read how it settles.\n\nSI units and °C throughout; positions are \
            metres unless they are called `column`. A change is applied in the next frame, between \
            two ticks, and is acknowledged once it is visible to the next read. Every error is an \
            `application/problem+json` document (RFC 9457) that names the fields that were wrong.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0")
    ),
    servers((url = "/", description = "The server this document comes from")),
    tags(
        (name = "sessions", description = "Snowpacks: their configuration, clock and summary"),
        (name = "weather", description = "Snowfalls, clearings and the air"),
        (name = "colliders", description = "Objects that stand on the snow"),
        (name = "snow", description = "Reading the snow"),
        (name = "operations", description = "The server itself")
    ),
    components(schemas(Problem))
)]
pub struct Document;

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
    /// Handling the request failed inside the server.
    #[response(status = 500, content_type = "application/problem+json")]
    Internal(Problem),
    /// The server is stopping, its engine has failed, or the time limit of requests is over.
    #[response(status = 503, content_type = "application/problem+json")]
    Unavailable(Problem),
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
