//! Steps of weather on a whole snowpack of alpine snow.

use std::ops::Range;

use rayon::prelude::*;

use crate::alpine::{Exchange, Relief, Scratch, Surface, WeatherStep};
use crate::elevation::Elevation;
use crate::grid::{CELL, ColumnRect, Grid};

use super::Snowpack;
use super::tile::{Tile, column_index, positions};

/// What came into columns and left them, in mass quanta, beside what fell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exchanged {
    /// Snow that found no room.
    pub refused: u64,
    /// Vapour that settled on the snow, as hoar or water.
    pub deposited: u64,
    /// Ice and water that left as vapour.
    pub sublimated: u64,
    /// Water that ran off.
    pub runoff: u64,
}

impl Exchanged {
    /// Adds what other columns, or other steps, exchanged.
    pub fn add(&mut self, other: Exchanged) {
        self.refused += other.refused;
        self.deposited += other.deposited;
        self.sublimated += other.sublimated;
        self.runoff += other.runoff;
    }
}

impl From<Exchange> for Exchanged {
    fn from(column: Exchange) -> Exchanged {
        Exchanged {
            refused: column.refused.into(),
            deposited: column.deposited.into(),
            sublimated: column.sublimated.into(),
            runoff: column.runoff.into(),
        }
    }
}

/// A column of alpine snow, summed up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColumnTotals {
    /// Mass in quanta: the snow water equivalent.
    pub mass: u32,
    /// Liquid water in mass quanta.
    pub water: u32,
    /// What it has beside its cells.
    pub surface: Surface,
}

impl Snowpack {
    /// Makes it one of alpine snow, all columns of which begin with the same surface.
    #[must_use]
    pub fn with_surfaces(mut self, surface: Surface) -> Snowpack {
        for tile in &mut self.tiles {
            tile.surfaces = vec![surface; tile.columns.len()];
        }
        self
    }

    /// Works out what falls on each column of the short wave on level ground in a step, as a part of it.
    pub fn shade(&mut self, weather: &WeatherStep) {
        let relief = self.relief();
        self.shine = relief.shine(weather);
    }

    /// The surface of the snow above the lowest ground.
    fn relief(&self) -> Relief {
        let Grid { width, depth, .. } = self.grid;
        let grounds = positions(self.grid.all()).map(|(x, z)| {
            let (tile, column) = self.grid.locate(x, z);
            self.tiles[tile as usize].ground[column as usize].0
        });
        let lowest = grounds.min().unwrap_or(0);
        let cells = |x, z| {
            let (tile, column) = self.grid.locate(x, z);
            let Elevation(quanta) = self.tiles[tile as usize].surface(column as usize);
            (quanta - lowest) as f32 / CELL as f32
        };
        let columns = (0..depth).flat_map(|z| (0..width).map(move |x| cells(x, z)));
        Relief { size: [width, depth], elevations: columns.collect() }
    }

    /// Has some rows of tiles take steps of weather, one after another. Where those are steps that shade, it is one,
    /// and [`Snowpack::shade`] has been called for it.
    pub fn weather(&mut self, rows: Range<u32>, steps: &[WeatherStep]) -> Exchanged {
        self.list_loads();
        let (grid, shine) = (self.grid, &self.shine);
        let per_row = grid.tiles_x() as usize;
        let tiles = &mut self.tiles[rows.start as usize * per_row..rows.end as usize * per_row];
        let sums = tiles
            .par_iter_mut()
            .map_init(Scratch::default, |scratch, tile| tile.weather(&grid, steps, shine, scratch));
        sums.reduce(Exchanged::default, |mut one, other| {
            one.add(other);
            one
        })
    }

    /// Sums up the columns of a rectangle, row by row; none where it is no snowpack of alpine snow.
    pub fn column_totals(&self, rect: ColumnRect) -> Vec<ColumnTotals> {
        let totals = positions(rect).filter_map(|(x, z)| {
            let (tile, column) = self.grid.locate(x, z);
            let tile = &self.tiles[tile as usize];
            let surface = *tile.surfaces.get(column as usize)?;
            let cells = &tile.columns[column as usize];
            let water = cells.cells.iter().map(|cell| cell.water()).sum();
            Some(ColumnTotals { mass: cells.mass(), water, surface })
        });
        totals.collect()
    }

    /// What the columns of a tile have beside their cells; nothing where it is no snowpack of alpine snow.
    pub fn surfaces(&self, tile: u32) -> &[Surface] {
        self.tiles.get(tile as usize).map_or(&[], |tile| &tile.surfaces)
    }
}

impl Tile {
    /// Takes steps of weather.
    fn weather(
        &mut self,
        grid: &Grid,
        steps: &[WeatherStep],
        shine: &[f32],
        scratch: &mut Scratch,
    ) -> Exchanged {
        let mut sum = Exchanged::default();
        for (x, z) in positions(self.rect) {
            let index = column_index(x, z);
            let Some(surface) = self.surfaces.get_mut(index) else { continue };
            let column = &mut self.columns[index];
            let sheltered = self.sheltered >> index & 1 == 1;
            for step in steps {
                let place = z as usize * grid.width as usize + x as usize;
                let shine = if step.shades { shine[place] } else { 1.0 };
                let stepped = column.weather(surface, step, grid, shine, sheltered, scratch);
                sum.add(stepped.exchange.into());
            }
            let height = column.height();
            self.dirty |= height != self.heights[index];
            self.heights[index] = height;
        }
        // Under objects the snow has settled or grown soft; elsewhere no cycle changes it.
        self.awake |= self.under_objects;
        (self.moved, self.stale) = (true, true);
        sum
    }
}
