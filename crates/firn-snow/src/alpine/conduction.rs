//! Heat that is conducted through snow and soil, implicitly: eliminated from the soil upwards, so that the
//! topmost temperature depends on that of the skin alone, and substituted downwards.

use super::FUSION;
use super::surface::{SOIL_THICKNESS, Surface};
use super::wet::kilograms;
use crate::column::Cell;

/// Conductivity of soil \[W/(m K)\].
const SOIL_CONDUCTIVITY: f32 = 0.5;

/// Heat capacity of soil \[J/(m³ K)\].
const SOIL_CAPACITY: f32 = 2.5e6;

/// Heat of fusion of the water in soil \[J/m³\], which freezes from 0 down to −1 °C.
const SOIL_FUSION: f32 = 0.5 * FUSION * 1000.0;

/// Least half of a cell's resistance \[m² K/W\], that of some micrometres of snow: through less, f32 tells no heat
/// that is conducted from the rounding of temperatures.
const LEAST_HALF: f32 = 1e-4;

/// Heat that comes from below the soil \[W/m²\].
pub(super) const GROUND_HEAT: f32 = 2.0;

/// T = `free` + `bound` · T of the element above.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Eliminated {
    pub free: f32,
    pub bound: f32,
}

/// Room in which a column's step is worked out, to be used again for the next column.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    soil: [Eliminated; 4],
    cells: Vec<Eliminated>,
}

/// Half of an element's resistance \[m² K/W\].
#[inline]
fn half(thickness: f32, conductivity: f32) -> f32 {
    0.5 * thickness / conductivity
}

/// Conductivity of dry snow \[W/(m K)\] of a density \[kg/m³\] (Calonne et al. 2011). Of wet snow its ice conducts.
#[inline]
pub(super) fn conductivity(density: f32) -> f32 {
    2.5e-6 * density * density - 1.23e-4 * density + 0.024
}

/// Half the resistance of a cell \[m² K/W\], `metres` being those of a thickness quantum.
#[inline]
pub(super) fn half_of(cell: &Cell, metres: f32) -> f32 {
    let thickness = cell.thickness as f32 * metres;
    half(thickness, conductivity(kilograms(cell.ice()) / thickness)).max(LEAST_HALF)
}

/// Heat that warms a layer of soil of a temperature \[°C\] by 1 K \[J/(m² K)\].
pub(super) fn capacity_of_soil(layer: usize, temperature: f32) -> f32 {
    let freezing = if temperature > -1.0 && temperature < 0.0 { SOIL_FUSION } else { 0.0 };
    (SOIL_CAPACITY + freezing) * SOIL_THICKNESS[layer]
}

/// Half the resistance of the topmost layer of soil \[m² K/W\].
pub(super) fn half_of_ground() -> f32 {
    half(SOIL_THICKNESS[0], SOIL_CONDUCTIVITY)
}

impl Scratch {
    /// Eliminates soil and cells from below. `source` is heat that comes into the topmost cell \[W/m²\]. Returns the
    /// topmost element in terms of the skin.
    pub(super) fn eliminate(
        &mut self,
        cells: &[Cell],
        soil: &[f32; 4],
        metres: f32,
        source: f32,
        seconds: f32,
    ) -> Eliminated {
        let mut below = Eliminated { free: 0.0, bound: 1.0 };
        // Conductance to the element below; none under the soil.
        let (mut conductance, mut resistance) = (0.0, 0.0);
        let first = cells.first().map_or(0.0, |cell| half_of(cell, metres));
        for layer in (0..4).rev() {
            let temperature = soil[layer];
            let capacity = capacity_of_soil(layer, temperature) / seconds;
            let own = half(SOIL_THICKNESS[layer], SOIL_CONDUCTIVITY);
            let above = match layer {
                0 => first,
                _ => half(SOIL_THICKNESS[layer - 1], SOIL_CONDUCTIVITY),
            };
            let up = 1.0 / (own + above);
            let heat = if layer == 3 { GROUND_HEAT } else { 0.0 };
            below = eliminated(below, conductance, up, capacity, temperature, heat);
            self.soil[layer] = below;
            (conductance, resistance) = (up, above);
        }
        self.cells.clear();
        for (index, cell) in cells.iter().enumerate() {
            let own = resistance;
            let above = cells.get(index + 1).map_or(0.0, |above| half_of(above, metres));
            let up = 1.0 / (own + above);
            let heat = if index + 1 == cells.len() { source } else { 0.0 };
            let capacity = cell.capacity() / seconds;
            below = eliminated(below, conductance, up, capacity, cell.celsius(), heat);
            self.cells.push(below);
            (conductance, resistance) = (up, above);
        }
        below
    }

    /// Temperature of a cell, from that of the element above it.
    pub(super) fn cell(&self, index: usize, above: f32) -> f32 {
        self.cells[index].free + self.cells[index].bound * above
    }

    /// Substitutes the soil under snow. Energy that has found no snow left to melt \[J/m²\] warms it, to no more than the
    /// air or than it was; what is left of that goes back into the air, and is returned.
    pub(super) fn ground(&self, surface: &mut Surface, above: f32, air: f32, energy: f32) -> f32 {
        let before = surface.soil[0];
        self.soil(surface, above);
        let capacity = capacity_of_soil(0, before);
        let room = capacity * (air.max(before) - surface.soil[0]).max(0.0);
        let taken = energy.min(room);
        surface.soil[0] += taken / capacity;
        energy - taken
    }

    /// Substitutes the soil, from the temperature above it \[°C\].
    pub(super) fn soil(&self, surface: &mut Surface, mut above: f32) {
        for (layer, temperature) in self.soil.iter().zip(&mut surface.soil) {
            *temperature = layer.free + layer.bound * above;
            above = *temperature;
        }
    }
}

/// An element, in terms of the one above: `below` eliminated, `down` and `up` the conductances to its
/// neighbours, its capacity by the length of the step \[W/(m² K)\] and its temperature before.
#[inline]
fn eliminated(
    below: Eliminated,
    down: f32,
    up: f32,
    capacity: f32,
    temperature: f32,
    heat: f32,
) -> Eliminated {
    let whole = capacity + down * (1.0 - below.bound) + up;
    Eliminated {
        free: (capacity * temperature + heat + down * below.free) / whole,
        bound: up / whole,
    }
}
