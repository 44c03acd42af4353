//! What snow is made of: density, hardness and stiffness.

use crate::alpine;
use crate::column::Cell;

/// Gravity \[m/s²\].
pub const GRAVITY: f64 = 9.81;

/// Cell size for which the stiffness law was tuned \[m\].
pub const REFERENCE_CELL_SIZE: f64 = 0.2;

/// How hardness depends on density and temperature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[repr(u32)]
pub enum HardnessLaw {
    /// The polynomial as the thesis's program ran it, held where it would soften with cold.
    #[default]
    Calibrated = 0,
    /// The thesis's printed equation 4.4 (Barakhtanov et al.).
    Regression = 1,
    /// Gold (1956), thesis 2.2, tied to `calibrated` at 20 kg/m³ and −3 °C.
    Gold = 2,
    /// The only law of alpine snowpacks, which no other takes.
    Alpine = 3,
}

impl HardnessLaw {
    /// Whether it is that of alpine snow, which loads press and its own weight does not.
    #[inline]
    pub fn is_alpine(self) -> bool {
        self == HardnessLaw::Alpine
    }
}

/// How a surface load spreads with depth below an object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[repr(u32)]
pub enum LoadDistribution {
    /// `(b/(b+z))²`, the usual 2:1 spread under a footing of width b.
    #[default]
    TwoToOne = 0,
    /// The same stress at every depth.
    Uniform = 1,
    /// Only the top cell carries the load.
    Surface = 2,
}

/// Material constants of one snowpack.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Material {
    /// Density of fresh snow \[kg/m³\], up to `max_density`.
    #[cfg_attr(feature = "schema", schema(minimum = 10))]
    pub fresh_density: f64,
    /// Density at which snow compacts no further \[kg/m³\].
    #[cfg_attr(feature = "schema", schema(maximum = 917))]
    pub max_density: f64,
    /// Exponent n of the stiffness law k = ρⁿ.
    #[cfg_attr(feature = "schema", schema(minimum = 3, maximum = 6))]
    pub stiffness_exponent: f64,
    /// The hardness law.
    pub hardness_law: HardnessLaw,
    /// Grain size δ \[mm\], read by the law `gold` only.
    #[cfg_attr(feature = "schema", schema(minimum = 0.05, maximum = 10))]
    pub grain_size_mm: f64,
    /// How loads spread with depth.
    pub load_distribution: LoadDistribution,
}

impl Default for Material {
    fn default() -> Self {
        Material {
            fresh_density: 20.0,
            max_density: 100.0,
            stiffness_exponent: 3.56,
            hardness_law: HardnessLaw::default(),
            grain_size_mm: 0.5,
            load_distribution: LoadDistribution::default(),
        }
    }
}

impl Material {
    /// Hardness \[Pa\] of dry snow of a density \[kg/m³\] and temperature \[°C\]; never negative.
    ///
    /// `shaders/shared/material.wgsl` computes the same in the same order.
    #[inline]
    pub fn hardness(&self, density: f32, temperature: f32) -> f32 {
        self.strength(&Cell { temperature, ..Cell::default() }).hardness(density)
    }

    /// What hardness owes to a cell's temperature and water: for a look at many densities.
    #[inline]
    pub(crate) fn strength(&self, cell: &Cell) -> Strength {
        let temperature = cell.temperature;
        match self.hardness_law {
            HardnessLaw::Calibrated => Strength::Calibrated { temperature },
            HardnessLaw::Regression => Strength::Regression { temperature },
            HardnessLaw::Gold => Strength::Gold {
                prefactor: gold_prefactor(self.grain_size_mm),
                warmth: (-0.063 * (temperature + 3.0)).exp(),
            },
            HardnessLaw::Alpine => Strength::Alpine(alpine::Strength::of(cell)),
        }
    }

    /// Density \[kg/m³\] beyond which snow is not compacted.
    #[inline]
    pub fn densest(&self) -> f64 {
        match self.hardness_law {
            HardnessLaw::Alpine => alpine::PRESSED_DENSITY.into(),
            _ => self.max_density,
        }
    }

    /// Stiffness k = ρⁿ \[Pa/m\] of snow of a density \[kg/m³\].
    #[inline]
    pub fn stiffness(&self, density: f32) -> f32 {
        density.powf(self.stiffness_exponent as f32)
    }
}

/// What hardness owes to temperature, and to the grains.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Strength {
    Calibrated { temperature: f32 },
    Regression { temperature: f32 },
    Gold { prefactor: f32, warmth: f32 },
    Alpine(alpine::Strength),
}

impl Strength {
    /// Hardness \[Pa\] of snow of a density \[kg/m³\].
    #[inline]
    pub fn hardness(&self, density: f32) -> f32 {
        match *self {
            Strength::Calibrated { temperature } => {
                let held = temperature.max(coldest_stiffening(density));
                polynomial(density, held, 0.0, 0.260_723)
            }
            Strength::Regression { temperature } => {
                polynomial(density, temperature, 0.261_043, -0.000_32)
            }
            Strength::Gold { prefactor, warmth } => {
                prefactor * (density / 20.0).powf(3.92) * warmth
            }
            Strength::Alpine(strength) => strength.hardness(density),
        }
    }

    /// What makes of hardness something that is about proportional to density.
    pub fn root(&self) -> fn(f32) -> f32 {
        match self {
            Strength::Calibrated { .. } | Strength::Regression { .. } => f32::sqrt,
            Strength::Gold { .. } | Strength::Alpine(_) => |hardness| hardness.sqrt().sqrt(),
        }
    }
}

/// Gold's hardness \[Pa\] of snow of 20 kg/m³ at −3 °C with grains of a size \[mm\].
#[inline]
pub fn gold_prefactor(grain_size_mm: f64) -> f32 {
    (367.72 * (-0.340 * (grain_size_mm - 0.5)).exp()) as f32
}

/// The regression polynomial of Barakhtanov et al. with its two disputed cubic coefficients.
#[inline]
fn polynomial(r: f32, t: f32, a: f32, b: f32) -> f32 {
    let value = -0.165_99 + 0.542_153 * r - 0.089_25 * t + 0.447_667 * r * r + 0.159_256 * r * t
        - 0.013_36 * t * t
        + a * r * r * r
        - 0.158_63 * r * r * t
        + 0.022_601 * r * t * t
        + b * t * t * t;
    value.max(0.0)
}

/// T*(ρ): the temperature \[°C\] below which the calibrated polynomial would soften again, the
/// smaller root of its derivative by temperature.
#[inline]
fn coldest_stiffening(r: f32) -> f32 {
    let a = 3.0 * 0.260_723;
    let b = 2.0 * (0.022_601 * r - 0.013_36);
    let c = -0.089_25 + 0.159_256 * r - 0.158_63 * r * r;
    (-b - (b * b - 4.0 * a * c).sqrt()) / (2.0 * a)
}
