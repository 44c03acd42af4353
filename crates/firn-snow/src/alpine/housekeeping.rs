//! Cells that are joined, so that a column needs few of them.

use super::wet::{kilograms, merge};
use crate::column::Cell;
use crate::grid::CELL;

/// A topmost cell with less mass \[kg/m²\], or thinner than this part of a cell, is joined with the one below.
const SCRAP: (f32, u32) = (0.3, CELL / 50);

/// Snow below this mass \[kg/m²\], all that is left of it, runs off.
const LAST_SCRAP: f32 = 0.05;

/// A cell thinner than this is joined with the one below it.
const THIN: u32 = (CELL as u64 * 6 / 10) as u32;

/// Largest difference between the densities of cells that are joined, as a part of their mean.
const ALIKE: f32 = 0.2;

/// With fewer free slots than this, thin cells are joined whatever their densities.
const FEW: usize = 20;

/// With fewer free slots than this, some cells are joined in any case.
const TOO_FEW: usize = 4;

/// Keeps a column's cells few.
#[derive(Clone, Copy, Debug)]
pub(super) struct House {
    /// Metres of a thickness quantum.
    pub metres: f32,
    /// Slots of the column.
    pub slots: u32,
    /// Whether it snows.
    pub snows: bool,
}

impl House {
    /// Joins cells, and lets a last scrap run off, which it returns.
    pub fn keep(&self, cells: &mut Vec<Cell>) -> Option<Cell> {
        self.join_top(cells);
        self.join_inner(cells);
        while self.free(cells) < TOO_FEW && self.join_least(cells) {}
        match cells[..] {
            [last] if !self.snows && kilograms(last.mass) < LAST_SCRAP => cells.pop(),
            _ => None,
        }
    }

    fn free(&self, cells: &[Cell]) -> usize {
        (self.slots as usize).saturating_sub(cells.len())
    }

    /// Joins a topmost scrap with the cell below. Snow that falls is left to grow to a cell.
    fn join_top(&self, cells: &mut Vec<Cell>) {
        let [.., below, top] = cells[..] else { return };
        let scrap = kilograms(top.mass) < SCRAP.0 || top.thickness < SCRAP.1;
        if scrap && (!self.snows || top.water() > 0) && fit(&below, &top) {
            cells.pop();
            if let Some(last) = cells.last_mut() {
                *last = merge(below, top);
            }
        }
    }

    /// Joins thin cells with those below, but for the topmost two.
    fn join_inner(&self, cells: &mut Vec<Cell>) {
        let inner = cells.len().saturating_sub(2);
        let mut free = self.free(cells);
        let mut kept = 0;
        for upper in 1..cells.len() {
            let (below, cell) = (cells[kept], cells[upper]);
            let joins = upper < inner
                && cell.thickness < THIN
                && fit(&below, &cell)
                && (free < FEW || self.alike(&below, &cell));
            if joins {
                cells[kept] = merge(below, cell);
                free += 1;
            } else {
                kept += 1;
                cells[kept] = cell;
            }
        }
        cells.truncate(kept + 1);
    }

    /// Joins the thinnest and most alike pair that fits one cell; returns whether there is one.
    fn join_least(&self, cells: &mut Vec<Cell>) -> bool {
        let mut least: Option<(f32, usize)> = None;
        for lower in 0..cells.len().saturating_sub(1) {
            let (below, above) = (cells[lower], cells[lower + 1]);
            let unlike = (self.density(&below) - self.density(&above)).abs();
            let weight = (below.thickness + above.thickness) as f32 * (1.0 + unlike / 50.0);
            if fit(&below, &above) && least.is_none_or(|(least, _)| weight < least) {
                least = Some((weight, lower));
            }
        }
        let Some((_, lower)) = least else { return false };
        cells[lower] = merge(cells[lower], cells[lower + 1]);
        cells.remove(lower + 1);
        true
    }

    fn alike(&self, one: &Cell, other: &Cell) -> bool {
        let (one, other) = (self.density(one), self.density(other));
        (one - other).abs() <= ALIKE * 0.5 * (one + other)
    }

    /// Density \[kg/m³\].
    fn density(&self, cell: &Cell) -> f32 {
        kilograms(cell.mass) / (cell.thickness as f32 * self.metres)
    }
}

/// Whether two cells fit one.
fn fit(one: &Cell, other: &Cell) -> bool {
    one.thickness + other.thickness <= CELL
}
