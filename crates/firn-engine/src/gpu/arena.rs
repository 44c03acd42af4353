//! Where snowpacks live on the device: tables of tiles and columns for all of them, and pages of
//! cells.

use std::ops::Range;

use firn_snow::alpine::Surface;
use firn_snow::{ColumnRect, Grid, TILE_COLUMNS};

use crate::frame::{EngineError, Layout, Slot, TileCells, slots_beside};

use super::buffer::Table;
use super::device::Device;
use super::kernels::Resource;
use super::layout::{AWAKE, DIRTY, Elevation, SURFACE_ROWS, Tile, words_of};
use super::pages::{Budget, Page, Pages, Place, ROW_BYTES};
use super::ranges::Ranges;
use super::tables::PACKED_BYTES;

/// Tiles the tables begin with.
const FIRST_TILES: u32 = 1 << 10;

/// Tiles that `publish` looks through together: the tables end with a whole group of them.
const GROUP: u64 = 64;

/// A snowpack's part of the arena.
#[derive(Debug)]
pub struct Lot {
    /// Its tiles in the tables.
    pub tiles: Range<u32>,
    /// Where each tile's cells are.
    pub places: Vec<Place>,
    /// Rows of a tile: its slots, and what alpine snow has behind them.
    pub height: u32,
}

/// The tables of tiles and columns, and the pages of cells.
#[derive(Debug)]
pub struct Arena {
    tiles: Ranges,
    /// Tables with a row for each tile: tiles, states; heights, filled slots and ground of each
    /// tile's columns.
    pub(super) tables: [(Resource, Table); 5],
    /// Cells.
    pub pages: Pages,
    budget: u64,
    /// Counts replacements of tables.
    replaced: u64,
}

/// Bytes for each tile in the tables, in the order of `Arena::tables`.
pub(super) const TILE_BYTES: [u64; 5] = [16, 4, ROW_BYTES, ROW_BYTES, 2 * ROW_BYTES];

impl Arena {
    /// An arena that takes no more than `budget` bytes.
    pub fn new(device: &Device, budget: u64) -> Arena {
        let usage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::COPY_SRC;
        let mut bytes = TILE_BYTES.into_iter();
        let mut table = |resource, label| {
            let size = u64::from(FIRST_TILES) * bytes.next().unwrap_or(ROW_BYTES);
            (resource, Table::new(&device.device, label, usage, size))
        };
        let tables = [
            table(Resource::Tiles, "tiles"),
            table(Resource::States, "states"),
            table(Resource::Heights, "heights"),
            table(Resource::Filled, "filled"),
            table(Resource::Ground, "ground"),
        ];
        let arena = Arena {
            tiles: Ranges::new(FIRST_TILES),
            tables,
            pages: Pages::default(),
            budget,
            replaced: 0,
        };
        arena.disown(device, 0..FIRST_TILES);
        arena
    }

    /// The buffer of a table of tiles or columns.
    pub fn table(&self, resource: Resource) -> Option<&wgpu::Buffer> {
        self.tables.iter().find(|(r, _)| *r == resource).map(|(_, table)| table.buffer())
    }

    /// End of the last tile in use.
    pub fn tile_end(&self) -> u32 {
        self.tiles.end()
    }

    /// Counts replacements of buffers, after which bindings have to be made anew.
    pub fn generation(&self) -> u64 {
        self.replaced + self.pages.generation
    }

    /// Bytes of device memory held for cells, and for the tables of the tiles in use.
    pub fn memory(&self) -> u64 {
        self.pages.bytes() + self.table_bytes()
    }

    fn table_bytes(&self) -> u64 {
        u64::from(self.tiles.end()) * TILE_BYTES.iter().sum::<u64>()
    }

