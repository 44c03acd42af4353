//! What clients are told when a request fails: problem details after RFC 9457, the same over HTTP
//! and the stream.

mod json;
mod strict;

use std::borrow::Cow;
use std::ops::Deref;

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use crate::limit::Limit;

pub use firn_protocol::FieldError;
pub use json::parse;

/// Seconds after which a request may be tried again that a total of the server refused.
const RETRY_WHEN_FULL: u32 = 60;

/// Parts of a request that are told to be wrong, at the most.
const MOST_ERRORS: usize = 100;

/// Seconds after which a request may be tried again that came at a bad time.
const RETRY_WHEN_READY: u32 = 5;

/// Why a request was not carried out, and what the server does about it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Problem {
    /// What the client is told.
    #[serde(flatten)]
    told: firn_protocol::Problem,
    /// Seconds after which trying again makes sense; sent as `Retry-After`.
    #[serde(skip)]
    pub retry_after: Option<u32>,
    /// The limit that it met, where it was one.
    #[serde(skip)]
    pub limit: Option<Limit>,
}

impl Deref for Problem {
    type Target = firn_protocol::Problem;

    fn deref(&self) -> &firn_protocol::Problem {
        &self.told
    }
}

impl PartialSchema for Problem {
    fn schema() -> RefOr<Schema> {
        firn_protocol::Problem::schema()
    }
}

impl ToSchema for Problem {
    fn name() -> Cow<'static, str> {
        firn_protocol::Problem::name()
    }

    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        firn_protocol::Problem::schemas(schemas);
    }
}

impl Problem {
    fn new(status: StatusCode, name: &str, title: &str, detail: impl Into<String>) -> Problem {
        let told = firn_protocol::Problem {
            kind: format!("urn:firn:problem:{name}"),
            title: title.to_owned(),
            status: status.as_u16(),
            detail: detail.into(),
            errors: Vec::new(),
        };
        Problem { told, retry_after: None, limit: None }
    }

    fn retry_after(self, seconds: u32) -> Problem {
        Problem { retry_after: Some(seconds), ..self }
    }

    /// The same, because of a limit, so that it is counted.
    pub fn from_limit(self, limit: Limit) -> Problem {
        Problem { limit: Some(limit), ..self }
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
    pub fn invalid(mut errors: Vec<FieldError>) -> Problem {
        let detail = match errors.as_slice() {
            [only] if only.pointer.is_empty() => only.detail.clone(),
            [only] => format!("{}: {}", only.pointer, only.detail),
            all if all.len() > MOST_ERRORS => {
                let count = all.len();
                format!(
                    "{count} parts of the request are not valid; these are the first {MOST_ERRORS}"
                )
            }
            all => format!("{} parts of the request are not valid", all.len()),
        };
        errors.truncate(MOST_ERRORS);
        errors.shrink_to_fit();
        let status = StatusCode::UNPROCESSABLE_ENTITY;
        let mut problem = Problem::new(status, "invalid", "The request is not valid", detail);
        problem.told.errors = errors;
        problem
    }

    /// 422 for one field.
    pub fn invalid_field(pointer: impl Into<String>, detail: impl Into<String>) -> Problem {
        Problem::invalid(vec![FieldError { pointer: pointer.into(), detail: detail.into() }])
    }

    /// 429: the server holds as much as it may.
    pub fn server_full(detail: impl Into<String>) -> Problem {
        let status = StatusCode::TOO_MANY_REQUESTS;
        Problem::new(status, "server-full", "The server is full", detail)
            .retry_after(RETRY_WHEN_FULL)
            .from_limit(Limit::ServerFull)
    }

    /// 429: a tenant holds as much as it may, or asks for more than it may.
    pub fn quota_reached(detail: impl Into<String>) -> Problem {
        let status = StatusCode::TOO_MANY_REQUESTS;
        Problem::new(status, "quota-reached", "A quota is reached", detail)
            .retry_after(RETRY_WHEN_FULL)
            .from_limit(Limit::Quota)
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

    /// 507: the server's own memory is full.
    pub fn no_memory(detail: impl Into<String>) -> Problem {
        let status = StatusCode::INSUFFICIENT_STORAGE;
        Problem::new(status, "no-memory", "Memory is full", detail)
    }

    /// 507: what was asked for can't be stored.
    pub fn storage_failed(detail: impl Into<String>) -> Problem {
        let status = StatusCode::INSUFFICIENT_STORAGE;
        Problem::new(status, "storage-failed", "Changes can't be stored", detail)
    }

    /// 503: what is stored is gone, and nothing can be added to it.
    pub fn storage_gone(detail: impl Into<String>) -> Problem {
        let status = StatusCode::SERVICE_UNAVAILABLE;
        Problem::new(status, "storage-gone", "What is stored is gone", detail)
            .retry_after(RETRY_WHEN_FULL)
    }

    /// 423: an administrator has to say first that it is as it should be.
    pub fn locked(detail: impl Into<String>) -> Problem {
        Problem::new(StatusCode::LOCKED, "locked", "The session is locked", detail)
    }

    /// 503: not ready, stopping, or too slow just now.
    pub fn unavailable(detail: impl Into<String>) -> Problem {
        let status = StatusCode::SERVICE_UNAVAILABLE;
        Problem::new(status, "unavailable", "Not available now", detail)
            .retry_after(RETRY_WHEN_READY)
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let body = serde_json::to_vec(&self).unwrap_or_default();
        let media_type = HeaderValue::from_static("application/problem+json");
        let mut response = (status, [(header::CONTENT_TYPE, media_type)], body).into_response();
        if let Some(limit) = self.limit {
            response.extensions_mut().insert(limit);
        }
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
