//! Problem details: the answer to a request that failed.

use serde::{Deserialize, Serialize};

/// Why a request was not carried out: problem details after RFC 9457, the same over HTTP and the stream.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Problem {
    /// Stable name of this kind of problem: `urn:firn:problem:…`.
    #[serde(rename = "type")]
    pub kind: String,
    /// What kind of problem it is, in words.
    pub title: String,
    /// HTTP status.
    #[cfg_attr(feature = "schema", schema(minimum = 400, maximum = 599))]
    pub status: u16,
    /// What was wrong with this request.
    pub detail: String,
    /// Each part of the request that was wrong, the first hundred of them; may be empty.
    pub errors: Vec<FieldError>,
}

/// A part of a request that can't be accepted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FieldError {
    /// JSON pointer to the field in the body, or the name of a path or query parameter.
    pub pointer: String,
    /// What was expected and what was found.
    pub detail: String,
}
