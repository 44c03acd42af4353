//! Views made of the cells themselves, read back from the device on demand.

use firn_engine::frame::TileCells;
use firn_protocol::{ColumnView, LayerView, MassView, Reference, Stamp};
use firn_snow::{CELL, ColumnRect, Grid, MASS_QUANTA, Material, Sample};
use serde::{Deserialize, Serialize};

/// Cells of some tiles, and when they were as they are here.
#[derive(Clone, Debug)]
pub struct Gathered {
    /// When.
    pub stamp: Stamp,
    /// Material constants then.
    pub material: Material,
    /// The tiles, in the order asked for.
    pub tiles: Vec<TileCells>,
}

/// Most cells of the fixed grid that are sampled at a time.
pub const MOST_SAMPLES: u64 = 1 << 20;

/// Cells of the fixed grid that are asked for, inside its columns.
#[derive(Clone, Copy, Debug)]
pub struct CellBox {
    /// The columns.
    pub columns: ColumnRect,
    /// What cells along y are counted from.
    pub reference: Reference,
    /// First cell along y.
    pub y0: u32,
    /// Cells along y.
    pub height: u32,
}

impl CellBox {
    /// Cells in the box.
    pub fn cells(&self) -> u64 {
        self.columns.columns().saturating_mul(self.height.into())
    }
}

/// A box of the fixed grid, and when it was as it is here.
#[derive(Clone, Debug)]
pub struct Sampled {
    /// When.
    pub stamp: Stamp,
    /// The cells: x fastest, then y, then z.
    pub cells: Vec<Sample>,
}

/// Mass that has gone in and out of a snowpack, in quanta summed over its columns: 128 bits, since
/// what falls and is refused has no end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ledger {
    /// Fallen, the refused part included.
    pub fallen: u128,
    /// Found no room.
    pub refused: u128,
    /// Cleared away.
    pub cleared: u128,
}

impl Ledger {
    /// Mass that must be present.
    pub fn present(&self) -> u128 {
        self.fallen - self.refused - self.cleared
    }

    /// The ledger beside the mass that a tally found.
    pub(crate) fn view(&self, stamp: Stamp, present: u64, grid: &Grid) -> MassView {
        MassView {
            stamp,
            present: grid.kilograms(present.into()),
            fallen: grid.kilograms(self.fallen),
            refused: grid.kilograms(self.refused),
            cleared: grid.kilograms(self.cleared),
            imbalance_quanta: self.present() as i64 - present as i64,
        }
    }
}

/// A column of the first tile gathered.
pub(crate) fn column_view(gathered: &Gathered, column: u32, grid: &Grid) -> ColumnView {
    let area = grid.column_area();
    let mut bottom = 0u64;
    let mut mass = 0u128;
    let mut layers = Vec::new();
    for cell in gathered.tiles.iter().flat_map(|tile| tile.column(column)) {
        let density = f64::from(cell.mass) / MASS_QUANTA * f64::from(CELL)
            / (f64::from(cell.thickness) * grid.cell_size);
        layers.push(LayerView {
            bottom: grid.metres(bottom),
            thickness: grid.metres(u64::from(cell.thickness)),
            density,
            temperature: f64::from(cell.temperature),
            hardness: f64::from(gathered.material.hardness(density as f32, cell.temperature)),
            stress: f64::from(cell.stress),
            mass: grid.kilograms(cell.mass.into()),
        });
        bottom += u64::from(cell.thickness);
        mass += u128::from(cell.mass);
    }
    let height = grid.metres(bottom);
    let mass = grid.kilograms(mass);
    ColumnView {
        stamp: gathered.stamp,
        height,
        mass,
        mean_density: if bottom == 0 { 0.0 } else { mass / (height * area) },
        weak_layers: super::weak::weak_layers(&layers),
        layers,
    }
}
