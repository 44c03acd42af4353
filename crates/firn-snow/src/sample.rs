//! The fixed grid that users see, sampled from a column's material cells.

use bytemuck::{Pod, Zeroable};

use super::column::{Cell, Compaction};
use super::elevation::Elevation;
use super::grid::{CELL, Grid};
use super::material::{GRAVITY, Material};

/// One mass quantum \[kg/m²\].
const MASS_QUANTUM: f32 = 1.0 / (1 << 18) as f32;

/// What a cell of the fixed grid holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Content {
    /// Nothing.
    #[default]
    Air,
    /// Any snow.
    Snow,
    /// The terrain.
    Ground,
}

/// Where the cells of the fixed grid are counted from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Floor {
    /// From one elevation in all columns; no ground is below it.
    Level(Elevation),
    /// From each column's own ground.
    Ground,
}

impl Floor {
    /// Quanta from here up to a column's ground.
    #[inline]
    pub fn below(self, ground: Elevation) -> u64 {
        match self {
            Floor::Level(level) => (ground - level).max(0) as u64,
            Floor::Ground => 0,
        }
    }
}

/// One cell of the fixed grid. Density is the mass over the part that snow fills; temperature is
/// weighted by mass, everything else by the part that snow fills.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Sample {
    /// 0 for air, 1 for snow, 2 for ground.
    pub content: u32,
    /// Part of the cell that snow fills, from 0 to 1.
    pub fill: f32,
    /// Areal mass \[kg/m²\].
    pub mass: f32,
    /// Density \[kg/m³\].
    pub density: f32,
    /// Temperature \[°C\].
    pub temperature: f32,
    /// Hardness \[Pa\].
    pub hardness: f32,
    /// Stiffness \[Pa/m\].
    pub stiffness: f32,
    /// Vertical stress \[Pa\].
    pub stress: f32,
    /// Part of the stress that comes from objects \[Pa\].
    pub external_stress: f32,
    /// Indent of one cycle of the present length \[m\].
    pub indent: f32,
    /// Areal mass of liquid water in it \[kg/m²\].
    pub liquid_water: f32,
}

impl Sample {
    /// What the cell holds.
    pub fn content(&self) -> Content {
        match self.content {
            0 => Content::Air,
            1 => Content::Snow,
            _ => Content::Ground,
        }
    }
}

/// Samples one column: a range of the fixed grid's cells above its floor.
///
/// `ground` is how far the column's ground lies above the floor, in quanta, and `dt` the length of a cycle \[s\].
/// `shaders/sample.wgsl` computes the same in the same order.
pub fn sample_column(
    grid: &Grid,
    material: &Material,
    dt: f32,
    ground: u64,
    cells: impl Iterator<Item = Cell> + Clone,
    range: std::ops::Range<u32>,
) -> Vec<Sample> {
    let law = Compaction::new(grid, material, dt);
    let side = grid.cell_size as f32;
    let metres = side / CELL as f32;
    // The column begins inside the cell that the ground ends in.
    let mut place = (ground / u64::from(CELL)) as u32;
    let mut filled = (ground % u64::from(CELL)) as u32;
    let mut samples = vec![Sample::default(); range.len()];
    for (sample, j) in samples.iter_mut().zip(range.clone()) {
        sample.content = if j < place { 2 } else { 0 };
    }

    let mut above: u32 = cells.clone().map(|cell| cell.mass).sum();
    let mut sums = Sample::default();
    for cell in cells {
        let mass = cell.mass as f32;
        let density = mass / cell.thickness as f32 * law.density;
        let values = Sample {
            density,
            temperature: cell.celsius(),
            hardness: law.hardness(&cell),
            stiffness: material.stiffness(density),
            stress: cell.stress,
            external_stress: (cell.stress - GRAVITY as f32 * (above as f32 * MASS_QUANTUM))
                .max(0.0),
            indent: law.indent(&cell, mass) as f32 * metres,
            liquid_water: cell.water() as f32 * MASS_QUANTUM,
            ..Sample::default()
        };
        above -= cell.mass;
        let mut left = cell.thickness;
        while left > 0 {
            let overlap = left.min(CELL - filled);
            let fill = overlap as f32 / CELL as f32;
            let part = overlap as f32 / cell.thickness as f32;
            sums.add(&values, fill, mass * MASS_QUANTUM * part);
            sums.liquid_water += values.liquid_water * part;
            left -= overlap;
            filled += overlap;
            if filled == CELL {
                store(&mut samples, &range, place, &mut sums, side);
                place += 1;
                filled = 0;
            }
        }
    }
    store(&mut samples, &range, place, &mut sums, side);
    samples
}

impl Sample {
    /// Adds a piece of snow that fills a part of the cell and has an areal mass \[kg/m²\].
    fn add(&mut self, piece: &Sample, fill: f32, mass: f32) {
        self.fill += fill;
        self.mass += mass;
        self.temperature += piece.temperature * mass;
        self.hardness += piece.hardness * fill;
        self.stiffness += piece.stiffness * fill;
        self.stress += piece.stress * fill;
        self.external_stress += piece.external_stress * fill;
        self.indent += piece.indent * fill;
    }

