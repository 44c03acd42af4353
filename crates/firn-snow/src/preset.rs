//! Kinds of snow, as sets of values to begin with.

use crate::material::{HardnessLaw, Material};
use crate::pressing::Pressing;

/// A kind of snow: a material, how it gives way under objects, and the air that it fell from. `docs/model.md` has
/// all values and their sources.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub enum Preset {
    /// The snow of the thesis.
    #[default]
    Thesis,
    /// Light new snow on a cold day.
    Powder,
    /// A groomed run.
    Packed,
    /// New snow at the melting point.
    Wet,
    /// Snow that takes footprints and is trodden firm.
    Game,
}

impl Preset {
    /// All of them.
    pub const ALL: [Preset; 5] =
        [Preset::Thesis, Preset::Powder, Preset::Packed, Preset::Wet, Preset::Game];

    /// Its material.
    pub fn material(self) -> Material {
        let snow = |fresh_density, max_density| Material {
            fresh_density,
            max_density,
            ..Material::default()
        };
        match self {
            Preset::Thesis => Material::default(),
            Preset::Powder => snow(30.0, 300.0),
            Preset::Packed => snow(400.0, 600.0),
            Preset::Wet => snow(100.0, 600.0),
            Preset::Game => Material {
                hardness_law: HardnessLaw::Gold,
                grain_size_mm: 10.0,
                ..snow(60.0, 450.0)
            },
        }
    }

    /// How it gives way under objects.
    pub fn pressing(self) -> Pressing {
        match self {
            Preset::Thesis => Pressing::Creep,
            Preset::Powder | Preset::Packed | Preset::Wet | Preset::Game => Pressing::Within(0.25),
        }
    }

    /// Temperature of its air \[°C\].
    pub fn air_temperature(self) -> f64 {
        match self {
            Preset::Thesis | Preset::Game => -3.0,
            Preset::Powder => -10.0,
            Preset::Packed => -5.0,
            Preset::Wet => 0.0,
        }
    }
}
