//! The changes a client can make to a session, the same over REST and the stream.

use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use crate::snow::{Position, Shape};

/// A change of a session, validated when it is applied.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// Fresh snow falls.
    Snowfall(Snowfall),
    /// Snow is cleared to a depth.
    Clearing(Clearing),
    /// The air gets another temperature.
    AirTemperature(AirTemperature),
    /// Settings change.
    Settings(SettingsPatch),
    /// A collider is created; taken where its id exists already.
    CreateCollider(ColliderSpec),
    /// A collider is created or replaced.
    PutCollider(ColliderSpec),
    /// Parts of a collider change.
    PatchCollider {
        /// Its id.
        id: String,
        /// The parts.
        patch: ColliderPatch,
    },
    /// A collider is removed.
    DeleteCollider {
        /// Its id.
        id: String,
    },
    /// Several colliders are put and removed, all or none.
    Colliders(ColliderBatch),
}

/// Fresh snow on a region.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Snowfall {
    /// Depth \[m\], at least `cell_size`/256.
    #[schema(exclusive_minimum = 0, maximum = 1000)]
    pub depth: f64,
    /// Density \[kg/m³\]; the material's `fresh_density` where there is none.
    #[schema(minimum = 10, maximum = 917)]
    pub density: Option<f64>,
    /// Temperature \[°C\]; the air's where there is none.
    #[schema(minimum = -40, maximum = 0)]
    pub temperature: Option<f64>,
    /// Where it falls; everywhere where there is none.
    pub region: Option<Region>,
}

/// A plough: leaves at most a depth of snow standing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Clearing {
    /// Depth left standing \[m\].
    #[schema(minimum = 0)]
    pub depth: f64,
    /// Where it is cleared; everywhere where there is none.
    pub region: Option<Region>,
}

/// A rectangle in metres: the columns whose centres lie in it, lower edges included, upper ones
/// not.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Lower edge along x \[m\].
    pub x: f64,
    /// Lower edge along z \[m\].
    pub z: f64,
    /// Extent along x \[m\].
    #[schema(exclusive_minimum = 0)]
    pub width: f64,
    /// Extent along z \[m\].
    #[schema(exclusive_minimum = 0)]
    pub depth: f64,
}

/// Another air temperature.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AirTemperature {
    /// Temperature \[°C\].
    #[schema(minimum = -40, maximum = 0)]
    pub celsius: f64,
}

/// Body of `PATCH /v1/sessions/{id}`: the settings that change; others stay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SettingsPatch {
    /// Temperature of the air \[°C\].
    #[schema(minimum = -40, maximum = 0)]
    pub air_temperature: Option<f64>,
    /// Simulated seconds per second.
    #[schema(minimum = 0, maximum = 1000)]
    pub time_scale: Option<f64>,
    /// Whether time stands still.
    pub paused: Option<bool>,
    /// Ticks per second \[Hz\].
    #[schema(minimum = 1, maximum = 240)]
    pub tick_rate: Option<f64>,
    /// Continuous snowfall \[m/h\].
    #[schema(minimum = 0, maximum = 100)]
    pub snowfall_rate: Option<f64>,
    /// Exponent n of the stiffness law.
    #[schema(minimum = 3, maximum = 6)]
    pub stiffness_exponent: Option<f64>,
    /// Seconds without request or stream after which the session hibernates, `null` for never.
    #[serde(deserialize_with = "some", skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<f64>, minimum = 1, maximum = 1e9)]
    pub idle_timeout_s: Option<Option<f64>>,
    /// Seconds without request or stream after which the session is deleted; `null` for never.
    #[serde(deserialize_with = "some", skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<f64>, minimum = 1, maximum = 1e9)]
    pub delete_after_s: Option<Option<f64>>,
}

/// Keeps `null` apart from an absent field.
fn some<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Option<f64>>, D::Error> {
    Option::deserialize(deserializer).map(Some)
}

/// An object that stands on the snow.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ColliderSpec {
    /// Name, `[A-Za-z0-9_-]{1,64}`; the server makes a ULID where there is none.
    pub id: Option<String>,
    /// Mass \[kg\].
    #[schema(exclusive_minimum = 0, maximum = 1e9)]
    pub mass: f64,
    /// Outline from above.
    pub shape: Shape,
    /// Where its centre is \[m\].
    pub position: Position,
}

/// Body of `PATCH …/colliders/{cid}`: the parts that change; others stay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ColliderPatch {
    /// Mass \[kg\].
    #[schema(exclusive_minimum = 0, maximum = 1e9)]
    pub mass: Option<f64>,
    /// Outline from above.
    pub shape: Option<Shape>,
    /// Where its centre is \[m\].
    pub position: Option<Position>,
}

/// Colliders put and removed in one frame, all or none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ColliderBatch {
    /// Colliders to create or replace; each needs an `id`.
    pub put: Vec<ColliderSpec>,
    /// Ids of colliders to remove.
    pub delete: Vec<String>,
}

/// How far a paused session is to be stepped; exactly one of `ticks`, `seconds` and
/// `until_settled`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StepSpec {
    /// Number of ticks.
    #[schema(minimum = 1, maximum = 1_000_000)]
    pub ticks: Option<u64>,
    /// Simulated seconds.
    #[schema(exclusive_minimum = 0)]
    pub seconds: Option<f64>,
    /// Until nothing moves any more; needs `max_seconds`.
    pub until_settled: Option<bool>,
    /// Most simulated seconds to step with `until_settled`.
    #[schema(exclusive_minimum = 0)]
    pub max_seconds: Option<f64>,
}