    /// Takes a part of the arena for a snowpack. It is still to be furnished.
    ///
    /// # Errors
    /// [`EngineError::OutOfMemory`]; nothing is taken then.
    pub fn take(
        &mut self,
        device: &Device,
        slot: Slot,
        layout: &Layout,
    ) -> Result<Lot, EngineError> {
        let grid = &layout.grid;
        let count = grid.tiles();
        let height = rows_of(layout);
        let tiles = self.take_tiles(device, count)?;
        let budget = Budget { most: self.budget, beside: self.table_bytes() };
        let places = match self.pages.take(device, count, height, budget) {
            Ok(places) => places,
            Err(error) => {
                self.tiles.give_back(tiles);
                return Err(error);
            }
        };
        let row = |(tile, place): (u32, &Place)| Tile::new(slot, *place, grid, tile, false);
        let rows: Vec<Tile> = (0..).zip(&places).map(row).collect();
        self.write(device, Resource::Tiles, tiles.start, &rows);
        Ok(Lot { tiles, places, height })
    }

    /// Gives a snowpack's part back, and releases the pages that are empty then.
    pub fn give_back(&mut self, device: &Device, lot: Lot) {
        self.disown(device, lot.tiles.clone());
        self.tiles.give_back(lot.tiles);
        self.pages.give_back(&lot.places, lot.height);
    }

    fn take_tiles(&mut self, device: &Device, count: u32) -> Result<Range<u32>, EngineError> {
        if let Some(tiles) = self.tiles.take(count) {
            return Ok(tiles);
        }
        let old = self.tiles.capacity();
        // All tiles may be published in one frame, in a buffer with everything else that it leaves.
        let most = device.largest_binding() / PACKED_BYTES / 2 / GROUP * GROUP;
        let wanted = u64::from(old).saturating_mul(2).max(u64::from(old) + u64::from(count));
        let capacity = wanted.next_multiple_of(GROUP).min(most);
        if capacity < u64::from(old) + u64::from(count) {
            return Err(EngineError::OutOfMemory(format!(
                "{count} tiles more than the {old} there are would exceed the device's tables of \
                 {most} tiles"
            )));
        }
        let larger: Vec<wgpu::Buffer> = device.allocate(|| {
            let sizes = TILE_BYTES.map(|bytes| capacity * bytes);
            let tables = self.tables.iter().zip(sizes);
            tables.map(|((_, table), size)| table.another(&device.device, size)).collect()
        })?;
        for ((_, table), larger) in self.tables.iter_mut().zip(larger) {
            table.move_to(larger, &device.device, &device.queue);
        }
        self.replaced += 1;
        self.tiles.grow(capacity as u32);
        self.disown(device, old..capacity as u32);
        self.tiles.take(count).ok_or_else(|| EngineError::OutOfMemory("no tiles".to_owned()))
    }

    /// Writes the cells of some of a snowpack's tiles, each with so many slots, ahead of the next submit; `saved` has
    /// those of all.
    pub fn restore(
        &self,
        device: &Device,
        lot: &Lot,
        slots: u32,
        tiles: Range<u32>,
        saved: &[TileCells],
    ) {
        let first = lot.tiles.start + tiles.start;
        let range = tiles.start as usize..(tiles.end as usize).min(saved.len());
        let tiles = &saved[range.clone()];
        for (place, cells) in lot.places[range].iter().zip(tiles) {
            let Some(page) = self.pages.get(place.page) else { continue };
            let planes: [&[u8]; 4] = [
                bytemuck::cast_slice(&cells.mass),
                bytemuck::cast_slice(&cells.thickness),
                bytemuck::cast_slice(&cells.temperature),
                bytemuck::cast_slice(&cells.stress),
            ];
            for (buffer, plane) in page.cells.iter().zip(planes) {
                device.queue.write_buffer(buffer, u64::from(place.row) * ROW_BYTES, plane);
            }
            if !cells.surfaces.is_empty() {
                write_surfaces(device, page, place.row + slots, &cells.surfaces);
            }
        }
        let (mut heights, mut filled) = (Vec::new(), Vec::new());
        for cells in tiles {
            for column in 0..TILE_COLUMNS {
                heights.push(cells.column(column).map(|cell| cell.thickness).sum::<u32>());
                filled.push(cells.column(column).count() as u32);
            }
        }
        self.write(device, Resource::Heights, first * TILE_COLUMNS, &heights);
        self.write(device, Resource::Filled, first * TILE_COLUMNS, &filled);
        self.write(device, Resource::States, first, &vec![AWAKE | DIRTY; tiles.len()]);
    }

