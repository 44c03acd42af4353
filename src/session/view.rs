//! What clients are told about a session.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::snow::{Grid, Material, Position, Shape};

use super::spec::Terrain;

/// What a session is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Time passes.
    Running,
    /// Time stands still until it is stepped or set running.
    Paused,
    /// Its memory is freed; the next request wakes it.
    Hibernating,
}

/// The settings of a session that can change while it lives.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
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
    /// Seconds without request or stream after which the session hibernates.
    pub idle_timeout_s: Option<f64>,
    /// Seconds without request or stream after which the session is deleted.
    pub delete_after_s: Option<f64>,
}

/// A session: its configuration, clock and summary.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct SessionView {
    /// Its name.
    pub id: String,
    /// Size of the grid.
    pub grid: Grid,
    /// Material constants.
    pub material: Material,
    /// Settings.
    #[serde(flatten)]
    pub settings: Settings,
    /// Elevation of the ground; `null` is level ground.
    pub terrain: Option<Terrain>,
    /// What it is doing.
    pub state: State,
    /// Ticks since it was created or reset.
    pub tick: u64,
    /// Number of its newest published change.
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
#[derive(Clone, Serialize, ToSchema)]
pub struct CreatedSession {
    /// The session.
    #[serde(flatten)]
    pub session: SessionView,
    /// Allows everything about this session.
    pub token: String,
    /// Allows its reads and streams.
    pub viewer_token: String,
}

/// Totals over a snowpack.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, ToSchema)]
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

/// An object on the snow and how it stands there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
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

/// When a reply holds: the tick, and the number of the newest published change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Stamp {
    /// Ticks since the session was created or reset.
    pub tick: u64,
    /// Number of the newest published change.
    pub seq: u64,
}

/// Answer to a change, as it is given over REST and in the stream's acks.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Applied {
    /// To a snowfall.
    Snowfall(SnowfallReply),
    /// To a clearing.
    Clearing(ClearingReply),
    /// To an air temperature.
    AirTemperature(AirTemperatureReply),
    /// To a collider that was put or patched.
    Collider(ColliderReply),
    /// To everything else.
    Stamp(Stamp),
}

/// Answer to a snowfall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SnowfallReply {
    /// When it was applied.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// Mass that fell \[kg\], the refused part included.
    pub fallen_mass: f64,
    /// Mass that found no room \[kg\].
    pub refused_mass: f64,
}

/// Answer to a clearing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClearingReply {
    /// When it was applied.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// Mass that was removed \[kg\].
    pub cleared_mass: f64,
}

/// Answer to an air temperature.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct AirTemperatureReply {
    /// When it was applied.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// Temperature of the air \[°C\].
    pub celsius: f64,
}

/// Answer to a collider that was put or patched.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ColliderReply {
    /// When it was applied.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// The collider.
    #[serde(flatten)]
    pub collider: ColliderView,
    /// Whether it was not there before.
    #[serde(skip)]
    pub created: bool,
}

/// One column's material cells.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct ColumnView {
    /// When this holds.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// Snow depth \[m\].
    pub height: f64,
    /// Mass \[kg\].
    pub mass: f64,
    /// Mass over volume \[kg/m³\]; 0 where there is no snow.
    pub mean_density: f64,
    /// The material cells, from the ground up.
    pub layers: Vec<LayerView>,
    /// Layers less dense than what lies above and below, from the ground up.
    pub weak_layers: Vec<WeakLayerView>,
}

/// One material cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct LayerView {
    /// Height of its lower face above the ground \[m\].
    pub bottom: f64,
    /// Thickness \[m\].
    pub thickness: f64,
    /// Density \[kg/m³\].
    pub density: f64,
    /// Temperature \[°C\].
    pub temperature: f64,
    /// Hardness \[Pa\].
    pub hardness: f64,
    /// Vertical stress on it, its own weight included \[Pa\].
    pub stress: f64,
    /// Mass \[kg\].
    pub mass: f64,
}

/// A maximal run of cells with a density of at most 0.8 of the least dense of the densest cell
/// above and the densest cell below.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct WeakLayerView {
    /// Height of its lower face above the ground \[m\].
    pub bottom: f64,
    /// Thickness \[m\].
    pub thickness: f64,
    /// Mean density \[kg/m³\].
    pub density: f64,
    /// Mean temperature, weighted by mass \[°C\].
    pub temperature: f64,
    /// 1 − the smallest ratio of a cell's density to that of the cells around.
    pub contrast: f64,
}

/// The mass ledger of a session.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct MassView {
    /// When this holds.
    #[serde(flatten)]
    pub stamp: Stamp,
    /// Mass of the snow, summed over its cells \[kg\].
    pub present: f64,
    /// Mass that has fallen \[kg\], the refused part included.
    pub fallen: f64,
    /// Mass that found no room \[kg\].
    pub refused: f64,
    /// Mass that was cleared \[kg\].
    pub cleared: f64,
    /// fallen − refused − cleared − present, in quanta of 2⁻¹⁸ kg/m² in one column: always 0.
    pub imbalance_quanta: i64,
}
