//! The changes a client can make to a session, the same over REST and the stream, and what is answered.

use std::sync::Arc;

use firn_protocol::{
    AirTemperature, AirTemperatureReply, BatchReply, Clearing, ClearingReply, ColliderBatch,
    ColliderPatch, ColliderReply, ColliderSpec, SettingsPatch, Snowfall, SnowfallReply, Stamp,
    StampBatch, StampReply, StampSpec, WeatherInput,
};
use firn_snow::{Part, Shape};
use serde::{Deserialize, Serialize};

use crate::core::session::Ground;

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
    /// The weather is another from now on.
    Weather(Arc<WeatherInput>),
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
    /// Several colliders are put and removed.
    Colliders(ColliderBatch),
    /// Loads press prints into the snow.
    Stamps(StampBatch),
    /// The snow lies on other ground, one that was checked.
    Ground(Ground),
}

impl Change {
    /// How much there is to do: each object of a batch counts.
    pub(crate) fn entries(&self) -> usize {
        match self {
            Change::Colliders(batch) => batch.put.len() + batch.delete.len(),
            Change::Stamps(batch) => batch.stamps.len(),
            _ => 1,
        }
    }

    /// Memory that it takes, about \[bytes\].
    pub(crate) fn bytes(&self) -> usize {
        let beside_spec = |spec: &ColliderSpec| {
            let id = spec.id.as_ref().map_or(0, String::capacity);
            id + outline(&spec.shape, &spec.footprints)
        };
        let beside = match self {
            Change::CreateCollider(spec) | Change::PutCollider(spec) => beside_spec(spec),
            Change::Colliders(batch) => {
                let put =
                    batch.put.iter().map(|spec| size_of::<ColliderSpec>() + beside_spec(spec));
                let delete = batch.delete.iter().map(|id| size_of::<String>() + id.capacity());
                put.chain(delete).sum()
            }
            Change::PatchCollider { id, patch } => {
                id.capacity() + outline(&patch.shape, &patch.footprints)
            }
            Change::DeleteCollider { id } => id.capacity(),
            Change::Clearing(clearing) => {
                clearing.path.as_ref().map_or(0, |path| size_of_val(&path[..]))
            }
            Change::Snowfall(_) | Change::AirTemperature(_) | Change::Settings(_) => 0,
            Change::Weather(weather) => size_of::<WeatherInput>() + weather.heap_bytes(),
            Change::Stamps(batch) => {
                let stamps = batch.stamps.iter();
                stamps.map(|stamp| size_of::<StampSpec>() + stamp.shape.heap_bytes()).sum()
            }
            Change::Ground(ground) => ground.bytes(),
        };
        size_of::<Change>() + beside
    }
}

/// Memory of the outline of an object, beside its own size \[bytes\].
fn outline(shape: &Option<Shape>, footprints: &Option<Vec<Part>>) -> usize {
    let footprints = footprints.iter().flatten().map(Part::bytes).sum::<usize>();
    shape.as_ref().map_or(0, Shape::heap_bytes) + footprints
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
    Collider {
        /// The answer.
        #[serde(flatten)]
        reply: ColliderReply,
        /// Whether it was not there before.
        #[serde(skip)]
        created: bool,
    },
    /// To stamps.
    Stamps(StampReply),
    /// To several colliders.
    Batch(BatchReply),
    /// To everything else.
    Stamp(Stamp),
}

impl Applied {
    /// Of which state it is.
    pub fn stamp(&self) -> Stamp {
        match self {
            Applied::Snowfall(reply) => reply.stamp,
            Applied::Clearing(reply) => reply.stamp,
            Applied::AirTemperature(reply) => reply.stamp,
            Applied::Collider { reply, .. } => reply.stamp,
            Applied::Stamps(reply) => reply.stamp,
            Applied::Batch(reply) => reply.stamp,
            Applied::Stamp(stamp) => *stamp,
        }
    }
}
