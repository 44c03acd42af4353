//! Probes: how deep a load would sink, without putting it on the snow.

use serde::{Deserialize, Serialize};

use crate::session::Stamp;

/// Loads to try on the snow.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ProbeBatch {
    /// The loads; each is evaluated as if it were the only one.
    #[cfg_attr(feature = "schema", schema(min_items = 1, max_items = 1024))]
    pub probes: Vec<Probe>,
}

/// A load on level snow.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// Where it stands along x \[m\], inside the grid.
    #[cfg_attr(feature = "schema", schema(minimum = 0))]
    pub x: f64,
    /// Where it stands along z \[m\], inside the grid.
    #[cfg_attr(feature = "schema", schema(minimum = 0))]
    pub z: f64,
    /// Mass \[kg\].
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0, maximum = 1e9))]
    pub mass: f64,
    /// Area it stands on \[m²\].
    #[cfg_attr(feature = "schema", schema(minimum = 1e-6, maximum = 1e12))]
    pub area: f64,
    /// Simulated time that it stands there \[s\]; until the snow has come to rest where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 3600))]
    pub duration: Option<f64>,
}

impl Probe {
    /// The load without its place.
    pub fn load(&self) -> Load {
        Load { mass: self.mass, area: self.area, duration: self.duration }
    }
}

/// A load that is tried somewhere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// Mass \[kg\].
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0, maximum = 1e9))]
    pub mass: f64,
    /// Area it stands on \[m²\].
    #[cfg_attr(feature = "schema", schema(minimum = 1e-6, maximum = 1e12))]
    pub area: f64,
    /// Simulated time that it stands there \[s\]; until the snow has come to rest where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 3600))]
    pub duration: Option<f64>,
}

/// Answer to probes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ProbeReply {
    /// When this holds.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// What becomes of each load, in the order asked for.
    pub probes: Vec<ProbeView>,
}

/// What becomes of a load.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ProbeView {
    /// Present height of the column less its height under the load, after its duration or once it has
    /// come to rest, other objects left out \[m\]. What the snow still settles by itself is counted.
    pub sink_depth: f64,
    /// Hardness of the snow at the surface \[Pa\]; 0 where there is none.
    pub surface_hardness: f64,
    /// Pressure of the load, mass · g / area \[Pa\].
    pub pressure: f64,
    /// Whether the pressure is not above the surface's hardness; never where there is no snow.
    pub carries: bool,
}
