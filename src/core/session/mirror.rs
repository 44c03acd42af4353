//! The published state of a snowpack, kept on the host: reads and streams are served from it and
//! never wait for the device.

use std::collections::TryReserveError;
use std::sync::Arc;

use firn_engine::reserve::try_filled;
use firn_protocol::{ColliderView, Progress, Settings, Stamp, Summary};
use firn_snow::{Grid, Material, TILE_COLUMNS};

use crate::core::session::Clock;

pub use firn_engine::published::TileColumns;

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
    /// How far the step under way has come, where there is one.
    pub progress: Option<Progress>,
    /// Mass in quanta of the snow in all columns, by the ledger.
    pub mass_quanta: u128,
    /// Objects, in ascending order of their ids.
    pub colliders: Arc<[ColliderView]>,
    /// `seq` at which an object last changed.
    pub colliders_version: u64,
    tiles: Vec<TileColumns>,
    versions: Vec<u64>,
    /// Sums over the columns of each tile.
    sums: Vec<Sums>,
}

/// Sums over the depths of some columns, in thickness quanta.
#[derive(Clone, Copy, Debug)]
struct Sums {
    sum: u64,
    least: u32,
    greatest: u32,
}

impl Sums {
    const NONE: Sums = Sums { sum: 0, least: u32::MAX, greatest: 0 };
    const BARE: Sums = Sums { sum: 0, least: 0, greatest: 0 };

    /// Over the columns of a tile that are part of the grid.
    #[inline]
    fn of(grid: &Grid, tile: u32, heights: &TileColumns) -> Sums {
        let rect = grid.tile_rect(tile);
        let all = (rect.z0..rect.z1).flat_map(|z| (rect.x0..rect.x1).map(move |x| (x, z)));
        all.map(|(x, z)| heights[grid.locate(x, z).1 as usize]).fold(Sums::NONE, |sums, height| {
            sums.and(Sums { sum: height.into(), least: height, greatest: height })
        })
    }

    #[inline]
    fn and(self, other: Sums) -> Sums {
        Sums {
            sum: self.sum + other.sum,
            least: self.least.min(other.least),
            greatest: self.greatest.max(other.greatest),
        }
    }
}

impl Mirror {
    /// The mirror of an empty snowpack.
    ///
    /// # Errors
    /// Where there is no memory for it.
    pub fn new(
        grid: Grid,
        material: Material,
        settings: Settings,
        clock: Clock,
    ) -> Result<Mirror, TryReserveError> {
        let count = grid.tiles() as usize;
        let tiles = try_filled(count, [0; TILE_COLUMNS as usize])?;
        let versions = try_filled(count, 1)?;
        let sums = try_filled(count, Sums::BARE)?;
        Ok(Mirror {
            grid,
            material,
            settings,
            clock,
            resting_since: None,
            seq: 1,
            settled: true,
            active_tiles: 0,
            progress: None,
            mass_quanta: 0,
            colliders: Arc::new([]),
            colliders_version: 1,
            tiles,
            versions,
            sums,
        })
    }

    /// Takes over a tile that changed at `seq`.
    pub(crate) fn update(&mut self, tile: u32, heights: &TileColumns, seq: u64) {
        self.recall(tile, heights);
        self.versions[tile as usize] = seq;
    }

    /// Takes over a tile as it was when its version was noted.
    pub(crate) fn recall(&mut self, tile: u32, heights: &TileColumns) {
        self.tiles[tile as usize] = *heights;
        self.sums[tile as usize] = Sums::of(&self.grid, tile, heights);
    }

    /// Whether a tile's heights are those already known.
    pub(crate) fn shows(&self, tile: u32, heights: &TileColumns) -> bool {
        self.tiles[tile as usize] == *heights
    }

    /// Goes on from what was published before the server was started: up to `seq`, with the
    /// versions that tiles had, where they are known.
    pub(crate) fn go_on_from(&mut self, seq: u64, versions: Option<&[u64]>) {
        self.seq = seq;
        if let Some(versions) = versions.filter(|known| known.len() == self.versions.len()) {
            self.versions.copy_from_slice(versions);
        }
    }

    /// `seq` at which each tile last changed.
    pub(crate) fn versions(&self) -> &[u64] {
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
    #[inline]
    pub fn tile(&self, tile: u32) -> (&TileColumns, u64) {
        (&self.tiles[tile as usize], self.versions[tile as usize])
    }

    /// Snow depth of a column, in thickness quanta.
    #[inline]
    pub fn height(&self, x: u32, z: u32) -> u32 {
        let (tile, column) = self.grid.locate(x, z);
        self.tiles[tile as usize][column as usize]
    }

    /// Memory that the heights take \[bytes\].
    pub(crate) fn bytes(&self) -> usize {
        self.tiles.capacity() * size_of::<TileColumns>()
            + self.versions.capacity() * size_of::<u64>()
            + self.sums.capacity() * size_of::<Sums>()
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
        let Sums { sum, least, greatest } =
            self.sums.iter().fold(Sums::NONE, |all, tile| all.and(*tile));
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