    /// Writes the ground of some of a snowpack's tiles, ahead of the next submit, out of the elevations of
    /// all columns \[m\].
    pub fn write_ground(
        &self,
        device: &Device,
        lot: &Lot,
        tiles: Range<u32>,
        grid: &Grid,
        ground: &[f64],
    ) {
        let mut rows = vec![Elevation::default(); tiles.len() * TILE_COLUMNS as usize];
        for (tile, rows) in tiles.clone().zip(rows.chunks_mut(TILE_COLUMNS as usize)) {
            let ColumnRect { x0, z0, x1, z1 } = grid.tile_rect(tile);
            for (x, z) in (z0..z1).flat_map(|z| (x0..x1).map(move |x| (x, z))) {
                if let Some(&metres) = ground.get(z as usize * grid.width as usize + x as usize) {
                    let (_, column) = grid.locate(x, z);
                    rows[column as usize] = firn_snow::Elevation::new(grid, metres).into();
                }
            }
        }
        let first = (lot.tiles.start + tiles.start) * TILE_COLUMNS;
        self.write(device, Resource::Ground, first, &rows);
    }

    /// Marks tiles as nobody's.
    fn disown(&self, device: &Device, tiles: Range<u32>) {
        let nobodys = vec![Tile::NOBODYS; tiles.len()];
        self.write(device, Resource::Tiles, tiles.start, &nobodys);
    }

    /// Fills all memory that no snowpack owns with rubbish.
    pub fn poison(&self, device: &Device) {
        let fill = |buffer: &wgpu::Buffer, rows: &Range<u32>, bytes: u64| {
            let rubbish = vec![0xa5_u8; rows.len() * bytes as usize];
            device.queue.write_buffer(buffer, u64::from(rows.start) * bytes, &rubbish);
        };
        for page in self.pages.iter() {
            for rows in page.free() {
                page.cells.iter().for_each(|cells| fill(cells, &rows, ROW_BYTES));
            }
        }
        for ((resource, table), bytes) in self.tables.iter().zip(TILE_BYTES) {
            if *resource != Resource::Tiles {
                self.tiles.free().for_each(|rows| fill(table.buffer(), &rows, bytes));
            }
        }
    }

    /// Writes rows of a table ahead of the next submit.
    pub fn write<T: bytemuck::Pod>(
        &self,
        device: &Device,
        table: Resource,
        first: u32,
        rows: &[T],
    ) {
        if let Some(buffer) = self.table(table) {
            let offset = u64::from(first) * std::mem::size_of::<T>() as u64;
            device.queue.write_buffer(buffer, offset, bytemuck::cast_slice(rows));
        }
    }
}

/// Rows of a tile, with those that alpine snow has behind its cells.
fn rows_of(layout: &Layout) -> u32 {
    let height = layout.grid.height;
    height + layout.surface.map_or(0, |_| slots_beside(height))
}

/// Writes what the columns of a tile have beside their cells, from a row on.
fn write_surfaces(device: &Device, page: &Page, row: u32, surfaces: &[Surface]) {
    let words: Vec<[u32; 8]> = surfaces.iter().map(words_of).collect();
    for (half, row) in (row..row + SURFACE_ROWS).enumerate() {
        for (i, buffer) in page.cells.iter().enumerate() {
            let plane: Vec<u32> = words.iter().map(|words| words[4 * half + i]).collect();
            let bytes = bytemuck::cast_slice(&plane);
            device.queue.write_buffer(buffer, u64::from(row) * ROW_BYTES, bytes);
        }
    }
}
