//! Stamps: prints that loads press into the snow at once.

use firn_snow::{Position, Shape};
use serde::{Deserialize, Serialize};

use crate::session::Stamp;

/// Loads that press prints into the snow, in one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct StampBatch {
    /// The loads, in order: where prints overlap, a later one is pressed into the snow that the earlier one left.
    /// Together they may cover 4 194 304 columns.
    #[cfg_attr(feature = "schema", schema(min_items = 1, max_items = 4096))]
    pub stamps: Vec<StampSpec>,
}

/// A load that presses a print and is gone.
///
/// It has either a `mass` or a `pressure`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct StampSpec {
    /// Outline from above; any but a wheel.
    pub shape: Shape,
    /// Where its centre is \[m\]. The outline must cover some of the grid.
    pub position: Position,
    /// Compass bearing of its front \[°\].
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(minimum = -36_000, maximum = 36_000))]
    pub heading: f64,
    /// Mass \[kg\], spread over the whole outline.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0, maximum = 1e9))]
    pub mass: Option<f64>,
    /// Pressure \[Pa\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0, maximum = 1e9))]
    pub pressure: Option<f64>,
}

/// Answer to stamps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct StampReply {
    /// When it was applied.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// The print of each, in their order.
    pub stamps: Vec<PrintView>,
}

/// A print in the snow.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct PrintView {
    /// How deep the deepest of its columns was pressed \[m\].
    pub depth: f64,
    /// Elevation of the lowest surface in it afterwards \[m\].
    pub bottom: f64,
}
