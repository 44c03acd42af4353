//! Cells that are pressed by what stands on them, rather than creep under it.
//!
//! The load's stress comes on top of what a cell carries by itself: the snow above it, or less where it still
//! gives way to that. Alpine snow doesn't carry its own weight: it settles under that.

use crate::grid::Grid;
use crate::material::Material;

use super::{CELL, Cell, Column, Compaction, weight};

impl Column {
    /// Runs a cycle of `dt` seconds under the present stress. Loads press by up to `step` quanta; without a step
    /// the snow creeps under them, but for alpine snow, which they press at once. Returns whether a cell has changed.
    #[inline]
    pub(crate) fn cycle(
        &mut self,
        grid: &Grid,
        material: &Material,
        step: Option<u32>,
        dt: f32,
    ) -> bool {
        match step {
            Some(step) => self.press(grid, material, step, dt),
            None if material.hardness_law.is_alpine() => self.press(grid, material, CELL, dt),
            None => self.compact(grid, material, 1, dt) > 0,
        }
    }

    /// Runs a cycle of `dt` seconds under the present stress, in which loads press the cells that feel any by up
    /// to `step` quanta and the others creep; returns whether a cell has changed.
    pub fn press(&mut self, grid: &Grid, material: &Material, step: u32, dt: f32) -> bool {
        let law = Compaction::new(grid, material, dt);
        let alpine = material.hardness_law.is_alpine();
        let (mut mass, mut changed) = (0_u32, false);
        for cell in self.cells.iter_mut().rev() {
            mass += cell.mass;
            let weight = weight(mass);
            // It is the same sum as in the stress: equal where nothing else is in that.
            changed |= match cell.stress > weight {
                true if alpine => law.press_alpine(cell, cell.stress - weight, step),
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

/// The largest thickness from `least` up to below `present` for which `holds` is true, given that it is true for thin
/// cells and false for thick ones; `least` if it is true for none.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::HardnessLaw;

    const MATERIAL: Material = Material {
        fresh_density: 20.0,
        max_density: 400.0,
        stiffness_exponent: 3.56,
        hardness_law: HardnessLaw::Calibrated,
        grain_size_mm: 0.5,
        load_distribution: crate::LoadDistribution::TwoToOne,
    };

    /// 60 kg/m³ that carry their own weight, and a load beside it \[Pa\].
    fn cell(load: f32) -> Cell {
        let mass = 12 << 18;
        Cell { mass, thickness: CELL, temperature: -3.0, stress: weight(mass) + load }
    }

    fn pressed(cell: Cell, material: &Material, step: u32) -> (bool, Cell) {
        let mut column = Column { cells: vec![cell] };
        let changed = column.press(&Grid::default(), material, step, 1.0 / 60.0);
        (changed, column.cells[0])
    }

    #[test]
    fn a_cell_is_pressed_to_the_largest_thickness_at_which_it_carries() {
        for hardness_law in [HardnessLaw::Calibrated, HardnessLaw::Regression, HardnessLaw::Gold] {
            let material = Material { hardness_law, ..MATERIAL };
            let grid = Grid::default();
            let law = Compaction::new(&grid, &material, 0.1);
            let load = 1.5 * law.hardness(&cell(0.0));
            let (changed, after) = pressed(cell(load), &material, CELL);
            assert!(changed && after.thickness < CELL);
            assert!(law.hardness(&after) >= after.stress, "{hardness_law:?}");
            let thicker = Cell { thickness: after.thickness + 100, ..after };
            assert!(law.hardness(&thicker) < after.stress, "{hardness_law:?}");
            assert_eq!(pressed(after, &material, CELL), (false, after), "then it rests");
        }
    }

    #[test]
    fn it_is_pressed_no_further_in_a_cycle_than_a_step_and_never_past_the_densest() {
        assert_eq!(pressed(cell(1e6), &MATERIAL, 1000).1.thickness, CELL - 1000);
        let flat = pressed(cell(1e9), &MATERIAL, CELL).1;
        let densest = f64::from(CELL) * 60.0 / 400.0;
        assert!((f64::from(flat.thickness) - densest).abs() < 2.0, "{}", flat.thickness);
        assert_eq!(pressed(flat, &MATERIAL, CELL), (false, flat));
        assert_eq!(pressed(cell(1.0), &MATERIAL, CELL), (false, cell(1.0)), "it carries that");
    }

    #[test]
    fn snow_that_gives_way_to_its_own_weight_is_pressed_by_the_load_alone() {
        // Under a metre and a half of its like, and half as much again from an object.
        let (grid, below) = (Grid::default(), Cell { mass: 4 << 18, ..cell(0.0) });
        let above = Cell { mass: 100 << 18, stress: weight(100 << 18), ..cell(0.0) };
        let overburden = weight(104 << 18);
        let law = Compaction::new(&grid, &MATERIAL, 1.0 / 60.0);
        let hardness = law.hardness(&below);
        assert!(hardness < overburden);
        let mut column =
            Column { cells: vec![Cell { stress: overburden + 500.0, ..below }, above] };
        assert!(column.press(&grid, &MATERIAL, CELL, 1.0 / 60.0));
        let reached = law.hardness(&column.cells[0]);
        assert!((reached - hardness - 500.0).abs() < 0.1, "{hardness} {reached}");
        // Without the load it creeps, as it does in any other column.
        let laden = Column { cells: vec![Cell { stress: overburden, ..below }, above] };
        let (mut presses, mut creeps) = (laden.clone(), laden);
        presses.press(&grid, &MATERIAL, CELL, 1.0 / 60.0);
        creeps.compact(&grid, &MATERIAL, 1, 1.0 / 60.0);
        assert_eq!(presses, creeps);
    }
}
