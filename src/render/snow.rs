//! The columns of snow that a picture shows. The caller reads them.

use firn_protocol::ColliderView;
use firn_snow::{ColumnRect, Content, Grid, Sample};

use crate::session::Ground;

/// Snow of a region of columns, and what stands there. Lists of columns go row by row.
#[derive(Clone, Debug)]
pub struct Snow {
    /// The columns.
    pub region: ColumnRect,
    /// Side of a cell \[m\].
    pub cell_size: f32,
    /// Elevation of each column's ground above the lowest of the session \[m\].
    pub ground: Vec<f32>,
    /// Snow depth of each column \[m\].
    pub depth: Vec<f32>,
    /// Cells of the fixed grid above each column's ground, x fastest, then y, then z; empty where only the surface was read.
    pub cells: Vec<Sample>,
    /// Objects on the snow; their bottoms are elevations above the lowest ground.
    pub colliders: Vec<ColliderView>,
}

impl Snow {
    /// From cells of the fixed grid, all there are above each column of the region.
    pub fn from_cells(
        (grid, ground): (&Grid, &Ground),
        region: ColumnRect,
        cells: Vec<Sample>,
        colliders: &[ColliderView],
    ) -> Snow {
        let mut snow = Snow::from_depths((grid, ground), region, Vec::new(), colliders);
        snow.cells = cells;
        let depth = |column| snow.column(column).map(|cell| cell.fill * snow.cell_size).sum();
        snow.depth = (0..snow.columns()).map(depth).collect();
        snow
    }

    /// From snow depths \[m\] alone.
    pub fn from_depths(
        (grid, ground): (&Grid, &Ground),
        region: ColumnRect,
        depth: Vec<f32>,
        colliders: &[ColliderView],
    ) -> Snow {
        let lowest = ground.lowest();
        let columns =
            (region.z0..region.z1).flat_map(|z| (region.x0..region.x1).map(move |x| (x, z)));
        let ground = columns.map(|(x, z)| (ground.height(grid, x, z) - lowest) as f32).collect();
        let above_lowest = |collider: &ColliderView| ColliderView {
            bottom: collider.bottom - lowest,
            ..collider.clone()
        };
        Snow {
            region,
            cell_size: grid.cell_size as f32,
            ground,
            depth,
            cells: Vec::new(),
            colliders: colliders.iter().map(above_lowest).collect(),
        }
    }

    /// Columns along x.
    pub fn width(&self) -> usize {
        (self.region.x1 - self.region.x0) as usize
    }

    /// Columns in the region.
    pub fn columns(&self) -> usize {
        self.ground.len()
    }

    /// The cells of a column from its ground up.
    pub fn column(&self, column: usize) -> impl Iterator<Item = &Sample> {
        let (width, height) = (self.width(), self.cells.len() / self.columns());
        let (x, z) = (column % width, column / width);
        (0..height).map(move |y| &self.cells[(z * height + y) * width + x])
    }

    /// The snow cells of a column, from the ground up.
    pub fn snow_cells(&self, column: usize) -> impl Iterator<Item = SnowCell<'_>> {
        let ground = self.ground[column];
        let mut bottom = ground;
        self.column(column).zip(0u16..).filter(|(sample, _)| sample.content() == Content::Snow).map(
            move |(sample, y)| {
                let low = bottom;
                bottom += sample.fill * self.cell_size;
                let middle = ground + (f32::from(y) + 0.5) * self.cell_size;
                SnowCell { sample, bottom: low, top: bottom, middle }
            },
        )
    }

    /// Elevation of what lies on top in a column, the surface or bare ground \[m\].
    pub fn top(&self, column: usize) -> f32 {
        self.ground[column] + self.depth[column]
    }

    /// Extent of a column's corner and the opposite one, along x and z \[m\].
    pub fn place(&self, column: usize) -> [(f32, f32); 2] {
        let (x, z) = (column % self.width(), column / self.width());
        let at = |x: usize, z: usize| {
            let (x, z) = (self.region.x0 + x as u32, self.region.z0 + z as u32);
            (x as f32 * self.cell_size, z as f32 * self.cell_size)
        };
        [at(x, z), at(x + 1, z + 1)]
    }
}

/// A cell of the fixed grid that holds snow; elevations in metres above the lowest ground.
#[derive(Clone, Copy, Debug)]
pub struct SnowCell<'a> {
    /// What it holds.
    pub sample: &'a Sample,
    /// Where its snow begins.
    pub bottom: f32,
    /// Where its snow ends.
    pub top: f32,
    /// The middle of the cell, however much of it snow fills.
    pub middle: f32,
}
