//! What clients are told of what went wrong with a session, a picture or a chart.

use firn_engine::frame::EngineError;

use crate::diagram::ChartError;
use crate::limit::Limit;
use crate::problem::{FieldError, Problem};
use crate::render::RenderError;
use crate::session::{Invalid, SessionError};

/// Seconds after which a request may be tried again where others are to be answered first.
const RETRY_WHEN_ANSWERED: u32 = 1;

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
            SessionError::TooManyWaiting(_) => {
                Problem::too_many_requests(detail, RETRY_WHEN_ANSWERED)
                    .from_limit(Limit::WaitingRequests)
            }
            SessionError::ServerFull(_) => Problem::server_full(detail),
            SessionError::QuotaReached(_) => Problem::quota_reached(detail),
            SessionError::OutOfMemory(_) => Problem::out_of_memory(detail),
            SessionError::NoMemory(_) => Problem::no_memory(detail),
            SessionError::StorageFailed(_) => Problem::storage_failed(detail),
            SessionError::StorageGone(_) => Problem::storage_gone(detail),
            SessionError::Locked(_) => Problem::locked(detail),
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

#[cfg(test)]
mod tests {
    use axum::http::header;
    use axum::response::IntoResponse;

    use super::*;

    #[test]
    fn each_session_error_has_its_status() {
        let cases = [
            (SessionError::Forbidden(String::new()), 403),
            (SessionError::NotFound { kind: "session", id: "a".into() }, 404),
            (SessionError::Conflict(String::new()), 409),
            (SessionError::Invalid(Vec::new()), 422),
            (SessionError::ServerFull(String::new()), 429),
            (SessionError::TooManyWaiting(String::new()), 429),
            (SessionError::QuotaReached(String::new()), 429),
            (SessionError::Internal(String::new()), 500),
            (SessionError::Unavailable(String::new()), 503),
            (SessionError::OutOfMemory(String::new()), 507),
            (SessionError::NoMemory(String::new()), 507),
            (SessionError::StorageFailed(String::new()), 507),
            (SessionError::StorageGone(String::new()), 503),
            (SessionError::Locked(String::new()), 423),
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
