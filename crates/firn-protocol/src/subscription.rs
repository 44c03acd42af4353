//! Subscriptions of a stream: region, rate, and where to resume.

use serde::{Deserialize, Serialize};

/// What a subscription wants.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Subscribe {
    /// Columns wanted; the whole grid where there is none.
    pub region: Option<ColumnRegion>,
    /// Every how many columns one is sent: 1, 2, 4 or 8.
    pub stride: u32,
    /// Most messages per second \[Hz\], 0.1 to 60.
    pub max_rate: f64,
    /// Step that heights are rounded to \[m\], 0.0001 to 1.
    pub quantum: f64,
    /// Whether colliders are wanted.
    pub colliders: bool,
    /// State up to which the client has seen everything.
    pub resume: Option<Resume>,
}

impl Default for Subscribe {
    fn default() -> Self {
        Subscribe {
            region: None,
            stride: 1,
            max_rate: 20.0,
            quantum: 0.001,
            colliders: false,
            resume: None,
        }
    }
}

/// Names a state that a client has.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resume {
    /// Epoch of the session.
    pub epoch: String,
    /// Newest seq that the client has seen.
    pub seq: u64,
}

/// Where a subscription moves to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Update {
    /// Columns wanted; the whole grid where there is none.
    pub region: Option<ColumnRegion>,
}

/// A rectangle of columns. It may reach beyond the grid, but has to meet it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColumnRegion {
    /// First column along x.
    pub column_x: i64,
    /// First column along z.
    pub column_z: i64,
    /// Columns along x, at least 1.
    pub width: u64,
    /// Columns along z, at least 1.
    pub depth: u64,
}
