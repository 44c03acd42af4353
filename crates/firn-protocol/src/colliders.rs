//! Objects that stand on the snow.

use firn_snow::{Body, Part, Position, Shape};
use serde::{Deserialize, Serialize};

use crate::problem::FieldError;
use crate::session::Stamp;

/// An object that stands on the snow.
///
/// It has either a `shape` or `footprints`. One of its columns must be in the grid; the part beyond the edge is
/// fully supported.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ColliderSpec {
    /// Name, `[A-Za-z0-9_-]{1,64}`; the server makes a ULID where there is none.
    pub id: Option<String>,
    /// Mass \[kg\].
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0, maximum = 1e9))]
    pub mass: f64,
    /// Outline from above, if it has just one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<Shape>,
    /// Its outlines, if it has several: the feet of a walker, the wheels of a car. It is one rigid body, and each
    /// outline carries a part of its weight according to its contact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(min_items = 1, max_items = 16))]
    pub footprints: Option<Vec<Part>>,
    /// Where its centre is \[m\].
    pub position: Position,
    /// Compass bearing of its front \[°\]: 0 along +z (north), 90 along +x (east).
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(minimum = -36_000, maximum = 36_000))]
    pub heading: f64,
    /// Whether it is held up and does not press the snow.
    #[serde(default)]
    pub airborne: bool,
}

impl ColliderSpec {
    /// The object without its name.
    pub fn body(&self) -> Body {
        Body {
            mass: self.mass,
            shape: self.shape.clone(),
            footprints: self.footprints.clone().unwrap_or_default(),
            position: self.position,
            heading: self.heading,
            airborne: self.airborne,
        }
    }
}

/// Body of `PATCH …/colliders/{cid}`: the parts that change; others stay.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ColliderPatch {
    /// Mass \[kg\].
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0, maximum = 1e9))]
    pub mass: Option<f64>,
    /// New outline from above; it replaces footprints too.
    pub shape: Option<Shape>,
    /// New outlines; they replace a single shape too.
    #[cfg_attr(feature = "schema", schema(min_items = 1, max_items = 16))]
    pub footprints: Option<Vec<Part>>,
    /// Where its centre is \[m\].
    pub position: Option<Position>,
    /// Compass bearing of its front \[°\].
    #[cfg_attr(feature = "schema", schema(minimum = -36_000, maximum = 36_000))]
    pub heading: Option<f64>,
    /// Whether it is held up.
    pub airborne: Option<bool>,
}

impl ColliderPatch {
    /// The object with these changes.
    pub fn apply(self, old: &Body) -> ColliderSpec {
        let outline = match (self.shape, self.footprints) {
            (None, None) => {
                (old.shape.clone(), Some(old.footprints.clone()).filter(|it| !it.is_empty()))
            }
            given => given,
        };
        ColliderSpec {
            id: None,
            mass: self.mass.unwrap_or(old.mass),
            shape: outline.0,
            footprints: outline.1,
            position: self.position.unwrap_or(old.position),
            heading: self.heading.unwrap_or(old.heading),
            airborne: self.airborne.unwrap_or(old.airborne),
        }
    }
}

/// Colliders put and removed in one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ColliderBatch {
    /// Colliders to create or replace; each needs an `id`.
    pub put: Vec<ColliderSpec>,
    /// Ids of colliders to remove. One that is not there is no error.
    pub delete: Vec<String>,
    /// What happens if one of them is invalid.
    pub on_error: OnError,
}

/// What a batch does if one of its entries is invalid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum OnError {
    /// Nothing is carried out.
    #[default]
    Refuse,
    /// The others are carried out; the answer has a result for each entry.
    Skip,
}

/// Answer to a batch of colliders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct BatchReply {
    /// When it was applied.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// The result of each entry, if errors are skipped.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub results: Option<BatchResults>,
}

/// Results of a batch, entry by entry.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct BatchResults {
    /// One for each entry of `put`, in their order.
    pub put: Vec<BatchResult>,
    /// One for each entry of `delete`, in their order.
    pub delete: Vec<BatchResult>,
}

/// Result of one entry of a batch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct BatchResult {
    /// Name of the collider, if the entry has one.
    pub id: Option<String>,
    /// What happened to it.
    pub result: BatchOutcome,
    /// Why it was skipped: what is wrong, and where in the batch.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<FieldError>,
}

/// What happened to an entry of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum BatchOutcome {
    /// A collider was created.
    Created,
    /// A collider was replaced.
    Replaced,
    /// A collider was removed.
    Removed,
    /// There was no collider of that name.
    Absent,
    /// The entry was invalid, and nothing was done.
    Skipped,
}

/// An object on the snow and how it stands there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ColliderView {
    /// Its name.
    pub id: String,
    /// What it is, and where it stands.
    #[serde(flatten)]
    pub body: Body,
    /// Elevation of its bottom \[m\].
    pub bottom: f64,
    /// How far its bottom is below the highest of its columns at the time it was placed or last
    /// moved \[m\].
    pub sink_depth: f64,
    /// Area in contact \[m²\]; 0 while it is held up, as is its pressure.
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
