//! Events of a session, as its streams report them.

use serde::{Deserialize, Serialize};

use crate::session::{Settings, Stamp};

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
    /// The snow lies on other ground.
    Terrain {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
        /// Lowest elevation of the ground \[m\].
        lowest: f64,
        /// Highest elevation of the ground \[m\].
        highest: f64,
    },
    /// Nothing moves any more.
    Settled {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
    },
    /// The session is back in the state it was created in.
    Reset {
        /// When.
        #[serde(flatten)]
        stamp: Stamp,
    },
}
