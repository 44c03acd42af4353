//! The surface of a region, put together from the messages of a stream.

use firn_protocol::{ColumnRegion, Resume, Subscribe};
use firn_snow::{Grid, TILE_SIDE};

use crate::message::{HeightTile, Heights, Welcome};

/// The session has another grid than before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the session has another grid than before: begin a new field")]
pub struct OtherGrid;

/// Snow depths of a subscription's region, widened to whole tiles.
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
        HeightField {
            id,
            grid,
            epoch: welcome.epoch.clone(),
            stride,
            origin: (x, z),
            extent: (width, depth),
            size,
            heights: vec![f64::NAN; size.0 as usize * size.1 as usize],
            seen: None,
            tick: 0,
        }
    }

    /// Continues with a subscription to the same region on another stream. The heights stay: the server says
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
        for tile in &told.tiles {
            self.put(tile);
        }
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
        let along = |column: u32, first: u32, columns: u32| {
            let place = column.checked_sub(first).filter(|&place| place < columns)?;
            Some(place / self.stride)
        };
        let x = along(column_x, self.origin.0, self.extent.0)?;
        let z = along(column_z, self.origin.1, self.extent.1)?;
        let height = self.heights[self.index(x, z)?];
        (!height.is_nan()).then_some(height)
    }

    /// Ticks until the state that it shows.
    pub fn tick(&self) -> u64 {
        self.tick
    }

    /// The state from which a later subscription can resume; `None` before the first complete one.
    pub fn resume(&self) -> Option<Resume> {
        self.seen.clone()
    }

    fn put(&mut self, tile: &HeightTile) {
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
                if let Some(index) = self.index(x, z) {
                    self.heights[index] = height;
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
mod tests {
    use firn_protocol::{Pressing, Settings, Stamp};

    use super::*;

    fn welcome(epoch: &str) -> Welcome {
        let settings = Settings {
            air_temperature: -3.0,
            time_scale: 1.0,
            tick_rate: 60.0,
            paused: true,
            snowfall_rate: 0.0,
            pressing: Pressing::default(),
            idle_timeout_s: None,
            delete_after_s: None,
        };
        Welcome {
            session: "alp".to_owned(),
            epoch: epoch.to_owned(),
            stamp: Stamp::default(),
            tile_size: TILE_SIDE,
            grid: Grid { width: 20, depth: 10, height: 4, cell_size: 0.5 },
            settings,
        }
    }

    fn field(wish: &Subscribe) -> HeightField {
        HeightField::new(&welcome("e"), 1, wish)
    }

    fn told(seq: u64, more: bool, tiles: Vec<HeightTile>) -> Heights {
        let snapshot = false;
        Heights { snapshot, id: 1, seq, tick: 7, recovered: None, more, tiles, colliders: None }
    }

    fn tile(column_x: u64, column_z: u64, width: u32, depth: u32, height: f64) -> HeightTile {
        let heights = vec![height; (width * depth) as usize];
        HeightTile { column_x, column_z, width, depth, heights }
    }

    #[test]
    fn a_region_is_widened_to_whole_tiles_of_the_grid() {
        let region = ColumnRegion { column_x: 9, column_z: -3, width: 8, depth: 5 };
        let part = field(&Subscribe { region: Some(region), ..Subscribe::default() });
        assert_eq!((part.origin(), part.size()), ((8, 0), (12, 8)));
        let all = field(&Subscribe { stride: 4, ..Subscribe::default() });
        assert_eq!((all.origin(), all.size()), ((0, 0), (5, 3)));
    }

    #[test]
    fn a_sample_stands_for_the_columns_that_there_are() {
        let mut coarse = field(&Subscribe { stride: 8, ..Subscribe::default() });
        assert!(coarse.take(&told(1, false, vec![tile(16, 8, 1, 1, 2.0)])));
        assert_eq!((coarse.height(16, 8), coarse.height(19, 9)), (Some(2.0), Some(2.0)));
        assert_eq!((coarse.height(20, 9), coarse.height(19, 10)), (None, None));
    }

    #[test]
    fn it_resumes_from_what_is_complete() {
        let mut field = field(&Subscribe::default());
        assert_eq!((field.height(1, 1), field.resume()), (None, None));
        assert!(!field.take(&told(5, true, vec![tile(0, 0, 8, 8, 1.5)])));
        assert_eq!((field.height(7, 7), field.resume()), (Some(1.5), None));
        assert!(field.take(&told(5, false, vec![tile(16, 8, 4, 2, 0.25)])));
        assert_eq!((field.height(19, 9), field.height(20, 9)), (Some(0.25), None));
        assert_eq!(field.resume(), Some(Resume { epoch: "e".to_owned(), seq: 5 }));
    }

    #[test]
    fn another_stream_goes_on_with_it() {
        let mut field = field(&Subscribe::default());
        assert!(field.take(&told(5, false, vec![tile(0, 0, 8, 8, 1.5)])));
        assert_eq!(field.reconnect(&welcome("e"), 2), Ok(()));
        assert!(field.resume().is_some() && field.height(0, 0) == Some(1.5));
        assert!(!field.take(&told(6, false, Vec::new())), "of the old subscription");
        assert_eq!(field.reconnect(&welcome("f"), 3), Ok(()));
        let seen = field.resume().unwrap();
        assert_eq!((&*seen.epoch, seen.seq), ("e", 5), "the server has been started since");
        let told = Heights { id: 3, ..told(70, false, vec![tile(0, 0, 8, 8, 2.5)]) };
        assert!(field.take(&told) && field.height(0, 0) == Some(2.5));
        assert_eq!(field.resume().unwrap().epoch, "f");
        let mut other = welcome("f");
        other.grid.width += 1;
        assert_eq!(field.reconnect(&other, 4), Err(OtherGrid));
    }
}
