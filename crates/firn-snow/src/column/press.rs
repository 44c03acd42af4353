//! Cells that are pressed by what stands on them, rather than creep under it.
//!
//! The load's stress comes on top of what a cell carries by itself: the snow above it, or less where it still
//! gives way to that.

use crate::grid::Grid;
use crate::material::Material;

use super::{Cell, Column, Compaction, weight};

impl Column {
    /// Runs a cycle of `dt` seconds under the present stress, in which loads press the cells that feel any by up
    /// to `step` quanta and the others creep; returns whether a cell has changed.
    pub fn press(&mut self, grid: &Grid, material: &Material, step: u32, dt: f32) -> bool {
        let law = Compaction::new(grid, material, dt);
        let (mut mass, mut changed) = (0_u32, false);
        for cell in self.cells.iter_mut().rev() {
            mass += cell.mass;
            let weight = weight(mass);
            // It is the same sum as in the stress: equal where nothing else is in that.
            changed |= match cell.stress > weight {
                true => law.press(cell, weight, step),
                false => law.run(cell, 1) > 0,
            };
        }
        changed
    }
}

impl Compaction<'_> {
    /// Presses a cell to the largest thickness at which it carries its load, by up to `step` quanta; returns
    /// whether that changed it.
    fn press(&self, cell: &mut Cell, weight: f32, step: u32) -> bool {
        let hardness = self.hardness(cell);
        let wanted =
            if hardness < weight { hardness + (cell.stress - weight) } else { cell.stress };
        let least = self.least(cell).max(cell.thickness.saturating_sub(step));
        if hardness >= wanted || least >= cell.thickness {
            return false;
        }
        let carries = |thickness| self.hardness(&Cell { thickness, ..*cell }) >= wanted;
        cell.thickness = thickest(least, cell.thickness, carries);
        true
    }
}

/// The largest thickness from `least` up to below `present` at which something holds that holds for thin cells and not for
/// thick ones; `least` where it holds nowhere.
pub(super) fn thickest(least: u32, present: u32, holds: impl Fn(u32) -> bool) -> u32 {
    if !holds(least) {
        return least;
    }
    let (mut low, mut high) = (least, present);
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}
