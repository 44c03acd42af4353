//! The published state of a snowpack, kept on the host: reads and streams are served from it and
//! never wait for the device.

use std::collections::TryReserveError;
use std::sync::Arc;

use firn_engine::reserve::try_filled;
use firn_protocol::{ColliderView, Progress, SessionSpec, Settings, Stamp, Summary};
use firn_snow::{ColumnRect, Grid, Material, TILE_COLUMNS};

use crate::core::session::{Alpine, Clock, Ground};

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
    /// The ground at `seq`.
    pub ground: Ground,
    /// `seq` at which the ground last changed.
    pub ground_version: u64,
    /// The clock when this was published.
    pub clock: Clock,
    /// Frame of the publication where ticks pass without changing anything since; `None` where
    /// every tick is published.
    pub resting_since: Option<u64>,
    /// Ticks that pass so at the most: the next brings weather.
    pub resting_ticks: u64,
    /// The weather at `seq`, where the snow is alpine.
    pub(crate) alpine: Option<Alpine>,
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

    /// Over some columns of a tile, given the heights of all.
    #[inline]
    fn of(grid: &Grid, rect: ColumnRect, heights: &TileColumns) -> Sums {
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
        spec: &SessionSpec,
        ground: Ground,
        clock: Clock,
    ) -> Result<Mirror, TryReserveError> {
        let grid = spec.grid;
        let count = grid.tiles() as usize;
        let tiles = try_filled(count, [0; TILE_COLUMNS as usize])?;
        let versions = try_filled(count, 1)?;
        let sums = try_filled(count, Sums::BARE)?;
        Ok(Mirror {
            grid,
            material: spec.material,
            settings: spec.settings(),
            ground,
            ground_version: 1,
            clock,
            resting_since: None,
            resting_ticks: u64::MAX,
            alpine: Alpine::new(spec),
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
        self.sums[tile as usize] = Sums::of(&self.grid, self.grid.tile_rect(tile), heights);
    }

    /// Whether a tile's heights are those already known.
    pub(crate) fn shows(&self, tile: u32, heights: &TileColumns) -> bool {
        self.tiles[tile as usize] == *heights
    }

    /// Goes on from what was published before the server was started: up to `seq`, with the
    /// versions that tiles had, where they are known.
    pub(crate) fn go_on_from(&mut self, seq: u64, versions: Option<&[u64]>) {
        self.seq = seq;
        // Nobody knows which ground was told before.
        self.ground_version = seq;
        if let Some(versions) = versions.filter(|known| known.len() == self.versions.len()) {
            self.versions.copy_from_slice(versions);
        }
    }

    /// Takes over the ground as it is at `seq`.
    pub(crate) fn lie_on(&mut self, ground: &Ground, seq: u64) {
        if !self.ground.is(ground) {
            self.ground = ground.clone();
            self.ground_version = seq;
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

    /// Mean depth of some columns, at least one \[m\].
    pub fn mean_depth(&self, columns: &ColumnRect) -> f64 {
        let sum = self.tiles_in(columns).map(|tile| {
            let rect = self.grid.tile_rect(tile);
            match rect.overlap(columns) {
                // All of the tile: its sum is kept.
                Some(part) if part == rect => self.sums[tile as usize].sum,
                Some(part) => Sums::of(&self.grid, part, &self.tiles[tile as usize]).sum,
                None => 0,
            }
        });
        self.grid.metres(sum.sum()) / columns.columns() as f64
    }

    /// Whether a tile that some columns meet has changed after `seq`.
    pub fn has_changed_since(&self, seq: u64, columns: &ColumnRect) -> bool {
        self.tiles_in(columns).any(|tile| self.versions[tile as usize] > seq)
    }

    fn tiles_in(&self, columns: &ColumnRect) -> impl Iterator<Item = u32> + use<> {
        let (tiles, row) = (columns.tiles(), self.grid.tiles_x());
        (tiles.z0..tiles.z1).flat_map(move |z| (tiles.x0..tiles.x1).map(move |x| z * row + x))
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
            clock.pass(clock.ticks_between(since, frame).min(self.resting_ticks));
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
