//! A tile of 8 × 8 columns: what is edited, stressed, compacted and put to sleep together.

use std::collections::TryReserveError;

use crate::alpine::Surface;
use crate::column::{Column, SurfaceLoad};
use crate::contact::share;
use crate::elevation::Elevation;
use crate::footprint::Footprint;
use crate::grid::{ColumnRect, Grid, TILE_COLUMNS, TILE_SIDE};
use crate::material::Material;

use super::Collider;

const COLUMNS: usize = TILE_COLUMNS as usize;

/// A tile's columns and what is known about them.
#[derive(Clone, Debug)]
pub(super) struct Tile {
    /// The columns inside the grid.
    pub rect: ColumnRect,
    /// All columns, row by row; those outside the grid stay empty.
    pub columns: Vec<Column>,
    /// What each column of alpine snow has beside its cells; nothing where the snow is none.
    pub surfaces: Vec<Surface>,
    /// Ground elevation of each column.
    pub ground: [Elevation; COLUMNS],
    /// Height of each column in quanta.
    pub heights: [u32; COLUMNS],
    /// Objects that stand on the tile: indices in ascending order of ids.
    pub loads: Vec<usize>,
    /// Columns, bit by bit, on which no snow falls because of objects, and those on which objects stand.
    pub sheltered: u64,
    pub stood_on: u64,
    /// Whether it is under an object, or one moves over it in this cycle.
    pub under_objects: bool,
    /// Whether a cell may change in the next cycle.
    pub awake: bool,
    /// Changed since it was last reported.
    pub dirty: bool,
    /// Heights have changed since contacts were last evaluated.
    pub moved: bool,
    /// Stresses are to be evaluated anew: masses or the objects on the tile have changed.
    pub stale: bool,
}

/// What changes of some columns returned.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Edited {
    pub sum: u64,
    pub largest: u32,
}

impl Tile {
    /// Bytes of a tile without snow.
    pub const BYTES: u64 = (size_of::<Tile>() + COLUMNS * size_of::<Column>()) as u64;

    pub fn new(grid: &Grid, tile: u32, ground: &[f64]) -> Result<Tile, TryReserveError> {
        let rect = grid.tile_rect(tile);
        let mut columns = Vec::new();
        columns.try_reserve_exact(COLUMNS)?;
        columns.resize(COLUMNS, Column::default());
        Ok(Tile {
            rect,
            columns,
            surfaces: Vec::new(),
            ground: ground_of(grid, rect, ground),
            heights: [0; COLUMNS],
            loads: Vec::new(),
            sheltered: 0,
            stood_on: 0,
            under_objects: false,
            awake: false,
            dirty: true,
            moved: false,
            stale: false,
        })
    }

    /// Puts other ground under the snow. What stands there moves with it.
    pub fn set_ground(&mut self, grid: &Grid, ground: &[f64]) {
        self.ground = ground_of(grid, self.rect, ground);
        self.moved = true;
    }

    /// Elevation of a column's surface.
    #[inline]
    pub fn surface(&self, column: usize) -> Elevation {
        self.ground[column].under(self.heights[column])
    }

    /// Changes the columns inside a rectangle, each with its place, but for those with a bit among the `spared`.
    pub fn edit(
        &mut self,
        rect: ColumnRect,
        spared: u64,
        mut change: impl FnMut(&mut Column, (u32, u32)) -> u32,
    ) -> Edited {
        let mut edited = Edited::default();
        for (x, z) in self.rect.overlap(&rect).into_iter().flat_map(positions) {
            let index = column_index(x, z);
            if spared >> index & 1 == 1 {
                continue;
            }
            let column = &mut self.columns[index];
            let quanta = change(column, (x, z));
            edited.sum += u64::from(quanta);
            edited.largest = edited.largest.max(quanta);
            self.heights[index] = column.height();
            (self.awake, self.dirty, self.moved, self.stale) = (true, true, true, true);
        }
        edited
    }

