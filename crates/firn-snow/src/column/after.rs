//! How far a column gives way under a load in a time, found by running the cycles of that time.

use crate::grid::Grid;
use crate::material::Material;

use super::{Column, SurfaceLoad};

impl Column {
    /// The column after a number of cycles of `dt` seconds under a load, as under an object that stands on level
    /// snow for that time. Snow that is still settling goes on to do so. The load presses by up to `step` quanta
    /// in a cycle; without a step the snow creeps under it, but for alpine snow, which it presses at once.
    pub fn after(
        &self,
        grid: &Grid,
        material: &Material,
        load: SurfaceLoad,
        step: Option<u32>,
        dt: f32,
        cycles: u32,
    ) -> Column {
        let mut column = self.clone();
        for _ in 0..cycles {
            column.stress(grid, material, &[load]);
            if !column.cycle(grid, material, step, dt) {
                break;
            }
        }
        column
    }
}
