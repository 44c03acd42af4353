//! The surface of a region, put together from the messages of a stream.

use firn_protocol::{ColumnRegion, Resume, Subscribe};
use firn_snow::{Grid, TILE_SIDE};

use crate::message::{HeightTile, Heights, Welcome};

/// The session has another grid than before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the session has another grid than before: begin a new field")]
pub struct OtherGrid;

/// Snow depths of a subscription's region, widened to whole tiles, and the ground where it is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightField {
    id: i64,
    grid: Grid,
    /// That of the stream.
    epoch: String,
    /// Columns from one sample to the next.
    stride: u32,
    /// First column along x and z.
    origin: (u32, u32),
    /// Columns along x and z.
    extent: (u32, u32),
    /// Samples along x and z.
    size: (u32, u32),
    /// Not a number where nothing has been told yet.
    heights: Vec<f64>,
    /// As many elevations where the ground is wanted, otherwise none.
    ground: Vec<f64>,
    /// State up to which everything has been told, and the epoch in which that was.
    seen: Option<Resume>,
    tick: u64,
}

impl HeightField {
    /// The field of a subscription of a stream.
    pub fn new(welcome: &Welcome, id: i64, wish: &Subscribe) -> HeightField {
        let (grid, stride) = (welcome.grid, wish.stride.max(1));
        let whole = ColumnRegion { column_x: 0, column_z: 0, width: u64::MAX, depth: u64::MAX };
        let region = wish.region.unwrap_or(whole);
        let along = |first: i64, columns: u64, most: u32| {
            let clip = |column: i64| column.clamp(0, most.into()) as u32;
            let begin = clip(first) / TILE_SIDE * TILE_SIDE;
            let end = clip(first.saturating_add_unsigned(columns));
            (begin, end.next_multiple_of(TILE_SIDE).min(most).saturating_sub(begin))
        };
        let (x, width) = along(region.column_x, region.width, grid.width);
        let (z, depth) = along(region.column_z, region.depth, grid.depth);
        let size = (width.div_ceil(stride), depth.div_ceil(stride));
        let samples = size.0 as usize * size.1 as usize;
        HeightField {
            id,
            grid,
            epoch: welcome.epoch.clone(),
            stride,
            origin: (x, z),
            extent: (width, depth),
            size,
            heights: vec![f64::NAN; samples],
            ground: vec![f64::NAN; if wish.terrain { samples } else { 0 }],
            seen: None,
            tick: 0,
        }
    }

    /// Continues with a subscription to the same region on another stream. Heights and ground stay: the server says
    /// what has changed since [`HeightField::resume`], or, where nobody knows that any more, sends all of them
    /// again.
    ///
    /// # Errors
    /// [`OtherGrid`] where the session was replaced by one with another grid.
    pub fn reconnect(&mut self, welcome: &Welcome, id: i64) -> Result<(), OtherGrid> {
        if welcome.grid != self.grid {
            return Err(OtherGrid);
        }
        self.epoch.clone_from(&welcome.epoch);
        self.id = id;
        Ok(())
    }

    /// Applies a message of its subscription; messages of others are ignored. Returns whether the state is
    /// complete with it: a large one comes in several parts.
    pub fn take(&mut self, told: &Heights) -> bool {
        if told.id != self.id {
            return false;
        }
        if told.snapshot {
            self.seen = None;
        }
        told.tiles.iter().for_each(|tile| self.put(tile, |field| &mut field.heights));
        if told.level {
            self.ground.fill(0.0);
        }
        told.terrain.iter().for_each(|tile| self.put(tile, |field| &mut field.ground));
        if !told.more {
            self.seen = Some(Resume { epoch: self.epoch.clone(), seq: told.seq });
            self.tick = told.tick;
        }
        !told.more
    }

    /// First column along x and along z.
    pub fn origin(&self) -> (u32, u32) {
        self.origin
    }

    /// Samples along x and along z.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Snow depths \[m\], row by row: index = z · width + x. Not a number where nothing has been told yet.
    pub fn heights(&self) -> &[f64] {
        &self.heights
    }

    /// Snow depth of a column \[m\], or that of the sample which stands for it; `None` outside of the
    /// region, and where nothing has been told yet.
    pub fn height(&self, column_x: u32, column_z: u32) -> Option<f64> {
        self.sample(&self.heights, column_x, column_z)
    }

    /// Elevations of the ground \[m\], as [`HeightField::heights`]; none where the subscription does not want
    /// its ground.
    pub fn ground(&self) -> &[f64] {
        &self.ground
    }

    /// Elevation of the ground of a column \[m\], as [`HeightField::height`].
    pub fn ground_height(&self, column_x: u32, column_z: u32) -> Option<f64> {
        self.sample(&self.ground, column_x, column_z)
    }

    fn sample(&self, samples: &[f64], column_x: u32, column_z: u32) -> Option<f64> {
        let along = |column: u32, first: u32, columns: u32| {
            let place = column.checked_sub(first).filter(|&place| place < columns)?;
            Some(place / self.stride)
        };
        let x = along(column_x, self.origin.0, self.extent.0)?;
        let z = along(column_z, self.origin.1, self.extent.1)?;
        samples.get(self.index(x, z)?).copied().filter(|sample| !sample.is_nan())
    }

    /// Ticks until the state that it shows.
    pub fn tick(&self) -> u64 {
        self.tick
    }

    /// The state from which a later subscription can resume; `None` before the first complete one.
    pub fn resume(&self) -> Option<Resume> {
        self.seen.clone()
    }

    /// Takes over a tile's samples as far as they lie in the region.
    fn put(&mut self, tile: &HeightTile, into: fn(&mut HeightField) -> &mut [f64]) {
        let along = |column: u64, first: u32| {
            u32::try_from(column.checked_sub(first.into())?).ok().map(|column| column / self.stride)
        };
        let (Some(x0), Some(z0)) =
            (along(tile.column_x, self.origin.0), along(tile.column_z, self.origin.1))
        else {
            return;
        };
        for (row, z) in tile.heights.chunks(tile.width.max(1) as usize).zip(z0..) {
            for (&height, x) in row.iter().zip(x0..) {
                let index = self.index(x, z);
                if let Some(sample) = index.and_then(|index| into(self).get_mut(index)) {
                    *sample = height;
                }
            }
        }
    }

    fn index(&self, x: u32, z: u32) -> Option<usize> {
        let (width, depth) = self.size;
        (x < width && z < depth).then_some(z as usize * width as usize + x as usize)
    }
}

#[cfg(test)]
mod tests;
