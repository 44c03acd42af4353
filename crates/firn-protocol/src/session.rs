//! Bodies of requests and answers about a session: its settings, its time and its state.

use std::fmt;
use std::sync::Arc;

use firn_snow::weather::Site;
use firn_snow::{Grid, Material, Pressing};
use serde::{Deserialize, Deserializer, Serialize};

use crate::physics::Physics;

/// The settings of a session that can change while it lives.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Settings {
    /// Temperature of the air \[°C\].
    pub air_temperature: f64,
    /// Simulated seconds per second.
    pub time_scale: f64,
    /// Ticks per second \[Hz\].
    pub tick_rate: f64,
    /// Whether time stands still.
    pub paused: bool,
    /// Continuous snowfall \[m/h\].
    pub snowfall_rate: f64,
    /// How snow gives way under objects.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schema(required = true))]
    pub pressing: Pressing,
    /// Seconds without request or stream after which the session hibernates.
    pub idle_timeout_s: Option<f64>,
    /// Seconds without request or stream after which the session is deleted.
    pub delete_after_s: Option<f64>,
}

/// Body of `PATCH /v1/sessions/{id}`: the settings that change; others stay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SettingsPatch {
    /// Temperature of the air \[°C\], from −40 to 0; in alpine snow from −60 to 50, and the weather becomes steady with it.
    #[cfg_attr(feature = "schema", schema(minimum = -60, maximum = 50))]
    pub air_temperature: Option<f64>,
    /// Simulated seconds per second: up to 1000, in alpine snow up to 100 000.
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 100_000))]
    pub time_scale: Option<f64>,
    /// Whether time stands still.
    pub paused: Option<bool>,
    /// Ticks per second \[Hz\].
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 240))]
    pub tick_rate: Option<f64>,
    /// Continuous snowfall \[m/h\].
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 100))]
    pub snowfall_rate: Option<f64>,
    /// Exponent n of the stiffness law.
    #[cfg_attr(feature = "schema", schema(minimum = 3, maximum = 6))]
    pub stiffness_exponent: Option<f64>,
    /// How snow gives way under objects.
    pub pressing: Option<Pressing>,
    /// Seconds without request or stream after which the session hibernates, `null` for never.
    #[serde(deserialize_with = "given", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<f64>, minimum = 1, maximum = 1e9))]
    pub idle_timeout_s: Option<Option<f64>>,
    /// Seconds without request or stream after which the session is deleted; `null` for never.
    #[serde(deserialize_with = "given", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Option<f64>, minimum = 1, maximum = 1e9))]
    pub delete_after_s: Option<Option<f64>>,
}

/// A field that is there. Where it may be `null`, that is not the same as a field that is left out; where it may
/// not, `null` is refused.
pub(crate) fn given<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
) -> Result<Option<T>, D::Error> {
    T::deserialize(deserializer).map(Some)
}

/// What a session is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Time passes.
    Running,
    /// Time stands still until it is stepped or set running.
    Paused,
    /// It is paused, and a step is under way.
    Stepping,
    /// Its memory is freed; the next request wakes it.
    Hibernating,
}

/// How far a step has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Progress {
    /// Ticks it has taken.
    pub done: u64,
    /// Ticks it takes at the most.
    pub of: u64,
}

/// A session: its configuration, clock and summary.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SessionView {
    /// Its name.
    pub id: String,
    /// The tenant it belongs to; `null` where that is the operator.
    pub tenant: Option<String>,
    /// Which physics the snow follows; that of the thesis where nothing is said.
    #[serde(default, skip_serializing_if = "Physics::is_thesis")]
    #[cfg_attr(feature = "schema", schema(required = false))]
    pub physics: Physics,
    /// Length of a weather step \[s\], where the snow is alpine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = f64, required = false))]
    pub weather_step: Option<f64>,
    /// Where and when the snowpack is, where the snow is alpine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(value_type = Site, required = false))]
    pub site: Option<Arc<Site>>,
    /// Size of the grid.
    pub grid: Grid,
    /// Material constants.
    pub material: Material,
    /// Settings.
    #[serde(flatten)]
    pub settings: Settings,
    /// Whether it has a terrain (`GET …/terrain`); without one the ground is level at 0.
    pub terrain: bool,
    /// What it is doing.
    pub state: State,
    /// How far the step under way has come; `null` where there is none.
    pub progress: Option<Progress>,
    /// Whether it takes no changes: it came back from a damaged store, and an administrator has to say
    /// that it is as it should be.
    pub locked: bool,
    /// Ticks since it was created or reset.
    pub tick: u64,
    /// Number of its newest published change. It only grows, and may exceed 32 bits.
    pub seq: u64,
    /// Opaque; (epoch, seq) names one state.
    pub epoch: String,
    /// Simulated time \[s\].
    pub sim_time: f64,
    /// Whether no snow falls and the last executed cycle changed no cell.
    pub settled: bool,
    /// Totals.
    pub summary: Summary,
    /// Device memory that its cells take \[bytes\].
    pub device_memory_bytes: u64,
    /// When it was created, RFC 3339.
    pub created_at: String,
    /// Path of its height stream.
    pub stream_url: String,
}

/// Answer to `POST /v1/sessions`.
#[derive(Clone, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct CreatedSession {
    /// The session.
    #[serde(flatten)]
    pub session: SessionView,
    /// Allows everything about this session.
    pub token: String,
    /// Allows its reads and streams.
    pub viewer_token: String,
}

impl fmt::Debug for CreatedSession {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Tokens are not for logs.
        f.debug_struct("CreatedSession").field("session", &self.session).finish_non_exhaustive()
    }
}

/// Totals over a snowpack.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Summary {
    /// Mean snow depth \[m\].
    pub mean_height: f64,
    /// Least snow depth \[m\].
    pub min_height: f64,
    /// Greatest snow depth \[m\].
    pub max_height: f64,
    /// Mass of the snow \[kg\].
    pub total_mass: f64,
    /// Mass over volume \[kg/m³\]; 0 where there is no snow.
    pub mean_density: f64,
    /// Tiles in which snow still moves.
    pub active_tiles: u32,
    /// Tiles of 8 × 8 columns.
    pub tiles: u32,
    /// Objects on the snow.
    pub colliders: usize,
}

/// When a reply holds: the tick, and the number of the newest published change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Stamp {
    /// Ticks since the session was created or reset.
    pub tick: u64,
    /// Number of the newest published change. It only grows, and may exceed 32 bits.
    pub seq: u64,
}

/// How far a paused session is to be stepped; exactly one of `ticks`, `seconds` and
/// `until_settled`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct StepSpec {
    /// Number of ticks.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 1_000_000))]
    pub ticks: Option<u64>,
    /// Simulated seconds.
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
    pub seconds: Option<f64>,
    /// Until nothing moves any more; needs `max_seconds`.
    pub until_settled: Option<bool>,
    /// Most simulated seconds to step with `until_settled`.
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
    pub max_seconds: Option<f64>,
}
