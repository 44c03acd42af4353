//! Where a column comes to rest under a load, found without running all the cycles that lead there.
//!
//! Cells only get thinner, so the load on the surface only comes closer to the cells below and
//! stress never falls. A cell therefore ends at the first thickness at which it rests under the
//! stress of the end, whatever the path; and as no cell feels those below, a scan from the top down
//! finds the thicknesses one by one. The one exception is a cycle that presses a cell past the
//! thickness at which it would rest, as light snow under a heavy load: such cycles are run. Cells that are
//! pressed never go past it.

use crate::grid::Grid;
use crate::material::Material;

use super::press::thickest;
use super::{CELL, Cell, Column, Compaction, SurfaceLoad, spread, weight};

/// Halvings of a cell's thickness: an indent of up to 1/64 of it is smooth wherever it ends.
const SMOOTH: u32 = 6;

/// Halvings of a cell's thickness: an indent of up to 1/4096 of it may end past the equilibrium.
const NEGLIGIBLE: u32 = 12;

/// Most cycles that are run before the scan. Where indents are not smooth, they are large: few
/// cycles suffice.
const MOST_CYCLES: u32 = 1000;

impl Column {
    /// The column as it comes to rest under a load after cycles of `dt` seconds, the settling of
    /// the snow that is still in motion included. Δt matters in two ways: long cycles press light
    /// snow past its equilibrium, and a cell rests where a cycle's indent rounds to nothing. Where
    /// the load `presses`, as it always does alpine snow, a cell under it does not creep, and rests where it carries
    /// the stress on it.
    pub fn equilibrium(
        &self,
        grid: &Grid,
        material: &Material,
        load: SurfaceLoad,
        presses: bool,
        dt: f32,
    ) -> Column {
        let law = Compaction::new(grid, material, dt);
        let presses = presses || material.hardness_law.is_alpine();
        let mut column = self.clone();
        for _ in 0..MOST_CYCLES {
            column.stress(grid, material, &[load]);
            if !law.runs_rough(&mut column.cells, presses) {
                break;
            }
        }
        law.scan(grid, &mut column.cells, load, presses);
        column
    }

    /// Hardness \[Pa\] of the topmost cell; `None` where there is no snow.
    pub fn surface_hardness(&self, grid: &Grid, material: &Material) -> Option<f32> {
        self.cells.last().map(|top| top.hardness(grid, material))
    }
}

impl Cell {
    /// Its hardness \[Pa\].
    pub fn hardness(&self, grid: &Grid, material: &Material) -> f32 {
        Compaction::new(grid, material, 0.0).hardness(self)
    }
}

impl Compaction<'_> {
    /// Runs a cycle of the cells that creep; returns whether an indent was large or took a cell past its
    /// equilibrium.
    fn runs_rough(&self, cells: &mut [Cell], presses: bool) -> bool {
        let (mut mass, mut rough) = (0_u32, false);
        for cell in cells.iter_mut().rev() {
            mass += cell.mass;
            if presses && cell.stress > weight(mass) {
                continue;
            }
            let before = cell.thickness;
            self.run(cell, 1);
            let indent = before - cell.thickness;
            rough |= indent > before >> SMOOTH
                || (indent > before >> NEGLIGIBLE
                    && !self.is_densest(cell)
                    && self.hardness(cell) > cell.stress);
        }
        rough
    }

    /// Takes every cell, from the top down, to the thickness at which it rests.
    fn scan(&self, grid: &Grid, cells: &mut [Cell], load: SurfaceLoad, presses: bool) {
        let metres = grid.cell_size as f32 / CELL as f32;
        let (mut mass, mut above) = (0_u32, 0_u32);
        for (rank, cell) in cells.iter_mut().rev().enumerate() {
            mass += cell.mass;
            let weight = weight(mass);
            let stressed = |thickness: u32| {
                let depth = (above as f32 + 0.5 * thickness as f32) * metres;
                let part = spread(self.material.load_distribution, depth, load.width, rank == 0);
                Cell { thickness, stress: weight + load.pressure * part, ..*cell }
            };
            let rests = |thickness: u32| {
                let cell = stressed(thickness);
                self.is_densest(&cell)
                    || match presses && cell.stress > weight {
                        true => self.hardness(&cell) >= self.borne(cell.stress, weight),
                        false => self.indent(&cell, cell.mass as f32) == 0,
                    }
            };
            // Hardness rises faster with density than stress does as the load comes closer, so there is
            // one thickness from which on the cell rests.
            let (least, present) = (self.least(cell), cell.thickness);
            let thickness = if rests(present) { present } else { thickest(least, present, rests) };
            *cell = stressed(thickness);
            above += thickness;
        }
    }

    fn is_densest(&self, cell: &Cell) -> bool {
        cell.thickness <= self.least(cell)
    }
}
