//! Objects that stand on the snow.

use firn_snow::{Position, Shape};
use serde::{Deserialize, Serialize};

use crate::session::Stamp;

/// An object that stands on the snow.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ColliderSpec {
    /// Name, `[A-Za-z0-9_-]{1,64}`; the server makes a ULID where there is none.
    pub id: Option<String>,
    /// Mass \[kg\].
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0, maximum = 1e9))]
    pub mass: f64,
    /// Outline from above.
    pub shape: Shape,
    /// Where its centre is \[m\].
    pub position: Position,
}

/// Body of `PATCH …/colliders/{cid}`: the parts that change; others stay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ColliderPatch {
    /// Mass \[kg\].
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0, maximum = 1e9))]
    pub mass: Option<f64>,
    /// Outline from above.
    pub shape: Option<Shape>,
    /// Where its centre is \[m\].
    pub position: Option<Position>,
}

/// Colliders put and removed in one frame, all or none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ColliderBatch {
    /// Colliders to create or replace; each needs an `id`.
    pub put: Vec<ColliderSpec>,
    /// Ids of colliders to remove.
    pub delete: Vec<String>,
}

/// An object on the snow and how it stands there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ColliderView {
    /// Its name.
    pub id: String,
    /// Mass \[kg\].
    pub mass: f64,
    /// Outline from above.
    pub shape: Shape,
    /// Where its centre is \[m\].
    pub position: Position,
    /// Elevation of its bottom \[m\].
    pub bottom: f64,
    /// How far its bottom is below the highest of its columns at the time it was placed or last
    /// moved \[m\].
    pub sink_depth: f64,
    /// Area in contact \[m²\].
    pub contact_area: f64,
    /// Pressure on the area in contact \[Pa\].
    pub pressure: f64,
    /// Whether its bottom and contact stayed as they were over the last cycle.
    pub resting: bool,
}

/// Answer to a collider that was put or patched.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ColliderReply {
    /// When it was applied.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// The collider.
    #[serde(flatten)]
    pub collider: ColliderView,
}
