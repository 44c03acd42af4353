//! What clients are told when a request fails: problem details after RFC 9457, the same over HTTP
//! and the stream.

mod json;
mod strict;

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use crate::diagram::ChartError;
use crate::engine::frame::EngineError;
use crate::render::RenderError;
use crate::session::{Invalid, SessionError};

pub use json::parse;

/// Seconds after which a request may be tried again that a total of the server refused.
const RETRY_WHEN_FULL: u32 = 60;

/// Seconds after which a request may be tried again that came at a bad time.
const RETRY_WHEN_READY: u32 = 5;

/// Why a request was not carried out.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct Problem {
    /// Stable name of this kind of problem: `urn:firn:problem:…`.
    #[serde(rename = "type")]
    pub kind: String,
    /// What kind of problem it is, in words.
    pub title: String,
    /// HTTP status.
    #[schema(minimum = 400, maximum = 599)]
    pub status: u16,
    /// What was wrong with this request.
    pub detail: String,
    /// Each part of the request that was wrong; may be empty.
    pub errors: Vec<FieldError>,
    /// Seconds after which trying again makes sense; sent as `Retry-After`.
    #[serde(skip)]
    pub retry_after: Option<u32>,
}

/// A part of a request that can't be accepted.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct FieldError {
    /// JSON pointer to the field in the body, or the name of a path or query parameter.
    pub pointer: String,
    /// What was expected and what was found.
    pub detail: String,
}

impl Problem {
    fn new(status: StatusCode, name: &str, title: &str, detail: impl Into<String>) -> Problem {
        Problem {
            kind: format!("urn:firn:problem:{name}"),
            title: title.to_owned(),
            status: status.as_u16(),
            detail: detail.into(),
            errors: Vec::new(),
            retry_after: None,
        }
    }

    fn retry_after(self, seconds: u32) -> Problem {
        Problem { retry_after: Some(seconds), ..self }
    }

    /// 400: the request can't be read at all.
    pub fn malformed(detail: impl Into<String>) -> Problem {
        Problem::new(StatusCode::BAD_REQUEST, "malformed", "The request can't be read", detail)
    }

    /// 401: a token is missing, or is none that this server knows.
    pub fn unauthorized(detail: impl Into<String>) -> Problem {
        Problem::new(StatusCode::UNAUTHORIZED, "unauthorized", "A token is needed", detail)
    }

    /// 403: known, but not allowed.
    pub fn forbidden(detail: impl Into<String>) -> Problem {
        Problem::new(StatusCode::FORBIDDEN, "forbidden", "Not allowed", detail)
    }

    /// 404: there is no such thing.
    pub fn not_found(detail: impl Into<String>) -> Problem {
        Problem::new(StatusCode::NOT_FOUND, "not-found", "Not found", detail)
    }

    /// 405: the path exists, but not with this method.
    pub fn method_not_allowed(detail: impl Into<String>) -> Problem {
        let status = StatusCode::METHOD_NOT_ALLOWED;
        Problem::new(status, "method-not-allowed", "Method not allowed", detail)
    }

    /// 406: the answer exists in none of the accepted media types.
    pub fn not_acceptable(detail: impl Into<String>) -> Problem {
        let status = StatusCode::NOT_ACCEPTABLE;
        Problem::new(status, "not-acceptable", "No acceptable media type", detail)
    }

    /// 409: the present state does not allow it.
    pub fn conflict(detail: impl Into<String>) -> Problem {
        Problem::new(StatusCode::CONFLICT, "conflict", "Conflict with the present state", detail)
    }

    /// 413: the body, or the answer that was asked for, is too large.
    pub fn too_large(detail: impl Into<String>) -> Problem {
        Problem::new(StatusCode::PAYLOAD_TOO_LARGE, "too-large", "Too large", detail)
    }

    /// 415: the body is of another media type than expected.
    pub fn unsupported_media_type(detail: impl Into<String>) -> Problem {
        let status = StatusCode::UNSUPPORTED_MEDIA_TYPE;
        Problem::new(status, "unsupported-media-type", "Unsupported media type", detail)
    }

    /// 421: the request was meant for another server.
    pub fn misdirected(detail: impl Into<String>) -> Problem {
        let status = StatusCode::MISDIRECTED_REQUEST;
        Problem::new(status, "misdirected", "Meant for another server", detail)
    }

    /// 422: fields are invalid, unknown, missing or beyond a limit of a session.
    pub fn invalid(errors: Vec<FieldError>) -> Problem {
        let detail = match errors.as_slice() {
            [only] if only.pointer.is_empty() => only.detail.clone(),
            [only] => format!("{}: {}", only.pointer, only.detail),
            _ => format!("{} parts of the request are not valid", errors.len()),
        };
        let status = StatusCode::UNPROCESSABLE_ENTITY;
        Problem { errors, ..Problem::new(status, "invalid", "The request is not valid", detail) }
    }

    /// 422 for one field.
    pub fn invalid_field(pointer: impl Into<String>, detail: impl Into<String>) -> Problem {
        Problem::invalid(vec![FieldError { pointer: pointer.into(), detail: detail.into() }])
    }

