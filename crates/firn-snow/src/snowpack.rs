//! A whole snowpack: its columns in tiles, the objects on it, and which tiles are at rest.

mod collider;
mod edit;
mod run;
mod stamp;
mod tile;
mod weather;

use std::collections::{BTreeMap, BTreeSet, TryReserveError};
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::alpine::Surface;
use super::body::Cover;
use super::column::Column;
use super::contact::Contact;
use super::footprint::Footprint;
use super::grid::{ColumnRect, Grid, TILE_COLUMNS};
use super::material::Material;
use super::pressing::Pressing;
use super::sample::{Floor, Sample, sample_column};
use collider::{Collider, Stand};
use tile::Tile;

pub use run::Progress;
pub use weather::{ColumnTotals, Exchanged};

/// A snowpack stepped by the plain-Rust columns.
///
/// Tiles in which nothing moves sleep, and objects on them are not evaluated. That saves work and
/// changes nothing else: `always_awake` gives the same bits.
#[derive(Clone, Debug)]
pub struct Snowpack {
    grid: Grid,
    material: Material,
    tiles: Vec<Tile>,
    colliders: BTreeMap<Arc<str>, Collider>,
    /// Tiles under objects and swept ones, in ascending order.
    loaded: Vec<usize>,
    /// Tiles that belong to those in this cycle, because objects move over them.
    swept: BTreeSet<usize>,
    /// Objects have come, moved or gone since those were listed.
    relist: bool,
    /// Δt of the last run \[s\].
    dt: f64,
    pressing: Pressing,
    /// What falls on each column of the short wave in the step that shades, as a part of it.
    shine: Vec<f32>,
    always_awake: bool,
}

impl Snowpack {
    /// A snowpack without snow. `ground` holds the ground elevation of each column \[m\], row by row; where it
    /// is shorter than the grid, the ground is at 0. No tile sleeps where they are to be `always_awake`, which
    /// makes no difference to any result.
    ///
    /// # Errors
    /// Where there is no memory for it.
    pub fn new(
        grid: Grid,
        material: Material,
        ground: &[f64],
        always_awake: bool,
    ) -> Result<Snowpack, TryReserveError> {
        let mut tiles = Vec::new();
        tiles.try_reserve_exact(grid.tiles() as usize)?;
        for tile in 0..grid.tiles() {
            tiles.push(Tile::new(&grid, tile, ground)?);
        }
        Ok(Snowpack {
            grid,
            material,
            tiles,
            colliders: BTreeMap::new(),
            loaded: Vec::new(),
            swept: BTreeSet::new(),
            relist: false,
            dt: 0.0,
            pressing: Pressing::default(),
            shine: Vec::new(),
            always_awake,
        })
    }

    /// Bytes that a snowpack without snow takes.
    pub fn bytes(grid: &Grid) -> u64 {
        u64::from(grid.tiles()) * Tile::BYTES
    }

    /// Puts other ground under the snow of a tile, out of all columns' as in [`Snowpack::new`].
    pub fn set_ground(&mut self, tile: u32, ground: &[f64]) {
        if let Some(tile) = self.tiles.get_mut(tile as usize) {
            tile.set_ground(&self.grid, ground);
        }
    }

    /// Puts an object on the snow, or replaces the one of that id. Where it is `placed`, the
    /// depth that it has sunk is counted from here.
    pub fn put_collider(
        &mut self,
        id: Arc<str>,
        mass: f64,
        cover: Cover,
        footprints: Vec<Footprint>,
        placed: bool,
    ) {
        let stands = footprints.into_iter().map(|footprint| Stand::new(footprint, &self.grid));
        let stands: Vec<Stand> = stands.collect();
        let tiles = stands.iter().flat_map(|stand| stand.columns.iter().map(|&(tile, ..)| tile));
        let tiles = tiles.collect::<BTreeSet<usize>>().into_iter().collect();
        let old = self.take_collider(&id).filter(|_| !placed);
        let collider = Collider {
            mass,
            cover,
            stands,
            tiles,
            placed: old.as_ref().is_none_or(|old| old.placed),
            contact: old.map(|old| old.contact).unwrap_or_default(),
            changed: true,
        };
        self.colliders.insert(id, collider);
        self.relist = true;
    }

    /// Replaces the columns of a tile, and what those of alpine snow have beside their cells. Stresses are taken as
    /// they are.
    pub fn restore_tile(
        &mut self,
        tile: u32,
        columns: impl Iterator<Item = Column>,
        surfaces: &[Surface],
    ) {
        if let Some(tile) = self.tiles.get_mut(tile as usize) {
            tile.restore(columns, surfaces);
        }
    }

    /// Replaces all objects by others and their contacts, as they were.
    pub fn restore_colliders(
        &mut self,
        colliders: impl Iterator<Item = (Arc<str>, f64, Cover, Vec<Footprint>, Contact)>,
    ) {
        self.colliders.clear();
        for (id, mass, cover, footprints, contact) in colliders {
            self.put_collider(id.clone(), mass, cover, footprints, false);
            if let Some(collider) = self.colliders.get_mut(&id) {
                collider.contact = contact;
                (collider.placed, collider.changed) = (false, false);
            }
        }
    }

    /// Takes an object away.
    pub fn remove_collider(&mut self, id: &str) {
        self.take_collider(id);
    }

