//! What can go wrong with a request or a stream.

use firn_protocol::Problem;
use reqwest::StatusCode;

/// Why a request or a stream failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// It is not an address that this client can ask.
    #[error("'{0}' is not an address without TLS, such as http://127.0.0.1:8080")]
    Address(String),
    /// The API key can't be sent.
    #[error("the API key contains characters that a header can't carry")]
    Key,
    /// No session or object can have that name.
    #[error("'{0}' is not a name: it has to match [A-Za-z0-9_-]{{1,64}}")]
    Name(String),
    /// There was no answer. Where the connection was lost after the request was sent, it may still have been
    /// carried out.
    #[error("{url} can't be reached: {why}")]
    Unreachable {
        /// The request or address.
        url: String,
        /// The reason.
        why: String,
    },
    /// The server refused it. Nothing has changed, unless its status is 503 or 504: then what was asked for
    /// may still happen.
    #[error("{what} was answered with {}: {}", .problem.status, .problem.detail)]
    Refused {
        /// The request or address.
        what: String,
        /// The server's problem details.
        problem: Box<Problem>,
    },
    /// The answer broke off, or is not what it should be.
    #[error("the answer to {what} can't be read: {why}")]
    Unreadable {
        /// The request or address.
        what: String,
        /// The reason.
        why: String,
    },
    /// The server has closed the stream.
    #[error("closed with {code}: {reason}")]
    Closed {
        /// The code, as in [`firn_protocol::stream::Cause::close`]; 1005 where there was none.
        code: u16,
        /// The reason, in words.
        reason: String,
    },
    /// The stream's connection is gone.
    #[error("connection lost: {0}")]
    Lost(String),
}

impl Error {
    /// The problem that the server told, where it refused.
    pub fn problem(&self) -> Option<&Problem> {
        match self {
            Error::Refused { problem, .. } => Some(problem),
            _ => None,
        }
    }
}

/// A refusal, as the server tells it or, where something in between answered, as its status says.
pub(crate) fn refused(what: String, status: StatusCode, told: &[u8]) -> Error {
    let problem = serde_json::from_slice(told).unwrap_or_else(|_| Problem {
        kind: "about:blank".to_owned(),
        title: status.canonical_reason().unwrap_or("refused").to_owned(),
        status: status.as_u16(),
        detail: "no details".to_owned(),
        errors: Vec::new(),
    });
    Error::Refused { what, problem: Box::new(problem) }
}

/// What is behind an error: the outer ones repeat what was tried.
pub(crate) fn root_cause(error: &dyn std::error::Error) -> String {
    error.source().map_or_else(|| error.to_string(), root_cause)
}
