//! Events of a session, as its streams report them.

use serde::{Deserialize, Serialize};

use crate::session::{Progress, Settings, Stamp};

/// Something that happened in a session, told to stream clients while they are connected.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// Snow fell because somebody asked for it; continuous snowfall shows in the settings.
    Snowfall {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
        /// Mass that fell \[kg\], the refused part included.
        fallen_mass: f64,
        /// Mass that found no room \[kg\].
        refused_mass: f64,
    },
    /// Snow was cleared.
    Clearing {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
        /// Mass that was removed \[kg\].
        cleared_mass: f64,
    },
    /// The settings changed, by the air's temperature or otherwise.
    Settings {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
        /// All settings, as they are now.
        settings: Settings,
    },
    /// Nothing moves any more.
    Settled {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
    },
    /// How far a long step has come: twice a second from half a second after it began, and once when it has
    /// ended.
    StepProgress {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
        /// How far it has come; `null` where it has ended.
        progress: Option<Progress>,
    },
    /// The session was reset: to the state it was created in, to a restore point, or to a snapshot.
    Reset {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
    },
}
