//! Prints that loads press into a snowpack, many at a time.

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use crate::column::{Printer, SurfaceLoad};
use crate::coverage::Coverage;
use crate::grid::ColumnRect;

use super::Snowpack;
use super::tile::Tile;

/// Tiles that one thread takes at the least.
const TILES_AT_ONCE: usize = 16;

impl Snowpack {
    /// Presses those of a rectangle's columns that outlines cover at once, each by its share of the way to where it
    /// carries the load. Where outlines overlap, a later one finds the snow that the earlier one left. Returns the
    /// largest dent of each in quanta.
    pub fn stamp(&mut self, rect: ColumnRect, stamps: &[(&Coverage, SurfaceLoad)]) -> Vec<u32> {
        let touched = self.touched(rect, stamps);
        let mut jobs: Vec<(&mut Tile, &[(u32, u32)])> = Vec::new();
        let (mut tiles, mut next) = (self.tiles.iter_mut(), 0);
        for list in touched.chunk_by(|a, b| a.0 == b.0) {
            let skipped = (list[0].0 - next) as usize;
            next = list[0].0 + 1;
            jobs.extend(tiles.nth(skipped).map(|tile| (tile, list)));
        }
        let (grid, material) = (&self.grid, &self.material);
        let dents: Vec<AtomicU32> = stamps.iter().map(|_| AtomicU32::new(0)).collect();
        // Tiles have nothing to do with each other, and the largest is the largest in any order.
        jobs.into_par_iter().with_min_len(TILES_AT_ONCE).for_each_init(
            || Printer::new(grid, material),
            |printer, (tile, list)| {
                for &(_, index) in list {
                    let (coverage, load) = stamps[index as usize];
                    let Some(part) = coverage.columns.overlap(&rect) else { continue };
                    let edited = tile.edit(part, 0, |column, (x, z)| match coverage.share(x, z) {
                        0 => 0,
                        share => printer.press(column, load, share),
                    });
                    dents[index as usize].fetch_max(edited.largest, Ordering::Relaxed);
                }
            },
        );
        dents.into_iter().map(AtomicU32::into_inner).collect()
    }

    /// The tiles that stamps touch in a rectangle, in ascending order, each with the numbers of those that touch it.
    fn touched(&self, rect: ColumnRect, stamps: &[(&Coverage, SurfaceLoad)]) -> Vec<(u32, u32)> {
        let width = self.grid.tiles_x();
        let mut touched = Vec::new();
        for (index, (coverage, _)) in (0..).zip(stamps) {
            let Some(part) = coverage.columns.overlap(&rect) else { continue };
            let tiles = part.tiles();
            let rows = tiles.z0..tiles.z1;
            touched.extend(
                rows.flat_map(|z| (tiles.x0..tiles.x1).map(move |x| (z * width + x, index))),
            );
        }
        touched.sort_unstable();
        touched
    }
}
