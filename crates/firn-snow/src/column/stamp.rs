//! Prints: a column that a load has pressed all the way, at once.

use crate::coverage::Coverage;
use crate::grid::Grid;
use crate::material::Material;

use super::search::thickest_near;
use super::{CELL, Cell, Column, Compaction, SurfaceLoad, spread, weight};

/// Presses columns. Snow that fell evenly is alike in many of them, and loads are alike too: so what has become of
/// the last column is remembered.
#[derive(Debug)]
pub(crate) struct Printer<'a> {
    law: Compaction<'a>,
    metres: f32,
    load: SurfaceLoad,
    /// The cells of the last column as they were, from the top down.
    cells: Vec<Cell>,
    /// The thickness at which each of them carries the load.
    pressed: Vec<u32>,
}

impl<'a> Printer<'a> {
    pub fn new(grid: &Grid, material: &'a Material) -> Printer<'a> {
        let metres = grid.cell_size as f32 / CELL as f32;
        let load = SurfaceLoad { pressure: 0.0, width: 0.0 };
        let law = Compaction::new(grid, material, 0.0);
        Printer { law, metres, load, cells: Vec::new(), pressed: Vec::new() }
    }

    /// Presses a column as [`Column::stamp`] does.
    pub fn press(&mut self, column: &mut Column, load: SurfaceLoad, part: u32) -> u32 {
        if load != self.load || !self.knows(column) {
            self.find(column, load);
        }
        let mut dent = 0;
        for (cell, &pressed) in column.cells.iter_mut().rev().zip(&self.pressed) {
            let part = (u64::from(cell.thickness - pressed) * u64::from(part)
                / u64::from(Coverage::WHOLE)) as u32;
            cell.thickness -= part;
            dent += part;
        }
        dent
    }

    /// Whether the last column was like this one.
    fn knows(&self, column: &Column) -> bool {
        let alike = |a: &Cell, b: &Cell| {
            (a.mass, a.thickness, a.temperature.to_bits())
                == (b.mass, b.thickness, b.temperature.to_bits())
        };
        let cells = column.cells.iter().rev();
        column.cells.len() == self.cells.len() && cells.zip(&self.cells).all(|(a, b)| alike(a, b))
    }

    /// Finds the thickness at which each cell of a column carries a load.
    fn find(&mut self, column: &Column, load: SurfaceLoad) {
        let Printer { law, metres, .. } = self;
        let alpine = law.material.hardness_law.is_alpine();
        let (mut mass, mut above) = (0_u32, 0_u32);
        for (rank, cell) in column.cells.iter().rev().enumerate() {
            mass += cell.mass;
            // Alpine snow settles under its own weight, and carries the load alone.
            let own = if alpine { 0.0 } else { weight(mass) };
            let snow = law.material.strength(cell);
            let content = cell.mass as f32;
            // How many times over the cell carries what is on it; often enough where it feels nothing of the load.
            let strength = |thickness: u32| {
                let depth = (above as f32 + 0.5 * thickness as f32) * *metres;
                let spread = spread(law.material.load_distribution, depth, load.width, rank == 0);
                let felt = load.pressure * spread;
                let hardness = snow.hardness(content / thickness as f32 * law.density);
                if felt <= 0.0 { f32::INFINITY } else { hardness / (own + felt) }
            };
            let before = strength(cell.thickness);
            let pressed = if before >= 1.0 {
                cell.thickness
            } else {
                let least = law.least(cell).min(cell.thickness);
                // Where the cell of the last column in this place has come to.
                let last = self.cells.get(rank).zip(self.pressed.get(rank));
                let last = last.filter(|(last, pressed)| **pressed < last.thickness);
                let guess = last.map(|(last, &pressed)| {
                    let part = f64::from(pressed) / f64::from(last.thickness);
                    (f64::from(cell.thickness) * part) as u32
                });
                thickest_near(least, cell.thickness, before, guess, snow.root(), strength)
            };
            above += pressed;
            match self.cells.get_mut(rank) {
                Some(last) => (*last, self.pressed[rank]) = (*cell, pressed),
                None => {
                    self.cells.push(*cell);
                    self.pressed.push(pressed);
                }
            }
        }
        self.cells.truncate(column.cells.len());
        self.pressed.truncate(column.cells.len());
        self.load = load;
    }
}

impl Column {
    /// Presses the column a part of the way to where it carries a load, in parts of [`Coverage::WHOLE`]. Cells that do
    /// not feel the load stay as they are. Returns the dent in thickness quanta. Stresses are not evaluated.
    pub fn stamp(&mut self, grid: &Grid, material: &Material, load: SurfaceLoad, part: u32) -> u32 {
        Printer::new(grid, material).press(self, load, part)
    }
}

#[cfg(test)]
mod tests;
