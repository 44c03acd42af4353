//! A column of snow: a stack of material cells that loads press and compact.
//!
//! Masses and thicknesses are integers, so that sums are exact; what happens in a cell in one cycle
//! is computed in f32, as on the GPU.

mod after;
mod alpine;
mod edit;
mod equilibrium;
mod press;
mod search;
mod stamp;

use super::grid::{CELL, Grid};
use super::material::{GRAVITY, LoadDistribution, Material, REFERENCE_CELL_SIZE};

pub(crate) use stamp::Printer;

/// One mass quantum \[kg/m²\].
const MASS_QUANTUM: f32 = 1.0 / (1 << 18) as f32;

/// Part of its thickness by which a cell is compacted in one cycle at the most.
const LARGEST_INDENT: f32 = 0.99;

/// A piece of snow. In a column its mass and its thickness are never 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// Areal mass in quanta.
    pub mass: u32,
    /// Thickness in quanta, at most [`CELL`].
    pub thickness: u32,
    /// Temperature \[°C\].
    pub temperature: f32,
    /// Vertical stress σ \[Pa\], as last evaluated.
    pub stress: f32,
}

/// The load of one object on a column's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceLoad {
    /// Surface stress q·s on this column \[Pa\].
    pub pressure: f32,
    /// Width b over which the load spreads \[m\], above 0.
    pub width: f32,
}

/// A stack of cells, from the ground up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    /// The cells, without gaps.
    pub cells: Vec<Cell>,
}

impl Column {
    /// Height in thickness quanta.
    #[inline]
    pub fn height(&self) -> u32 {
        self.cells.iter().map(|cell| cell.thickness).sum()
    }

    /// Areal mass in quanta.
    #[inline]
    pub fn mass(&self) -> u32 {
        self.cells.iter().map(|cell| cell.mass).sum()
    }

    /// Evaluates the stress of every cell from the snow above it and the loads on the surface;
    /// returns whether any bit of it has changed.
    #[inline]
    pub fn stress(&mut self, grid: &Grid, material: &Material, loads: &[SurfaceLoad]) -> bool {
        let metres = grid.cell_size as f32 / CELL as f32;
        let (mut mass, mut above) = (0_u32, 0_u32);
        let mut changed = false;
        for (rank, cell) in self.cells.iter_mut().rev().enumerate() {
            mass += cell.mass;
            let weight = weight(mass);
            let depth = (above as f32 + 0.5 * cell.thickness as f32) * metres;
            let external = loads.iter().fold(0.0, |sum, load| {
                let part = spread(material.load_distribution, depth, load.width, rank == 0);
                sum + load.pressure * part
            });
            let stress = weight + external;
            changed |= stress.to_bits() != cell.stress.to_bits();
            cell.stress = stress;
            above += cell.thickness;
        }
        changed
    }

    /// Runs a number of cycles of `dt` seconds each under the present stress; returns 1 + the
    /// index of the last cycle in which a cell changed, 0 where none did. Alpine snow does not: it settles
    /// with the weather.
    #[inline]
    pub fn compact(&mut self, grid: &Grid, material: &Material, cycles: u32, dt: f32) -> u32 {
        let law = Compaction::new(grid, material, dt);
        self.cells.iter_mut().map(|cell| law.run(cell, cycles)).max().unwrap_or(0)
    }
}

/// Temperature of snow to which other snow is added; the two have mass between them.
#[inline]
pub(crate) fn mixed(temperature: f32, mass: u32, other: f32, added: u32) -> f32 {
    temperature + (other - temperature) * (added as f32 / (mass as f32 + added as f32))
}

/// Weight \[Pa\] of snow of an areal mass in quanta.
#[inline]
fn weight(mass: u32) -> f32 {
    GRAVITY as f32 * (mass as f32 * MASS_QUANTUM)
}

/// Part of a surface load that is felt at a depth \[m\], for a load of a width \[m\].
#[inline]
fn spread(distribution: LoadDistribution, depth: f32, width: f32, top: bool) -> f32 {
    match distribution {
        LoadDistribution::TwoToOne => {
            let ratio = width / (width + depth);
            ratio * ratio
        }
        LoadDistribution::Uniform => 1.0,
        LoadDistribution::Surface if top => 1.0,
        LoadDistribution::Surface => 0.0,
    }
}

/// The law by which a cell compacts, with its constants for one grid, material and Δt.
#[derive(Debug)]
pub(super) struct Compaction<'a> {
    material: &'a Material,
    /// Density \[kg/m³\] of one mass quantum in one thickness quantum.
    pub(super) density: f32,
    /// Thickness quanta of one mass quantum at the largest density.
    densest: f32,
    /// Δt / h_ref \[s/m\].
    rate: f32,
}

impl Compaction<'_> {
    #[inline]
    pub(super) fn new<'a>(grid: &Grid, material: &'a Material, dt: f32) -> Compaction<'a> {
        // Quanta of thickness are 2⁶ times as fine as those of mass.
        let density = 64.0 / grid.cell_size;
        Compaction {
            material,
            density: density as f32,
            densest: (density / material.densest()) as f32,
            rate: dt / REFERENCE_CELL_SIZE as f32,
        }
    }

    /// Compacts a cell for a number of cycles; returns how many of them changed it. Stress is
    /// constant, so a cell that one cycle leaves as it was is left so by all that follow.
    #[inline]
    fn run(&self, cell: &mut Cell, cycles: u32) -> u32 {
        let mass = cell.mass as f32;
        let densest = (mass * self.densest).ceil() as u32;
        for cycle in 0..cycles {
            let indent = self.indent(cell, mass);
            let least = densest.min(cell.thickness).max(1);
            let thickness = (cell.thickness - indent).max(least);
            if thickness == cell.thickness {
                return cycle;
            }
            cell.thickness = thickness;
        }
        cycles
    }

    /// Indent of one cycle in thickness quanta, rounded down.
    #[inline]
    pub(super) fn indent(&self, cell: &Cell, mass: f32) -> u32 {
        if self.material.hardness_law.is_alpine() {
            return 0;
        }
        let thickness = cell.thickness as f32;
        let density = mass / thickness * self.density;
        let excess = cell.stress - self.material.hardness(density, cell.temperature);
        if excess.is_nan() || excess <= 0.0 {
            return 0;
        }
        let indent = excess / self.material.stiffness(density) * self.rate * thickness;
        indent.min(LARGEST_INDENT * thickness) as u32
    }

    /// Hardness of a cell \[Pa\].
    #[inline]
    pub(super) fn hardness(&self, cell: &Cell) -> f32 {
        self.material.strength(cell).hardness(self.density_of(cell))
    }

    /// Density of a cell \[kg/m³\].
    #[inline]
    fn density_of(&self, cell: &Cell) -> f32 {
        cell.mass as f32 / cell.thickness as f32 * self.density
    }

    /// The hardness \[Pa\] that a cell needs to carry a stress, of which some is that of the snow on it: alpine
    /// snow settles under that, and carries the rest.
    #[inline]
    fn borne(&self, stress: f32, weight: f32) -> f32 {
        if self.material.hardness_law.is_alpine() { stress - weight } else { stress }
    }

    /// Thickness in quanta at the largest density.
    #[inline]
    fn least(&self, cell: &Cell) -> u32 {
        ((cell.mass as f32 * self.densest).ceil() as u32).max(1)
    }
}

#[cfg(test)]
mod tests;
