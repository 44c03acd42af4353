//! What Firn's server and its clients say to each other: the bodies of requests and answers, how a height
//! stream begins and ends, and the bytes of its messages.
//!
//! SI units and °C throughout. The published contract says the same for other languages:
//! `api/openapi.json`, `api/asyncapi.yaml`, and `api/height-stream.md` for every byte of the binary messages.
//! No I/O and no runtime; with the feature `schema` the types describe themselves as JSON schemas.
//!
//! ```
//! use firn_protocol::{SessionSpec, Snowfall};
//!
//! // What is left out has the server's default.
//! let spec: SessionSpec = serde_json::from_str(r#"{"air_temperature": -8}"#)?;
//! assert_eq!((spec.air_temperature, spec.grid.cell_size), (-8.0, 0.2));
//!
//! let snowfall = Snowfall::new(0.5);
//! assert!(serde_json::to_string(&snowfall)?.starts_with(r#"{"depth":0.5"#));
//! # Ok::<(), serde_json::Error>(())
//! ```

mod checkpoints;
mod colliders;
mod creation;
mod events;
pub mod heights;
mod physics;
mod probes;
mod problem;
mod samples;
mod session;
mod snow;
mod stamps;
mod store;
pub mod stream;
mod subscription;
mod usage;
mod weather;

pub use firn_snow::weather::{
    HeightsAbove, Site, Start, SunPosition, Weather, WeatherInput, WeatherRow, WeatherSeries,
};
pub use firn_snow::{
    Body, Grid, HardnessLaw, LoadDistribution, Material, Part, Position, Preset, Pressing, Shape,
};

pub use checkpoints::{CheckpointList, CheckpointView, ResetSpec};
pub use colliders::{
    BatchOutcome, BatchReply, BatchResult, BatchResults, ColliderBatch, ColliderPatch,
    ColliderReply, ColliderSpec, ColliderView, OnError,
};
pub use creation::{MaterialSpec, SessionBody, SessionSpec, SnowLayer, Terrain};
pub use events::{Event, EventKind, Events};
pub use firn_snow::alpine::HandHardness;
pub use physics::Physics;
pub use probes::{Load, Probe, ProbeBatch, ProbeReply, ProbeView};
pub use problem::{FieldError, Problem};
pub use samples::{SampleBatch, SampleField, SampleFields, SampleReply};
pub use session::{
    CreatedSession, Progress, SessionView, Settings, SettingsPatch, Stamp, State, StepSpec, Summary,
};
pub use snow::{AlpineColumn, ColumnView, LayerView, MassView, Reference, WeakLayerView};
pub use stamps::{PrintView, StampBatch, StampReply, StampSpec};
pub use store::{CompactReply, VerifyReply};
pub use subscription::{ColumnRegion, DepthWatch, MOST_WATCHES, Resume, Subscribe, Update};
pub use usage::{MemoryBytes, UsageView};
pub use weather::{
    AirTemperature, AirTemperatureReply, Clearing, ClearingReply, Region, Snowfall, SnowfallReply,
    WeatherNow, WeatherView,
};

/// Whether a client may use a name for a session or a collider: it matches `[A-Za-z0-9_-]{1,64}`.
pub fn is_valid_id(id: &str) -> bool {
    (1..=64).contains(&id.len())
        && id.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-')
}