    /// 429: more requests than are taken; try again after some seconds.
    pub fn too_many_requests(detail: impl Into<String>, seconds: u32) -> Problem {
        let status = StatusCode::TOO_MANY_REQUESTS;
        Problem::new(status, "too-many-requests", "Too many requests", detail).retry_after(seconds)
    }

    /// 500: handling the request failed inside the server.
    pub fn internal(detail: impl Into<String>) -> Problem {
        Problem::new(StatusCode::INTERNAL_SERVER_ERROR, "internal", "Internal error", detail)
    }

    /// 501: this server can't do it, whatever is asked.
    pub fn not_implemented(detail: impl Into<String>) -> Problem {
        let status = StatusCode::NOT_IMPLEMENTED;
        Problem::new(status, "not-implemented", "Not possible on this server", detail)
    }

    /// 507: the device's memory is full.
    pub fn out_of_memory(detail: impl Into<String>) -> Problem {
        let status = StatusCode::INSUFFICIENT_STORAGE;
        Problem::new(status, "out-of-memory", "Device memory is full", detail)
    }

    /// 507: what was asked for can't be stored.
    pub fn storage_failed(detail: impl Into<String>) -> Problem {
        let status = StatusCode::INSUFFICIENT_STORAGE;
        Problem::new(status, "storage-failed", "Changes can't be stored", detail)
    }

    /// 503: not ready, stopping, or too slow just now.
    pub fn unavailable(detail: impl Into<String>) -> Problem {
        let status = StatusCode::SERVICE_UNAVAILABLE;
        Problem::new(status, "unavailable", "Not available now", detail)
            .retry_after(RETRY_WHEN_READY)
    }
}

impl From<Invalid> for FieldError {
    fn from(invalid: Invalid) -> FieldError {
        FieldError { pointer: invalid.pointer, detail: invalid.detail }
    }
}

impl From<SessionError> for Problem {
    fn from(error: SessionError) -> Problem {
        let detail = error.to_string();
        match error {
            SessionError::NotFound { .. } => Problem::not_found(detail),
            SessionError::Conflict(_) => Problem::conflict(detail),
            SessionError::Forbidden(_) => Problem::forbidden(detail),
            SessionError::Invalid(fields) => {
                Problem::invalid(fields.into_iter().map(FieldError::from).collect())
            }
            SessionError::ServerFull(_) => {
                let status = StatusCode::TOO_MANY_REQUESTS;
                Problem::new(status, "server-full", "The server is full", detail)
                    .retry_after(RETRY_WHEN_FULL)
            }
            SessionError::OutOfMemory(_) => Problem::out_of_memory(detail),
            SessionError::StorageFailed(_) => Problem::storage_failed(detail),
            SessionError::Unavailable(_) => Problem::unavailable(detail),
            SessionError::Internal(_) => Problem::internal(detail),
        }
    }
}

impl From<RenderError> for Problem {
    fn from(error: RenderError) -> Problem {
        let detail = error.to_string();
        match error {
            RenderError::Busy => Problem::unavailable(detail),
            RenderError::Engine(EngineError::NoAdapter(_)) => Problem::not_implemented(detail),
            RenderError::Engine(EngineError::OutOfMemory(_)) => Problem::out_of_memory(detail),
            RenderError::Engine(EngineError::DeviceFailed(_))
            | RenderError::Panicked
            | RenderError::Encoding(_) => Problem::internal(detail),
        }
    }
}

impl From<ChartError> for Problem {
    fn from(error: ChartError) -> Problem {
        Problem::internal(error.to_string())
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let body = serde_json::to_vec(&self).unwrap_or_default();
        let media_type = HeaderValue::from_static("application/problem+json");
        let mut response = (status, [(header::CONTENT_TYPE, media_type)], body).into_response();
        if let Some(seconds) = self.retry_after {
            response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        if status == StatusCode::UNAUTHORIZED {
            let scheme = HeaderValue::from_static("Bearer realm=\"firn\"");
            response.headers_mut().insert(header::WWW_AUTHENTICATE, scheme);
        }
        response
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_session_error_has_its_status() {
        let cases = [
            (SessionError::Forbidden(String::new()), 403),
            (SessionError::NotFound { kind: "session", id: "a".into() }, 404),
            (SessionError::Conflict(String::new()), 409),
            (SessionError::Invalid(Vec::new()), 422),
            (SessionError::ServerFull(String::new()), 429),
            (SessionError::Internal(String::new()), 500),
            (SessionError::Unavailable(String::new()), 503),
            (SessionError::OutOfMemory(String::new()), 507),
            (SessionError::StorageFailed(String::new()), 507),
        ];
        for (error, status) in cases {
            assert_eq!(Problem::from(error.clone()).status, status, "{error:?}");
        }
    }

    #[test]
    fn a_full_server_says_when_to_come_back() {
        let response = Problem::from(SessionError::ServerFull("full".into())).into_response();
        assert_eq!(response.headers()[header::RETRY_AFTER], "60");
        assert_eq!(response.headers()[header::CONTENT_TYPE], "application/problem+json");
    }
}