    /// Takes an object out and marks the tiles that it stood on.
    fn take_collider(&mut self, id: &str) -> Option<Collider> {
        let collider = self.colliders.remove(id)?;
        for &tile in &collider.tiles {
            self.tiles[tile].stale = true;
        }
        self.relist = true;
        Some(collider)
    }

    /// Lists for each tile the objects on it, in ascending order of ids, where that has changed.
    fn list_loads(&mut self) {
        if !std::mem::take(&mut self.relist) {
            return;
        }
        for &tile in &self.loaded {
            self.tiles[tile].loads.clear();
            self.tiles[tile].under_objects = false;
            (self.tiles[tile].sheltered, self.tiles[tile].stood_on) = (0, 0);
        }
        self.loaded.clear();
        self.loaded.extend(&self.swept);
        for (index, collider) in self.colliders.values().enumerate() {
            for &tile in &collider.tiles {
                self.loaded.push(tile);
                self.tiles[tile].loads.push(index);
            }
        }
        for collider in self.colliders.values() {
            let Cover { snow, clearings } = collider.cover;
            for &(tile, column, _) in collider.stands.iter().flat_map(|stand| &stand.columns) {
                self.tiles[tile].sheltered |= u64::from(snow) << column;
                self.tiles[tile].stood_on |= u64::from(clearings) << column;
            }
        }
        self.loaded.sort_unstable();
        self.loaded.dedup();
        for &tile in &self.loaded {
            self.tiles[tile].under_objects = true;
        }
    }

    /// Gives the snow other constants, and wakes every tile.
    pub fn set_material(&mut self, material: Material) {
        self.material = material;
        for tile in &mut self.tiles {
            tile.stale = true;
        }
        self.wake();
    }

    /// Says how snow gives way under objects, and wakes every tile where that is another way.
    pub fn set_pressing(&mut self, pressing: Pressing) {
        if pressing != self.pressing {
            self.pressing = pressing;
            self.wake();
        }
    }

    /// Wakes every tile.
    pub fn wake(&mut self) {
        for tile in &mut self.tiles {
            tile.awake = true;
        }
    }

    /// Size of the grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Column (x, z), which must be inside the grid.
    pub fn column(&self, x: u32, z: u32) -> &Column {
        let (tile, column) = self.grid.locate(x, z);
        &self.tiles[tile as usize].columns[column as usize]
    }

    /// The 64 columns of a tile, those outside the grid empty; `None` where there is no such tile.
    pub fn tile(&self, tile: u32) -> Option<&[Column]> {
        self.tiles.get(tile as usize).map(|tile| tile.columns.as_slice())
    }

    /// Samples a range of the fixed grid's cells above a floor in some columns, with the indent of a
    /// cycle of `dt` seconds: x fastest, then y, then z.
    pub fn sample(
        &self,
        rect: ColumnRect,
        floor: Floor,
        range: Range<u32>,
        dt: f64,
    ) -> Vec<Sample> {
        let width = (rect.x1 - rect.x0) as usize;
        let layer = width * range.len();
        let mut samples = vec![Sample::default(); layer * (rect.z1 - rect.z0) as usize];
        samples.par_chunks_mut(layer.max(1)).zip(rect.z0..rect.z1).for_each(|(layer, z)| {
            for x in rect.x0..rect.x1 {
                let column = self.sample_column(x, z, floor, range.clone(), dt);
                let cells = layer.iter_mut().skip((x - rect.x0) as usize).step_by(width);
                cells.zip(column).for_each(|(cell, sample)| *cell = sample);
            }
        });
        samples
    }

    fn sample_column(
        &self,
        x: u32,
        z: u32,
        floor: Floor,
        range: Range<u32>,
        dt: f64,
    ) -> Vec<Sample> {
        let (tile, column) = self.grid.locate(x, z);
        let tile = &self.tiles[tile as usize];
        let cells = tile.columns[column as usize].cells.iter().copied();
        let ground = floor.below(tile.ground[column as usize]);
        sample_column(&self.grid, &self.material, dt as f32, ground, cells, range)
    }

    /// Tiles that are awake.
    pub fn active_tiles(&self) -> u32 {
        self.tiles.iter().filter(|tile| tile.awake).count() as u32
    }

    /// The tiles that have changed since this was last asked, with their columns' heights in
    /// quanta. All tiles of a new snowpack count as changed.
    pub fn take_dirty(&mut self) -> impl Iterator<Item = (u32, [u32; TILE_COLUMNS as usize])> {
        self.tiles.iter_mut().zip(0..).filter_map(|(tile, index)| {
            std::mem::take(&mut tile.dirty).then_some((index, tile.heights))
        })
    }

    /// Contacts as last evaluated, in ascending order of ids.
    pub fn contacts(&self) -> impl Iterator<Item = (&Arc<str>, &Contact)> {
        self.colliders.iter().map(|(id, collider)| (id, &collider.contact))
    }

    /// Present mass: the sum of all cells, in quanta.
    pub fn mass(&self) -> u64 {
        self.mass_of(0..self.grid.tiles())
    }

    /// The same of some tiles.
    pub fn mass_of(&self, tiles: Range<u32>) -> u64 {
        let tiles = &self.tiles[tiles.start as usize..tiles.end as usize];
        let columns = tiles.iter().flat_map(|tile| &tile.columns);
        columns.map(|column| u64::from(column.mass())).sum()
    }
}
