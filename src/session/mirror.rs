//! The published state of a snowpack, kept on the host: reads and streams are served from it and
//! never wait for the device.

use std::sync::Arc;

use crate::snow::{Grid, Material, TILE_COLUMNS};

use super::clock::Clock;
use super::view::{ColliderView, Settings, Stamp, Summary};

pub use crate::engine::published::TileColumns;

/// Everything about a snowpack that can be read without asking the device.
#[derive(Clone, Debug)]
pub struct Mirror {
    /// Size of the grid.
    pub grid: Grid,
    /// Material constants at `seq`.
    pub material: Material,
    /// Settings at `seq`.
    pub settings: Settings,
    /// The clock when this was published.
    pub clock: Clock,
    /// Frame of the publication where ticks pass without changing anything since; `None` where
    /// every tick is published.
    pub resting_since: Option<u64>,
    /// Number of the newest published change.
    pub seq: u64,
    /// Whether no snow falls and the last executed cycle changed no cell.
    pub settled: bool,
    /// Tiles in which snow moves.
    pub active_tiles: u32,
    /// Mass in quanta of the snow in all columns, by the ledger.
    pub mass_quanta: u128,
    /// Objects, in ascending order of their ids.
    pub colliders: Arc<[ColliderView]>,
    /// `seq` at which an object last changed.
    pub colliders_version: u64,
    tiles: Vec<TileColumns>,
    versions: Vec<u64>,
}

impl Mirror {
    /// The mirror of an empty snowpack.
    pub fn new(grid: Grid, material: Material, settings: Settings, clock: Clock) -> Mirror {
        let tiles = grid.tiles() as usize;
        Mirror {
            grid,
            material,
            settings,
            clock,
            resting_since: None,
            seq: 1,
            settled: true,
            active_tiles: 0,
            mass_quanta: 0,
            colliders: Arc::new([]),
            colliders_version: 1,
            tiles: vec![[0; TILE_COLUMNS as usize]; tiles],
            versions: vec![1; tiles],
        }
    }

    /// Takes over a tile that changed at `seq`.
    pub(super) fn update(&mut self, tile: u32, heights: &TileColumns, seq: u64) {
        self.tiles[tile as usize] = *heights;
        self.versions[tile as usize] = seq;
    }

    /// Takes over a tile as it was when its version was noted.
    pub(super) fn recall(&mut self, tile: u32, heights: &TileColumns) {
        self.tiles[tile as usize] = *heights;
    }

    /// Whether a tile's heights are those already known.
    pub(super) fn shows(&self, tile: u32, heights: &TileColumns) -> bool {
        self.tiles[tile as usize] == *heights
    }

    /// Goes on from what was published before the server was started: up to `seq`, with the
    /// versions that tiles had, where they are known.
    pub(super) fn go_on_from(&mut self, seq: u64, versions: Option<&[u64]>) {
        self.seq = seq;
        if let Some(versions) = versions.filter(|known| known.len() == self.versions.len()) {
            self.versions.copy_from_slice(versions);
        }
    }

    /// `seq` at which each tile last changed.
    pub(super) fn versions(&self) -> &[u64] {
        &self.versions
    }

    /// Publishes a change of a tile, for tests of what is made of it.
    #[cfg(test)]
    pub(crate) fn change(&mut self, tile: u32, seq: u64) {
        let heights = self.tiles[tile as usize].map(|height| height + 1);
        self.update(tile, &heights, seq);
        self.seq = seq;
    }

    /// Heights of a tile's columns, and the `seq` at which one last changed.
    pub fn tile(&self, tile: u32) -> (&TileColumns, u64) {
        (&self.tiles[tile as usize], self.versions[tile as usize])
    }

    /// Snow depth of a column, in thickness quanta.
    pub fn height(&self, x: u32, z: u32) -> u32 {
        let (tile, column) = self.grid.locate(x, z);
        self.tiles[tile as usize][column as usize]
    }

    /// The clock at a frame.
    pub fn clock_at(&self, frame: u64) -> Clock {
        let mut clock = self.clock;
        if let Some(since) = self.resting_since {
            clock.pass(clock.ticks_between(since, frame));
        }
        clock
    }

    /// Tick and seq at a frame.
    pub fn stamp_at(&self, frame: u64) -> Stamp {
        Stamp { tick: self.clock_at(frame).tick(), seq: self.seq }
    }

    /// Totals over the columns.
    pub fn summary(&self) -> Summary {
        let (mut sum, mut least, mut greatest) = (0u64, u32::MAX, 0u32);
        for tile in 0..self.grid.tiles() {
            let rect = self.grid.tile_rect(tile);
            let heights = &self.tiles[tile as usize];
            for z in rect.z0..rect.z1 {
                for x in rect.x0..rect.x1 {
                    let height = heights[self.grid.locate(x, z).1 as usize];
                    sum += u64::from(height);
                    least = least.min(height);
                    greatest = greatest.max(height);
                }
            }
        }
        let total_height = self.grid.metres(sum);
        let total_mass = self.grid.kilograms(self.mass_quanta);
        let volume = total_height * self.grid.column_area();
        Summary {
            mean_height: total_height / self.grid.columns() as f64,
            min_height: self.grid.metres(u64::from(least)),
            max_height: self.grid.metres(u64::from(greatest)),
            total_mass,
            mean_density: if sum == 0 { 0.0 } else { total_mass / volume },
            active_tiles: self.active_tiles,
            tiles: self.grid.tiles(),
            colliders: self.colliders.len(),
        }
    }
}
