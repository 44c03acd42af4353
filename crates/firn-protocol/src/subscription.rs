//! Subscriptions of a stream: region, rate, events, watches, and where to resume.

use serde::{Deserialize, Serialize};

use crate::events::Events;

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
    /// Whether the ground is wanted: of each tile once, and again when it changes.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub terrain: bool,
    /// Which events are wanted. Where it is not said: all under `firn.v1.json`, none under `firn.v1.bin`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub events: Option<Events>,
    /// Depths whose crossing is told, at most [`MOST_WATCHES`].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub watch: Vec<DepthWatch>,
    /// State up to which the client has seen everything; with `terrain` the ground too.
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
            terrain: false,
            events: None,
            watch: Vec::new(),
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

/// Watches of one subscription, at most.
pub const MOST_WATCHES: usize = 16;

/// A mean depth whose crossing is told by [`Event::Watch`](crate::Event::Watch): exactly one of `above` and
/// `below` is given.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthWatch {
    /// Its name, `[A-Za-z0-9_-]{1,64}`; no other watch of the subscription has it.
    pub id: String,
    /// Columns whose mean depth counts, not widened to tiles; the whole grid where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<ColumnRegion>,
    /// It holds while the mean depth of the snow is above this \[m\], from 0 to the height of the grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub above: Option<f64>,
    /// It holds while the mean depth of the snow is below this \[m\], from 0 to the height of the grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub below: Option<f64>,
}

/// Changes to a subscription.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Update {
    /// Columns wanted; the whole grid where there is none.
    pub region: Option<ColumnRegion>,
    /// Which events are wanted; as before if it is not said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub events: Option<Events>,
    /// New watches, which replace those before; these stay if it is not said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub watch: Option<Vec<DepthWatch>>,
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
