//! Alpine snow: it settles by creep, conducts heat, is warmed by sun and air, melts, soaks, freezes again and
//! runs off.
//!
//! A column takes one *weather step* after another, each of some minutes. In a step it needs nothing of its
//! neighbours. What happens in it is computed in f32, as on the GPU; every transfer of mass is rounded to quanta
//! once, so that nothing gets lost. `docs/alpine.md` holds the equations and where they come from.

mod conduction;
mod descent;
mod fall;
mod gathering;
mod hand_hardness;
mod hardness;
mod housekeeping;
mod shade;
mod skin;
mod step;
mod surface;
mod turbulence;
mod weather_step;
mod wet;

pub use conduction::Scratch;
pub use gathering::{Due, Gathering};
pub use hand_hardness::HandHardness;
pub(crate) use hardness::Strength;
pub use hardness::{PRESSED_DENSITY, hardness, pressed_density};
pub use shade::{Relief, Sweep};
pub use step::{Exchange, Stepped};
pub use surface::{SOIL_THICKNESS, Surface};
pub use weather_step::WeatherStep;

/// Specific heat of ice \[J/(kg K)\].
pub const ICE_HEAT: f32 = 2100.0;

/// Specific heat of water \[J/(kg K)\].
pub const WATER_HEAT: f32 = 4180.0;

/// Latent heat of fusion \[J/kg\].
pub const FUSION: f32 = 0.334e6;

/// Latent heat of vaporisation \[J/kg\].
pub const VAPORISATION: f32 = 2.501e6;

/// Density of ice \[kg/m³\].
pub const ICE_DENSITY: f32 = 917.0;

/// Density of water \[kg/m³\].
pub const WATER_DENSITY: f32 = 1000.0;

/// One mass quantum \[kg/m²\].
const MASS_QUANTUM: f32 = 1.0 / (1 << 18) as f32;

/// Mass quanta in 1 kg/m².
const MASS_QUANTA: f32 = (1 << 18) as f32;

#[cfg(test)]
mod tests;