    /// Replaces all columns, stresses included, and what those of alpine snow have beside them.
    pub fn restore(&mut self, columns: impl Iterator<Item = Column>, surfaces: &[Surface]) {
        self.surfaces = surfaces.to_vec();
        for (index, column) in columns.enumerate().take(COLUMNS) {
            self.heights[index] = column.height();
            self.columns[index] = column;
        }
        (self.awake, self.dirty, self.moved, self.stale) = (true, true, true, false);
    }

    /// Evaluates stresses, and wakes the tile where one has changed.
    #[inline]
    pub fn stress(&mut self, grid: &Grid, material: &Material, colliders: &[&Collider]) {
        let mut loads = Vec::with_capacity(self.loads.len());
        for (x, z) in positions(self.rect) {
            let index = column_index(x, z);
            let surface = self.surface(index);
            loads.clear();
            for collider in self.loads.iter().map(|&load| colliders[load]) {
                let contact = &collider.contact;
                let stands = collider.stands.iter().filter(|it| covers(&it.footprint, x, z));
                loads.extend(stands.map(|stand| {
                    let surface = surface.less(stand.footprint.lift_over(x, z));
                    let pressure = contact.pressure * share(contact.bottom, surface);
                    SurfaceLoad { pressure, width: stand.width }
                }));
            }
            self.awake |= self.columns[index].stress(grid, material, &loads);
        }
        self.stale = false;
    }

    /// Cells in all columns.
    #[inline]
    pub fn cells(&self) -> u64 {
        self.columns.iter().map(|column| column.cells.len() as u64).sum()
    }

    /// Runs a number of cycles of every column where a cell may change; `run` says of one after how many of
    /// them nothing changed any more. Returns that of all, and how many cells were compacted.
    pub fn run_if_due(
        &mut self,
        always: bool,
        cycles: u32,
        run: impl Fn(&mut Column) -> u32,
    ) -> (u32, u64) {
        if !(always || self.awake) {
            return (0, 1);
        }
        let last = self.run(cycles, run);
        (last, 1 + self.cells() * u64::from(cycles.min(last + 1)))
    }

    /// Runs every column; returns 1 + the index of the last cycle in which a cell changed, and
    /// goes to sleep where that was not the very last one.
    #[inline]
    fn run(&mut self, cycles: u32, run: impl Fn(&mut Column) -> u32) -> u32 {
        let mut last = 0;
        for (column, height) in self.columns.iter_mut().zip(&mut self.heights) {
            let changed = run(column);
            if changed > 0 {
                *height = column.height();
                (self.dirty, self.moved) = (true, true);
            }
            last = last.max(changed);
        }
        self.awake = last == cycles;
        last
    }
}

/// Every column (x, z) of a rectangle, row by row.
#[inline]
pub(super) fn positions(rect: ColumnRect) -> impl Iterator<Item = (u32, u32)> {
    (rect.z0..rect.z1).flat_map(move |z| (rect.x0..rect.x1).map(move |x| (x, z)))
}

/// Ground of a tile's columns; those outside the grid are at 0.
fn ground_of(grid: &Grid, rect: ColumnRect, ground: &[f64]) -> [Elevation; COLUMNS] {
    let mut elevations = [Elevation::default(); COLUMNS];
    for (x, z) in positions(rect) {
        let metres = ground.get(z as usize * grid.width as usize + x as usize);
        elevations[column_index(x, z)] =
            metres.map_or(Elevation(0), |&metres| Elevation::new(grid, metres));
    }
    elevations
}

/// Index of column (x, z) in its tile.
#[inline]
pub(super) fn column_index(x: u32, z: u32) -> usize {
    (z % TILE_SIDE * TILE_SIDE + x % TILE_SIDE) as usize
}

/// Whether a footprint covers column (x, z).
#[inline]
fn covers(footprint: &Footprint, x: u32, z: u32) -> bool {
    let row = z.checked_sub(footprint.z0).and_then(|row| footprint.spans.get(row as usize));
    row.is_some_and(|&(x0, x1)| (x0..x1).contains(&x))
}