    /// Turns sums into means, for cells of a side \[m\].
    fn mean(&self, side: f32) -> Sample {
        Sample {
            content: 1,
            fill: self.fill,
            mass: self.mass,
            density: self.mass / (self.fill * side),
            temperature: self.temperature / self.mass,
            hardness: self.hardness / self.fill,
            stiffness: self.stiffness / self.fill,
            stress: self.stress / self.fill,
            external_stress: self.external_stress / self.fill,
            indent: self.indent / self.fill,
            liquid_water: self.liquid_water,
        }
    }
}

/// Finishes a cell of the fixed grid, where it is asked for and any snow is in it.
fn store(
    samples: &mut [Sample],
    range: &std::ops::Range<u32>,
    place: u32,
    sums: &mut Sample,
    side: f32,
) {
    let finished = std::mem::take(sums);
    if finished.fill > 0.0 && range.contains(&place) {
        samples[(place - range.start) as usize] = finished.mean(side);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHARE: u32 = 1_048_576;

    fn cell(mass: u32, thickness: u32, temperature: f32) -> Cell {
        Cell { mass, thickness, temperature, stress: 100.0 }
    }

    #[test]
    fn a_cell_of_the_grid_holds_parts_of_several_pieces() {
        let (grid, material) = (Grid::default(), Material::default());
        let cells = [cell(SHARE, CELL / 2, -2.0), cell(SHARE, CELL, -8.0)];
        let samples = sample_column(&grid, &material, 1.0 / 60.0, 0, cells.into_iter(), 0..4);
        assert_eq!(samples[0].content(), Content::Snow);
        assert!((samples[0].fill - 1.0).abs() < 1e-6);
        // The denser piece whole, and half of the one above it: 4 kg/m² and 2 kg/m² in 0.2 m.
        assert!((samples[0].mass - 6.0).abs() < 1e-4, "{:?}", samples[0]);
        assert!((samples[0].density - 30.0).abs() < 1e-3);
        assert!((samples[0].temperature + 4.0).abs() < 1e-4);
        assert!((samples[1].fill - 0.5).abs() < 1e-6 && (samples[1].density - 20.0).abs() < 1e-3);
        assert_eq!(samples[1].temperature, -8.0);
        assert_eq!((samples[2], samples[3].content()), (Sample::default(), Content::Air));
    }

    #[test]
    fn ground_lies_below_and_snow_begins_inside_the_cell_it_ends_in() {
        let (grid, material) = (Grid::default(), Material::default());
        // One and a quarter cells of ground.
        let ground = u64::from(CELL + CELL / 4);
        let cells = [cell(SHARE, CELL, -3.0)];
        let samples = sample_column(&grid, &material, 1.0 / 60.0, ground, cells.into_iter(), 0..4);
        let contents: Vec<Content> = samples.iter().map(Sample::content).collect();
        assert_eq!(contents, [Content::Ground, Content::Snow, Content::Snow, Content::Air]);
        assert!((samples[1].fill - 0.75).abs() < 1e-6 && (samples[2].fill - 0.25).abs() < 1e-6);
        let part = sample_column(&grid, &material, 1.0 / 60.0, ground, cells.into_iter(), 2..3);
        assert_eq!(part, samples[2..3]);
    }

    #[test]
    fn wet_snow_is_at_0_degrees_and_as_hard_as_its_water_leaves_it() {
        let material = Material { hardness_law: crate::HardnessLaw::Alpine, ..Material::default() };
        let mut wet = Cell { stress: 1e6, ..cell(10 << 18, CELL, 0.0) };
        wet.set_heat(0.0, 1 << 18);
        let samples = sample_column(&Grid::default(), &material, 0.1, 0, [wet].into_iter(), 0..1);
        let hardness = crate::alpine::hardness(50.0, 0.0, 0.005);
        assert_eq!((samples[0].temperature, samples[0].indent), (0.0, 0.0));
        assert!((samples[0].hardness / hardness - 1.0).abs() < 1e-5, "{:?}", samples[0]);
    }

    #[test]
    fn mass_is_kept_when_it_is_sampled() {
        let (grid, material) = (Grid::default(), Material::default());
        let cells: Vec<Cell> =
            (1..30).map(|i| cell(SHARE / 3 * i % 700_000 + 9, CELL / 31 * i, -3.0)).collect();
        let samples = sample_column(&grid, &material, 0.1, 12345, cells.iter().copied(), 0..40);
        let sampled: f64 = samples.iter().map(|sample| f64::from(sample.mass)).sum();
        let mass: f64 = cells.iter().map(|cell| f64::from(cell.mass)).sum::<f64>() / 262_144.0;
        assert!((sampled / mass - 1.0).abs() < 1e-5, "{sampled} for {mass}");
    }
}
