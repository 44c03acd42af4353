//! Prints: a column that a load has pressed all the way, at once.

use crate::coverage::Coverage;
use crate::grid::Grid;
use crate::material::Material;

use super::{CELL, Cell, Column, Compaction, SurfaceLoad, spread, weight};

impl Column {
    /// Presses the column a part of the way to where it carries a load, in parts of [`Coverage::WHOLE`]. Cells that do
    /// not feel the load stay as they are. Returns the dent in thickness quanta. Stresses are not evaluated.
    pub fn stamp(&mut self, grid: &Grid, material: &Material, load: SurfaceLoad, part: u32) -> u32 {
        let law = Compaction::new(grid, material, 0.0);
        let metres = grid.cell_size as f32 / CELL as f32;
        let (mut mass, mut above, mut dent) = (0_u32, 0_u32, 0);
        for (rank, cell) in self.cells.iter_mut().rev().enumerate() {
            mass += cell.mass;
            let weight = weight(mass);
            let carries = |thickness: u32| {
                let depth = (above as f32 + 0.5 * thickness as f32) * metres;
                let felt = load.pressure
                    * spread(material.load_distribution, depth, load.width, rank == 0);
                felt <= 0.0 || law.hardness(&Cell { thickness, ..*cell }) >= weight + felt
            };
            let pressed = if carries(cell.thickness) {
                cell.thickness
            } else {
                super::press::thickest(law.least(cell).min(cell.thickness), cell.thickness, carries)
            };
            above += pressed;
            let part = (u64::from(cell.thickness - pressed) * u64::from(part)
                / u64::from(Coverage::WHOLE)) as u32;
            cell.thickness -= part;
            dent += part;
        }
        dent
    }
}
