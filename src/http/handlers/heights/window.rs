//! Which columns a read of heights samples.

use firn_snow::{Grid, TILE_SIDE};

use crate::problem::{FieldError, Problem};
use crate::session::{Ground, Mirror};

use super::{Origin, WindowQuery};

/// Most samples of one answer.
const MOST_SAMPLES: u64 = 1 << 24;

/// The columns to be read, inside the grid.
#[derive(Debug, PartialEq)]
pub struct Window {
    /// First column.
    pub origin: Origin,
    /// Samples along x.
    pub width: u32,
    /// Samples along z.
    pub depth: u32,
    /// Columns from one sample to the next.
    pub stride: u32,
}

impl Window {
    /// The window that a query names.
    ///
    /// # Errors
    /// 422 where it reaches beyond the grid, 413 where it has too many samples.
    pub fn new(query: &WindowQuery, grid: &Grid) -> Result<Window, Problem> {
        let stride = query.stride.unwrap_or(1);
        let mut errors = Vec::new();
        let mut span = |first: (&str, Option<u32>), count: (&str, Option<u32>), columns: u32| {
            let start = first.1.unwrap_or(0);
            if start >= columns {
                let detail = format!("{start} is outside the grid's columns 0 to {}", columns - 1);
                errors.push(FieldError { pointer: first.0.to_owned(), detail });
                return (start, 0);
            }
            let most = (columns - start).div_ceil(stride);
            let samples = count.1.unwrap_or(most);
            if samples > most {
                let detail = format!(
                    "{samples} samples from column {start} on reach beyond the grid; \
                     at most {most} fit"
                );
                errors.push(FieldError { pointer: count.0.to_owned(), detail });
            }
            (start, samples)
        };
        let (x, width) = span(("column_x", query.column_x), ("width", query.width), grid.width);
        let (z, depth) = span(("column_z", query.column_z), ("depth", query.depth), grid.depth);
        if !errors.is_empty() {
            return Err(Problem::invalid(errors));
        }
        let window = Window { origin: Origin { column_x: x, column_z: z }, width, depth, stride };
        if window.samples() > MOST_SAMPLES {
            return Err(Problem::too_large(format!(
                "the answer would have {} samples, more than {MOST_SAMPLES}; \
                 ask for a part of them, or for a greater stride",
                window.samples()
            )));
        }
        Ok(window)
    }

    /// Number of samples.
    pub fn samples(&self) -> u64 {
        u64::from(self.width) * u64::from(self.depth)
    }

    /// The sampled columns of each row, row by row.
    fn rows(&self) -> impl Iterator<Item = u32> + use<> {
        let first = self.origin.column_z;
        let stride = self.stride;
        (0..self.depth).map(move |row| first + row * stride)
    }

    /// The newest version of a tile in which columns of the window lie.
    pub fn version(&self, mirror: &Mirror) -> u64 {
        let tiles = |first: u32, samples: u32| {
            first / TILE_SIDE..=(first + (samples - 1) * self.stride) / TILE_SIDE
        };
        let tiles_x = mirror.grid.tiles_x();
        tiles(self.origin.column_z, self.depth)
            .flat_map(|z| tiles(self.origin.column_x, self.width).map(move |x| z * tiles_x + x))
            .map(|tile| mirror.tile(tile).1)
            .max()
            .expect("a window has samples")
    }

    /// Copies the sampled heights, in thickness quanta.
    pub fn copy(&self, mirror: &Mirror) -> Vec<u32> {
        let mut heights = Vec::with_capacity(self.samples() as usize);
        let first = self.origin.column_x;
        let end = first + (self.width - 1) * self.stride + 1;
        for z in self.rows() {
            let mut x = first;
            // Columns of one row lie side by side as far as their tile reaches.
            while x < end {
                let (tile, column) = mirror.grid.locate(x, z);
                let stop = (x / TILE_SIDE + 1).saturating_mul(TILE_SIDE).min(end);
                let run = &mirror.tile(tile).0[column as usize..(column + stop - x) as usize];
                heights.extend(run.iter().step_by(self.stride as usize));
                x += (stop - x).next_multiple_of(self.stride);
            }
        }
        heights
    }

    /// Elevations of the ground under the samples, as they were given \[m\].
    pub fn ground<'a>(
        &self,
        ground: &'a Ground,
        grid: &Grid,
    ) -> impl Iterator<Item = f64> + use<'a> {
        let (first, stride, width, grid) = (self.origin.column_x, self.stride, self.width, *grid);
        self.rows()
            .flat_map(move |z| (0..width).map(move |i| ground.height(&grid, first + i * stride, z)))
    }
}
