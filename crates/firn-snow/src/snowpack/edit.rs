//! Snow that is laid on a snowpack and taken off it.

use rayon::prelude::*;

use crate::column::Column;
use crate::grid::ColumnRect;

use super::Snowpack;
use super::tile::Tile;

impl Snowpack {
    /// Lets snow of a depth and an areal mass, both in quanta, fall on every column of a rectangle that no object
    /// shelters; returns the mass quanta refused.
    pub fn deposit(&mut self, rect: ColumnRect, depth: u32, mass: u32, temperature: f32) -> u64 {
        let slots = self.grid.height;
        let deposit = self.deposits();
        let fall = |column: &mut Column| deposit(column, slots, mass, depth, temperature);
        self.edit(rect, |tile| tile.sheltered, fall)
    }

    /// Lays snow on every column of a rectangle, under objects too; returns the mass quanta refused.
    pub fn lay(&mut self, rect: ColumnRect, depth: u32, mass: u32, temperature: f32) -> u64 {
        let slots = self.grid.height;
        let deposit = self.deposits();
        self.edit(rect, |_| 0, |column| deposit(column, slots, mass, depth, temperature))
    }

    /// How snow is laid on a column.
    fn deposits(&self) -> fn(&mut Column, u32, u32, u32, f32) -> u32 {
        match self.material.hardness_law.is_alpine() {
            true => Column::deposit_alpine,
            false => Column::deposit,
        }
    }

    /// Removes what is above a depth in quanta, under objects too; returns the mass quanta removed.
    pub fn strip(&mut self, rect: ColumnRect, depth: u32) -> u64 {
        self.edit(rect, |_| 0, |column| column.clear(depth))
    }

    /// Removes what is above a depth in quanta where no object stands; returns the mass quanta removed.
    pub fn clear(&mut self, rect: ColumnRect, depth: u32) -> u64 {
        self.edit(rect, |tile| tile.stood_on, |column| column.clear(depth))
    }

    /// Changes columns, but for those that are `spared` of a tile; returns the sum of what that returned.
    fn edit(
        &mut self,
        rect: ColumnRect,
        spared: impl Fn(&Tile) -> u64 + Sync,
        change: impl Fn(&mut Column) -> u32 + Sync,
    ) -> u64 {
        self.list_loads();
        let tiles = rect.tiles();
        let rows = self.tiles.par_chunks_mut(self.grid.tiles_x() as usize);
        let rows = rows.skip(tiles.z0 as usize).take((tiles.z1 - tiles.z0) as usize);
        let touched = rows.flat_map(|row| &mut row[tiles.x0 as usize..tiles.x1 as usize]);
        touched.map(|tile| tile.edit(rect, spared(tile), |column, _| change(column)).sum).sum()
    }
}
