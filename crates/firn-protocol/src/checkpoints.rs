//! Restore points of a session, and where a reset leads to.

use serde::{Deserialize, Serialize};

/// A restore point: a state of a session that is kept under a name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct CheckpointView {
    /// Its name.
    pub name: String,
    /// Tick of the state.
    pub tick: u64,
    /// Simulated time of the state \[s\].
    pub sim_time: f64,
    /// When it was kept, RFC 3339.
    pub created_at: String,
    /// Length of its snapshot \[bytes\].
    pub bytes: u64,
}

/// The restore points of a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct CheckpointList {
    /// All of them, in ascending order of their names.
    pub items: Vec<CheckpointView>,
}

/// Body of `POST …/reset`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ResetSpec {
    /// Name of the restore point to go back to; `null` for the state that the session was created in.
    pub checkpoint: Option<String>,
}
