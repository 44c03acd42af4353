//! Memory made that of an empty snowpack, whatever was there before: a little of it at a time, because
//! gigabytes take longer than a frame may.

use std::ops::Range;

use firn_snow::TILE_COLUMNS;

use super::arena::{Arena, Lot, TILE_BYTES};
use super::device::Device;
use super::kernels::Resource;
use super::layout::DIRTY;
use super::pages::{ROW_BYTES, extents};
use super::resident::Resident;

/// Units of a row of cells.
const ROW: u64 = TILE_COLUMNS as u64;

/// Units of a tile's rows in the tables.
const TILE: u64 = 5 * ROW;

/// What is left to be furnished of a snowpack.
#[derive(Debug)]
pub struct Unfurnished {
    /// Rows of pages that somebody has had before, and which are still to be cleared.
    used: Vec<(u32, Range<u32>)>,
    /// Pages that nobody has had: all of such a page is cleared before it is bound for the first time.
    new: Vec<u32>,
    /// The first tile whose rows in the tables are still to be written.
    tile: u32,
}

impl Arena {
    /// What is to be furnished for a snowpack.
    pub fn begin_to_furnish(&self, lot: &Lot) -> Unfurnished {
        let is_new =
            |page: u32| self.pages.get(page).is_some_and(|page| !page.uncleared.is_empty());
        let (new, used): (Vec<_>, Vec<_>) =
            extents(&lot.places, lot.height).into_iter().partition(|(page, _)| is_new(*page));
        let mut new: Vec<u32> = new.into_iter().map(|(page, _)| page).collect();
        new.dedup();
        Unfurnished { used, new, tile: 0 }
    }

    /// Units that it takes.
    pub fn units_to_furnish(&self, lot: &Lot, unfurnished: &Unfurnished) -> u64 {
        let pages = unfurnished.new.iter().filter_map(|&page| self.pages.get(page));
        let rows = pages.map(|page| page.uncleared.len()).sum::<usize>()
            + unfurnished.used.iter().map(|(_, rows)| rows.len()).sum::<usize>();
        rows as u64 * ROW + lot.places.len() as u64 * TILE
    }

    /// Furnishes a part of a snowpack's memory, about so many units of it, ahead of the next submit. Returns
    /// how many it was.
    pub fn furnish(&mut self, device: &Device, resident: &mut Resident, most: u64) -> u64 {
        let Resident { lot, layout, unfurnished, .. } = resident;
        let Some(left) = unfurnished else { return 0 };
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut units = 0;
        let rows_left = |units: u64| (most.saturating_sub(units) / ROW).max(1);
        while units < most
            && let Some(&number) = left.new.last()
        {
            let Some(page) = self.pages.get_mut(number) else { break };
            let rows = next(&mut page.uncleared, rows_left(units));
            page.clear(&mut encoder, &rows);
            units += rows.len() as u64 * ROW;
            if page.uncleared.is_empty() {
                left.new.pop();
            }
        }
        while units < most
            && let Some((number, uncleared)) = left.used.last_mut()
        {
            let rows = next(uncleared, rows_left(units));
            if let Some(page) = self.pages.get(*number) {
                page.clear(&mut encoder, &rows);
            }
            units += rows.len() as u64 * ROW;
            if uncleared.start == uncleared.end {
                left.used.pop();
            }
        }
        if units < most {
            let mut tiles = left.tile..lot.places.len() as u32;
            let part = next(&mut tiles, (most - units) / TILE + 1);
            self.clear_tables(&mut encoder, lot, &part);
            device.queue.submit([encoder.finish()]);
            let states = vec![DIRTY; part.len()];
            self.write(device, Resource::States, lot.tiles.start + part.start, &states);
            if !layout.ground.is_empty() {
                self.write_ground(device, lot, part.clone(), &layout.grid, &layout.ground);
            }
            units += part.len() as u64 * TILE;
            left.tile = part.end;
        } else {
            device.queue.submit([encoder.finish()]);
        }
        if left.new.is_empty() && left.used.is_empty() && left.tile as usize == lot.places.len() {
            *unfurnished = None;
        }
        units
    }

    fn clear_tables(&self, encoder: &mut wgpu::CommandEncoder, lot: &Lot, tiles: &Range<u32>) {
        let (first, count) = (u64::from(lot.tiles.start + tiles.start), tiles.len() as u64);
        for ((resource, table), bytes) in self.tables.iter().zip(TILE_BYTES) {
            if *resource != Resource::Tiles && count > 0 {
                encoder.clear_buffer(table.buffer(), first * bytes, Some(count * bytes));
            }
        }
    }
}

/// Takes the next rows off a range, as many as it says at the most.
fn next(left: &mut Range<u32>, most: u64) -> Range<u32> {
    let count = u32::try_from(most).unwrap_or(u32::MAX);
    let end = left.start.saturating_add(count).min(left.end);
    let part = left.start..end;
    left.start = end;
    part
}

impl super::pages::Page {
    /// Clears some of its rows.
    fn clear(&self, encoder: &mut wgpu::CommandEncoder, rows: &Range<u32>) {
        if rows.is_empty() {
            return;
        }
        let (first, count) = (u64::from(rows.start), rows.len() as u64);
        for cells in &self.cells {
            encoder.clear_buffer(cells, first * ROW_BYTES, Some(count * ROW_BYTES));
        }
    }
}
