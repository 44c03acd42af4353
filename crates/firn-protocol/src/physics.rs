//! Which physics a snowpack follows.

use firn_snow::{HardnessLaw, Pressing};
use serde::{Deserialize, Serialize};

/// Which physics a snowpack follows, for as long as it lives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Physics {
    /// That of the thesis: snow settles under its own weight and under objects, whatever the weather.
    #[default]
    Thesis,
    /// Snow that feels the weather: it settles by creep, conducts heat, melts, soaks, freezes and runs off.
    Alpine,
}

impl Physics {
    /// Length of a weather step where nobody says \[s\].
    pub const WEATHER_STEP: f64 = 900.0;

    /// Whether it is that of the thesis.
    pub fn is_thesis(&self) -> bool {
        *self == Physics::Thesis
    }

    /// Most simulated seconds per second.
    pub fn highest_time_scale(self) -> f64 {
        match self {
            Physics::Thesis => 1000.0,
            Physics::Alpine => 100_000.0,
        }
    }

    /// Lowest and highest temperature of its air \[°C\].
    pub fn air_temperatures(self) -> (f64, f64) {
        match self {
            Physics::Thesis => (-40.0, 0.0),
            Physics::Alpine => (-60.0, 50.0),
        }
    }

    /// How snow gives way under objects where nobody says, in place of a preset's way.
    pub(crate) fn pressing(self, preset: Pressing) -> Pressing {
        match (self, preset) {
            (Physics::Alpine, Pressing::Creep) => Pressing::Within(0.25),
            _ => preset,
        }
    }

    /// The hardness law where nobody says, in place of a preset's.
    pub(crate) fn hardness_law(self, preset: HardnessLaw) -> HardnessLaw {
        match self {
            Physics::Thesis => preset,
            // The law of alpine snow is to stand here as soon as there is one.
            Physics::Alpine => preset,
        }
    }
}
