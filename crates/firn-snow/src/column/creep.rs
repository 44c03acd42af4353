//! How far a column gives way under a load in a time, found by running the cycles of that time.

use crate::grid::Grid;
use crate::material::Material;

use super::{Column, Compaction, SurfaceLoad};

impl Column {
    /// The column after a number of cycles of `dt` seconds under a load, the settling of the snow that is
    /// still in motion included: what an object does that stands on level snow for so long.
    pub fn creep(
        &self,
        grid: &Grid,
        material: &Material,
        load: SurfaceLoad,
        dt: f32,
        cycles: u32,
    ) -> Column {
        let law = Compaction::new(grid, material, dt);
        let mut column = self.clone();
        for _ in 0..cycles {
            column.stress(grid, material, &[load]);
            let moved = column.cells.iter_mut().fold(0, |moved, cell| moved + law.run(cell, 1));
            if moved == 0 {
                break;
            }
        }
        column
    }
}
