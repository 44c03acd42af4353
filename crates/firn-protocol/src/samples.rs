//! Samples: the snow at many points.

use serde::{Deserialize, Serialize};

use crate::probes::Load;
use crate::session::Stamp;

/// Points at which the snow is read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct SampleBatch {
    /// The points, each \[x, z\] in metres, inside the grid.
    #[cfg_attr(feature = "schema", schema(value_type = Vec<Vec<f64>>, min_items = 1, max_items = 65536))]
    pub points: Vec<[f64; 2]>,
    /// What to read at each, nothing twice.
    #[serde(default = "SampleField::of_the_surface")]
    #[cfg_attr(feature = "schema", schema(min_items = 1, default = json!(["depth", "ground", "elevation", "normal"])))]
    pub fields: Vec<SampleField>,
    /// The load whose `sink` is wanted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load: Option<Load>,
}

/// What can be read at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum SampleField {
    /// Snow depth \[m\].
    Depth,
    /// Elevation of the ground \[m\].
    Ground,
    /// Elevation of the snow's surface \[m\]: ground and depth.
    Elevation,
    /// Unit vector that stands on the surface, along x, up, and along z.
    Normal,
    /// Density of the topmost cell \[kg/m³\].
    Density,
    /// Hardness of the topmost cell \[Pa\].
    Hardness,
    /// How deep the load would sink \[m\].
    Sink,
}

impl SampleField {
    /// Those that are known without asking the device.
    pub fn of_the_surface() -> Vec<SampleField> {
        vec![SampleField::Depth, SampleField::Ground, SampleField::Elevation, SampleField::Normal]
    }

    /// Whether the snow's cells have to be read for it.
    pub fn is_of_cells(self) -> bool {
        matches!(self, SampleField::Density | SampleField::Hardness | SampleField::Sink)
    }
}

/// Answer to samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SampleReply {
    /// When this holds.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// The fields asked for.
    pub fields: SampleFields,
}

/// Fields of points: each one that was asked for has a value for each point, in their order; the others are `null`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SampleFields {
    /// Snow depth \[m\], bilinear between the centres of columns.
    pub depth: Option<Vec<f64>>,
    /// Elevation of the ground \[m\], bilinear between the centres of columns.
    pub ground: Option<Vec<f64>>,
    /// Elevation of the snow's surface \[m\]: ground and depth.
    pub elevation: Option<Vec<f64>>,
    /// Unit vectors (x, y, z) that stand on the surface; y is up.
    #[cfg_attr(feature = "schema", schema(value_type = Option<Vec<Vec<f64>>>))]
    pub normal: Option<Vec<[f64; 3]>>,
    /// Density \[kg/m³\] of the topmost cell of the column that the point is on; `null` where there is no
    /// snow.
    pub density: Option<Vec<Option<f64>>>,
    /// Hardness \[Pa\] of that cell; `null` where there is no snow.
    pub hardness: Option<Vec<Option<f64>>>,
    /// Depth \[m\] that the load would sink there, as a probe tells.
    pub sink: Option<Vec<f64>>,
}
