//! A session's life: its name, its commands, its clock, and the mirror that reads are served from.

mod apply;
mod change;
mod clock;
mod error;
mod event;
mod falling;
mod gather;
mod handle;
mod held;
mod idempotency;
mod journal;
mod message;
mod mirror;
mod names;
mod object_rows;
mod once;
mod orders;
mod pace;
mod portion;
mod probe;
mod publish;
mod registry;
mod requests;
mod simulation;
mod snapshot;
mod spec;
mod step;
mod token;
mod turn;
mod view;
mod visit;
mod vitals;
mod weak;
mod world;

pub use change::{
    AirTemperature, Change, Clearing, ColliderBatch, ColliderPatch, ColliderSpec, Region,
    SettingsPatch, Snowfall, StepSpec,
};
pub use clock::{Clock, FRAME_RATE};
pub use error::{Invalid, SessionError};
pub use event::Event;
pub use gather::{Gathered, MOST_SAMPLES, Sampled};
pub use handle::Session;
pub use idempotency::{Answer, Idempotency, NoPlace, Place, RequestKey};
pub use journal::StoreVitals;
pub use mirror::{Mirror, TileColumns};
pub use once::Once;
pub use probe::{Probe, ProbeBatch, ProbeReply, ProbeView};
pub use registry::{Sessions, Totals};
pub use simulation::Simulation;
pub use snapshot::{MEDIA_TYPE as SNAPSHOT_MEDIA_TYPE, Snapshot};
pub use spec::{Limits, SessionSpec, SnowLayer, Terrain, is_valid_id};
pub use token::{Grant, TokenHashes, Tokens};
pub use view::{
    AirTemperatureReply, Applied, ClearingReply, ColliderReply, ColliderView, ColumnView,
    CreatedSession, LayerView, MassView, SessionView, Settings, SnowfallReply, Stamp, State,
    Summary, WeakLayerView,
};
pub use visit::Visit;
pub use vitals::{FrameParts, FrameTime, StageTimes, Vitals};
pub use world::{Durability, Fault, OpenBackend, StartError, World, WorldConfig};
