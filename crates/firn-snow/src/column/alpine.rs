//! Alpine snow under loads. Its own weight has no part in it.

use crate::alpine::Strength;

use super::{Cell, Compaction};

/// A cell that would lose less than this part of its thickness, as a power of 1/2, is at rest. Far smaller errors of
/// rounding, here or on a GPU, thus never move a cell that has been pressed to where it carries its load.
const REST: u32 = 14;

/// Most times that the thickness of a wet cell is found from how wet it would be. The error falls by half each
/// time at the least.
const MOST_TURNS: u32 = 16;

impl Compaction<'_> {
    /// Presses a cell of alpine snow to the thickness at which its hardness is that of a load's stress \[Pa\], by up
    /// to `step` quanta; returns whether that changed it.
    pub(super) fn press_alpine(&self, cell: &mut Cell, stress: f32, step: u32) -> bool {
        let thickness = self.carrying(cell, stress).max(cell.thickness.saturating_sub(step));
        let changed = thickness < cell.thickness;
        cell.thickness = thickness;
        changed
    }

    /// The thickness in quanta to which a load presses a cell: the present one where it carries it.
    fn carrying(&self, cell: &Cell, stress: f32) -> u32 {
        let strength = Strength::of(cell);
        let content = cell.mass as f32 * self.density;
        let least = self.least(cell);
        let mut thickness = cell.thickness;
        for _ in 0..MOST_TURNS {
            let density = content / thickness as f32;
            let wanted = content / strength.pressed(stress, density);
            let next = (wanted.min(thickness as f32) as u32).max(least);
            if next + (thickness >> REST) >= thickness {
                break;
            }
            thickness = next;
            if strength.is_dry() {
                break;
            }
        }
        thickness
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alpine::{self, PRESSED_DENSITY};
    use crate::column::{CELL, Column};
    use crate::{Grid, HardnessLaw, Material};

    /// 150 kg/m³ in cells of 0.2 m, of which some is water.
    fn cell(celsius: f32, water: f32) -> Cell {
        let mut cell = Cell { mass: 30 << 18, thickness: CELL, ..Cell::default() };
        cell.set_heat(celsius, (water * cell.mass as f32) as u32);
        cell
    }

    fn pressed(cell: Cell, stress: f32, step: u32) -> (bool, Cell) {
        let material = Material { hardness_law: HardnessLaw::Alpine, ..Material::default() };
        let grid = Grid::default();
        let weight = crate::column::weight(cell.mass);
        let mut column = Column { cells: vec![Cell { stress: weight + stress, ..cell }] };
        assert_eq!(column.compact(&grid, &material, 100, 1.0), 0, "it never creeps");
        let changed = column.press(&grid, &material, step, 1.0);
        (changed, Cell { stress: cell.stress, ..column.cells[0] })
    }

    fn density(cell: &Cell) -> f32 {
        cell.mass as f32 / cell.thickness as f32 * 320.0
    }

    #[test]
    fn a_load_presses_to_where_it_is_carried_and_then_no_quantum_moves() {
        for celsius in [0.0, -0.3, -20.0] {
            for water in [0.0, 1e-6, 0.01, 0.03, 0.06, 0.13, 0.3] {
                for stress in [500.0, 1500.0, 3000.0, 12e3, 70e3] {
                    let (changed, after) = pressed(cell(celsius, water), stress, CELL);
                    let wetness =
                        after.water() as f32 / after.mass as f32 * density(&after) / 1000.0;
                    let hardness = alpine::hardness(density(&after), after.celsius(), wetness);
                    // A part in 16384 of the thickness is four of hardness, and half as much again below a wet cell's.
                    assert!(hardness > 0.999 * stress, "{celsius} {water} {stress}: {hardness}");
                    assert!(!changed || hardness < 1.001 * stress, "{celsius} {water} {stress}");
                    assert_eq!(pressed(after, stress, CELL), (false, after), "it rests");
                }
            }
        }
    }

    #[test]
    fn a_cycle_takes_no_more_than_a_step_and_nothing_gets_too_dense() {
        let (wet, dry) = (cell(0.0, 0.02), cell(-3.0, 0.0));
        for cell in [wet, dry] {
            let there = pressed(cell, 20e3, CELL).1;
            let (mut step, mut cycles) = (cell, 0);
            while let (true, after) = pressed(step, 20e3, 100_000) {
                assert!(step.thickness - after.thickness <= 100_000);
                (step, cycles) = (after, cycles + 1);
            }
            assert!(step.thickness.abs_diff(there.thickness) <= there.thickness >> REST);
            assert_eq!(cycles, (CELL - there.thickness).div_ceil(100_000));
            let flat = pressed(cell, 1e9, CELL).1;
            assert!((density(&flat) - PRESSED_DENSITY).abs() < 0.01, "{}", density(&flat));
        }
        let firn = Cell { thickness: CELL / 5, ..dry };
        assert_eq!(pressed(firn, 1e9, CELL), (false, firn), "it is denser already");
    }
}
