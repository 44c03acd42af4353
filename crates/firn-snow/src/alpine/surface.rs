//! What a column of alpine snow has beside its cells.

/// Thickness of the layers of soil under the snow, from the top down \[m\].
pub const SOIL_THICKNESS: [f32; 4] = [0.1, 0.2, 0.4, 0.8];

/// Albedo of new snow.
pub(super) const FRESH_ALBEDO: f32 = 0.90;

/// Albedo of ground without snow.
pub(super) const GROUND_ALBEDO: f32 = 0.2;

/// What a column of alpine snow has beside its cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Albedo of the snow, were it deep.
    pub albedo: f32,
    /// Temperature of the skin of snow or ground \[°C\].
    pub skin: f32,
    /// Temperatures of the soil, from the top down \[°C\].
    pub soil: [f32; 4],
    /// Water that has run off, in mass quanta.
    pub runoff: u64,
}

impl Surface {
    /// Ground without snow, under air of a temperature \[°C\].
    pub fn new(soil: [f32; 4], air: f32) -> Surface {
        Surface { albedo: FRESH_ALBEDO, skin: air, soil, runoff: 0 }
    }

    /// The albedo that is seen where snow lies so deep \[m\]: thin snow lets the ground shine through.
    pub fn seen_albedo(&self, depth: f32) -> f32 {
        GROUND_ALBEDO + (self.albedo - GROUND_ALBEDO) * (1.0 - (-depth / 0.02).exp())
    }
}
