//! Memory and device time that a session uses.

use std::ops::AddAssign;

use serde::{Deserialize, Serialize};

/// Memory that a session takes \[bytes\].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct MemoryBytes {
    /// On the device: its cells. None while it hibernates.
    pub device: u64,
    /// What reads are served from, and what the engine knows of it beside its cells: heights, ground
    /// and objects.
    pub host: u64,
    /// What brings it back: its newest checkpoint and the changes since, the snapshot that it was made
    /// from, and the answers to requests with an `Idempotency-Key`.
    pub journal: u64,
    /// Tiles encoded for its streams, and the buffers of those that are open.
    pub streams: u64,
}

/// What a session takes of the server.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct UsageView {
    /// Device time that it has been charged with since the server was started \[s\].
    pub device_seconds: f64,
    /// Memory, by what it is for.
    pub memory_bytes: MemoryBytes,
}

impl AddAssign for MemoryBytes {
    fn add_assign(&mut self, other: MemoryBytes) {
        self.device += other.device;
        self.host += other.host;
        self.journal += other.journal;
        self.streams += other.streams;
    }
}
