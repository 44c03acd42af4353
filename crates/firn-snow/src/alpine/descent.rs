//! What goes through a column from the skin down in a step: vapour that leaves, energy that melts, water that
//! seeps, and the weight under which snow settles.

use super::wet::{capacity, kilograms, part, quanta};
use super::{FUSION, ICE_DENSITY, MASS_QUANTUM, WATER_DENSITY};
use crate::column::Cell;
use crate::grid::CELL;
use crate::material::GRAVITY;

/// Part of the pores that holds water against gravity.
const HELD: f32 = 0.05;

/// A cell in the middle of a step, when it may be warmer than 0 °C, or cold and wet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layer {
    pub ice: u32,
    pub water: u32,
    pub thickness: u32,
    pub celsius: f32,
}

impl Layer {
    /// A cell, at the temperature to which heat was conducted.
    pub fn of(cell: &Cell, celsius: f32) -> Layer {
        Layer { ice: cell.ice(), water: cell.water(), thickness: cell.thickness, celsius }
    }

    /// Puts it back; without ice it is gone.
    pub fn store(&self, cell: &mut Cell) {
        cell.mass = self.ice + self.water;
        cell.thickness = self.thickness;
        cell.set_heat(self.celsius, self.water);
    }

    /// Takes off ice, and thickness with it.
    fn lose(&mut self, ice: u32) {
        if ice == 0 {
            return;
        }
        let left = self.ice - ice;
        let thickness = part(self.thickness, left as f32 / self.ice as f32).max(1);
        (self.ice, self.thickness) = (left, thickness.min(self.thickness));
    }
}

/// What has come down to a cell from those above.
#[derive(Clone, Copy, Debug)]
pub(super) struct Descent {
    /// Metres of a thickness quantum.
    pub metres: f32,
    /// Length of the step \[s\].
    pub seconds: f32,
    /// Mass that leaves as vapour, in quanta.
    pub vapour: u32,
    /// Vapour is taken from water first.
    pub from_water: bool,
    /// Energy that melts \[J/m²\]; that of the skin, and of cells that are gone.
    pub energy: f32,
    /// Water in mass quanta.
    pub water: u32,
    /// Mass of the cells above, in quanta.
    pub above: u32,
    /// Heat that vapour has taken with it \[J/m²\], as ice or water, of which a part has melted before.
    pub taken: f32,
}

impl Descent {
    /// Goes through a cell.
    pub fn pass(&mut self, layer: &mut Layer) {
        self.sublimate(layer);
        self.melt(layer);
        if layer.ice > 0 {
            self.soak(layer);
        }
        if layer.ice == 0 {
            self.energy += capacity(0, layer.water) * layer.celsius;
            self.water += std::mem::take(&mut layer.water);
            return;
        }
        self.drain(layer);
        self.settle(layer);
        self.above += layer.ice + layer.water;
    }

    fn sublimate(&mut self, layer: &mut Layer) {
        if self.vapour == 0 {
            return;
        }
        if self.from_water {
            let water = self.vapour.min(layer.water);
            layer.water -= water;
            self.vapour -= water;
            self.taken += capacity(0, water) * layer.celsius + FUSION * kilograms(water);
        }
        let ice = self.vapour.min(layer.ice);
        layer.lose(ice);
        self.taken += capacity(ice, 0) * layer.celsius;
        self.vapour -= ice;
    }

    /// Melts by the skin's energy and by what the cell has above 0 °C; a cold cell is warmed to 0 °C first.
    fn melt(&mut self, layer: &mut Layer) {
        if layer.ice == 0 {
            return;
        }
        if layer.celsius > 0.0 {
            self.energy += capacity(layer.ice, layer.water) * layer.celsius;
            layer.celsius = 0.0;
        }
        if self.energy <= 0.0 {
            return;
        }
        if layer.celsius < 0.0 {
            let capacity = capacity(layer.ice, layer.water);
            let cold = -layer.celsius * capacity;
            if self.energy < cold {
                layer.celsius += self.energy / capacity;
                self.energy = 0.0;
                return;
            }
            self.energy -= cold;
            layer.celsius = 0.0;
        }
        let melted = quanta(self.energy / FUSION).min(layer.ice);
        let all = melted == layer.ice;
        layer.lose(melted);
        layer.water += melted;
        self.energy = if all { self.energy - FUSION * kilograms(melted) } else { 0.0 };
    }

    /// Takes in the water from above, which freezes by the cell's cold as far as ice has room.
    fn soak(&mut self, layer: &mut Layer) {
        let heat = capacity(layer.ice, layer.water) * layer.celsius;
        layer.water += std::mem::take(&mut self.water);
        if layer.water > 0 {
            let cold = quanta(-heat / FUSION);
            let room = quanta(self.pores(layer) * ICE_DENSITY);
            let frozen = cold.min(layer.water).min(room);
            layer.ice += frozen;
            layer.water -= frozen;
            let left = heat + FUSION * kilograms(frozen);
            let celsius = left / capacity(layer.ice, 0);
            layer.celsius = if frozen == cold { 0.0 } else { celsius };
        }
    }

    /// Part of a cell that is not ice \[m\].
    fn pores(&self, layer: &Layer) -> f32 {
        layer.thickness as f32 * self.metres - kilograms(layer.ice) / ICE_DENSITY
    }

    /// Lets go of the water that the pores don't hold. Cold snow with water left has no pores to speak of.
    fn drain(&mut self, layer: &mut Layer) {
        let held = match layer.celsius < 0.0 {
            true => 0,
            false => quanta(HELD * WATER_DENSITY * self.pores(layer)),
        };
        if layer.water > held {
            self.water = layer.water - held;
            layer.water = held;
        }
    }

    /// Settles by creep under the weight above, and by the growth of new snow's grains (Vionnet et al. 2012;
    /// Anderson 1976, Jordan 1991).
    fn settle(&self, layer: &mut Layer) {
        let mass = layer.ice + layer.water;
        let thickness = layer.thickness as f32 * self.metres;
        let density = kilograms(mass) / thickness;
        let wetness = kilograms(layer.water) / (WATER_DENSITY * thickness);
        let celsius = layer.celsius.min(0.0);
        let stress = GRAVITY as f32 * (self.above as f32 + 0.5 * mass as f32) * MASS_QUANTUM;
        let viscosity =
            1.5 * 7.622_37e6 * (density / 250.0) * (-0.1 * celsius + 0.023 * density).exp()
                / (1.0 + 60.0 * wetness);
        let growth = 1e-6 * (celsius / 23.8 - (density - 150.0).max(0.0) / 21.7).exp();
        let strain = ((stress / viscosity + growth) * self.seconds).min(0.5);
        let settled = part(layer.thickness, (-strain).exp());
        let solid = kilograms(layer.ice) / ICE_DENSITY + kilograms(layer.water) / WATER_DENSITY;
        let least = (solid / self.metres).ceil() as u32;
        layer.thickness = settled.max(least).clamp(1, CELL);
    }
}
