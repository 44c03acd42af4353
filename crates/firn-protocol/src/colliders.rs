//! Objects that stand on the snow.

use firn_snow::{Body, Motion, Part, Position, Shape, path_length};
use serde::{Deserialize, Serialize};

use crate::problem::FieldError;
use crate::session::Stamp;

/// An object that stands on the snow.
///
/// It has either a `shape` or `footprints`. One of its columns must be in the grid; the part beyond the edge is
/// fully supported.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// Whether snow that falls on its columns lies on it, as its burden, rather than falls through it.
    #[serde(default = "yes")]
    #[cfg_attr(feature = "schema", schema(default = true))]
    pub shelters: bool,
    /// Velocity along x and z \[m/s\], 100 m/s at the most. The object moves until another velocity is set or it
    /// reaches the edge of the grid.
    #[serde(default)]
    pub velocity: Position,
    /// How fast it turns \[°/s\], clockwise from above.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(minimum = -720, maximum = 720))]
    pub turn_rate: f64,
    /// Points \[x, z\] \[m\] that it passes, in order, from its position on; then it goes on with its velocity. It comes
    /// with `over`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(min_items = 1, max_items = 4096))]
    pub path: Option<Vec<[f64; 2]>>,
    /// Simulated time that it takes for the path \[s\], at 100 m/s at the most.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(minimum = 0.001, maximum = 86_400))]
    pub over: Option<f64>,
}

fn yes() -> bool {
    true
}

impl Default for ColliderSpec {
    fn default() -> ColliderSpec {
        ColliderSpec {
            id: None,
            mass: 0.0,
            shape: None,
            footprints: None,
            position: Position::default(),
            heading: 0.0,
            airborne: false,
            shelters: true,
            velocity: Position::default(),
            turn_rate: 0.0,
            path: None,
            over: None,
        }
    }
}

/// A path along some points from a position on, taken in so many seconds.
fn motion_along(from: Position, path: &[[f64; 2]], over: Option<f64>) -> Motion {
    let speed = over.map(|over| path_length(from, path) / over);
    Motion { path: path.to_vec(), speed, ..Motion::default() }
}

impl ColliderSpec {
    /// The object without its name.
    pub fn body(&self) -> Body {
        let path = self.path.as_deref().unwrap_or_default();
        let along = motion_along(self.position, path, self.over.filter(|_| !path.is_empty()));
        let motion = Motion { velocity: self.velocity, turn_rate: self.turn_rate, ..along };
        Body {
            motion,
            mass: self.mass,
            shape: self.shape.clone(),
            footprints: self.footprints.clone().unwrap_or_default(),
            position: self.position,
            heading: self.heading,
            airborne: self.airborne,
            shelters: self.shelters,
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
    /// Whether snow that falls on its columns lies on it.
    pub shelters: Option<bool>,
    /// Velocity along x and z \[m/s\], 100 m/s at the most. It ends a path that the object follows.
    pub velocity: Option<Position>,
    /// How fast it turns \[°/s\], clockwise from above.
    #[cfg_attr(feature = "schema", schema(minimum = -720, maximum = 720))]
    pub turn_rate: Option<f64>,
    /// Points \[x, z\] \[m\] that it passes, in order, from where it is; then it stops, or goes on with the velocity in
    /// the same patch. It comes with `over`.
    #[cfg_attr(feature = "schema", schema(min_items = 1, max_items = 4096))]
    pub path: Option<Vec<[f64; 2]>>,
    /// Simulated time that it takes for the path \[s\], at 100 m/s at the most.
    #[cfg_attr(feature = "schema", schema(minimum = 0.001, maximum = 86_400))]
    pub over: Option<f64>,
    /// Whether it is swept to the new position, and turned to the new heading, in the next cycle, rather than lifted
    /// there: it leaves a track without gaps. A way of more than 32 columns takes several cycles.
    pub sweep: bool,
}

impl ColliderPatch {
    /// The object with these changes.
    pub fn apply(self, old: &Body) -> Body {
        let mut body = old.clone();
        if self.shape.is_some() || self.footprints.is_some() {
            (body.shape, body.footprints) = (self.shape, self.footprints.unwrap_or_default());
        }
        body.mass = self.mass.unwrap_or(old.mass);
        body.airborne = self.airborne.unwrap_or(old.airborne);
        body.shelters = self.shelters.unwrap_or(old.shelters);
        let motion = &mut body.motion;
        motion.turn_rate = self.turn_rate.unwrap_or(motion.turn_rate);
        if let Some(velocity) = self.velocity {
            motion.leave_path();
            motion.velocity = velocity;
        }
        if self.sweep {
            motion.sweep_to(old.position, self.position, self.heading);
        } else {
            if self.position.is_some() {
                motion.leave_path();
            }
            body.position = self.position.unwrap_or(old.position);
            body.heading = self.heading.unwrap_or(old.heading);
        }
        if let Some(path) = self.path {
            let Motion { turn_rate, .. } = body.motion;
            let velocity = self.velocity.unwrap_or_default();
            let along = motion_along(body.position, &path, self.over);
            body.motion = Motion { velocity, turn_rate, ..along };
        }
        body
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
    /// Mass of the snow that lies on it \[kg\]. It adds to its weight.
    #[serde(default)]
    pub burden: f64,
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
