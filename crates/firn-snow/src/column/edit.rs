//! Snow that is laid on a column and taken off it.

use crate::grid::CELL;
use crate::recut::recut;

use super::{Cell, Column, mixed};

/// Largest difference in temperature \[°C\] at which fresh snow tops up the cell below.
const TOP_UP_TEMPERATURE: f32 = 0.25;

/// Snow that is still to be laid on a column.
struct Fall {
    mass: u32,
    depth: u32,
    /// Mass of a full cell of this snow.
    share: u64,
    temperature: f32,
}

impl Fall {
    fn new(mass: u32, depth: u32, temperature: f32) -> Fall {
        let share = u64::from(mass) * u64::from(CELL) / u64::from(depth.max(1));
        Fall { mass, depth, share, temperature }
    }

    /// Takes off a piece of a thickness, and returns its mass.
    #[inline]
    fn take(&mut self, thickness: u32) -> u32 {
        let mass = if thickness == self.depth {
            self.mass
        } else {
            // A piece's share of the mass is part of the mass, which fits 32 bits.
            (self.share * u64::from(thickness) / u64::from(CELL)) as u32
        };
        self.depth -= thickness;
        self.mass -= mass;
        mass
    }
}

impl Column {
    /// Lays snow of a mass and a depth, both in quanta, on top; returns the mass that did not fit
    /// in the column's slots.
    pub fn deposit(&mut self, slots: u32, mass: u32, depth: u32, temperature: f32) -> u32 {
        let mut fall = Fall::new(mass, depth, temperature);
        self.lay(&mut fall, slots);
        if fall.depth > 0 {
            recut(&mut self.cells);
            self.open_cells(&mut fall, slots);
        }
        fall.mass
    }

    /// The same on alpine snow, of which no cell is cut anew to make room: water would go astray. Nor does it top up
    /// a cell that is wet.
    pub fn deposit_alpine(&mut self, slots: u32, mass: u32, depth: u32, temperature: f32) -> u32 {
        let mut fall = Fall::new(mass, depth, temperature.min(0.0));
        self.lay(&mut fall, slots);
        fall.mass
    }

    /// Lays snow as far as there is room.
    fn lay(&mut self, fall: &mut Fall, slots: u32) {
        if fall.depth > 0 {
            self.top_up(fall);
            self.open_cells(fall, slots);
        }
    }

    /// Fills the top cell up to full thickness where it is much like the snow that falls.
    fn top_up(&mut self, fall: &mut Fall) {
        let Some(top) = self.cells.last_mut() else { return };
        let like = fall.share.saturating_mul(u64::from(top.thickness));
        let same_density =
            (u64::from(top.mass) * u64::from(CELL)).abs_diff(like).saturating_mul(20) <= like;
        // The word of a wet cell is 2 or more, far from any temperature of snow.
        let same_temperature = (top.temperature - fall.temperature).abs() <= TOP_UP_TEMPERATURE;
        if top.thickness >= CELL || !same_density || !same_temperature {
            return;
        }
        let thickness = fall.depth.min(CELL - top.thickness);
        let mass = fall.take(thickness);
        top.temperature = mixed(top.temperature, top.mass, fall.temperature, mass);
        top.mass += mass;
        top.thickness += thickness;
    }

    /// Opens full cells, the last one thinner, as long as there are slots.
    fn open_cells(&mut self, fall: &mut Fall, slots: u32) {
        while fall.depth > 0 && self.cells.len() < slots as usize {
            let thickness = fall.depth.min(CELL);
            let mut mass = fall.take(thickness);
            if mass == 0 {
                // Too thin a rest to have a quantum of mass of its own.
                match self.cells.last_mut() {
                    Some(below) if below.ice() > 1 => below.mass -= 1,
                    _ => {
                        fall.depth = 0;
                        return;
                    }
                }
                mass = 1;
            }
            let temperature = fall.temperature;
            self.cells.push(Cell { mass, thickness, temperature, stress: 0.0 });
        }
    }

    /// Removes what is above a depth in quanta; returns the mass removed. The cell that is cut
    /// keeps its part of the mass and of the water, rounded down, and goes whole where that is nothing.
    pub fn clear(&mut self, depth: u32) -> u32 {
        let mut left = depth;
        let mut cleared = 0;
        self.cells.retain_mut(|cell| {
            let kept = cell.thickness.min(left);
            left -= kept;
            cleared += cell.cut(kept);
            cell.mass > 0
        });
        cleared
    }
}
