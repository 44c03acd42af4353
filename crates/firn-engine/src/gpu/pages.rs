//! Cells of tiles, in pages that are added as they fill and released when they are empty.

use std::ops::Range;

use firn_snow::TILE_COLUMNS;

use crate::frame::EngineError;

use super::device::Device;
use super::ranges::Ranges;

/// Bytes of one row of 64 cells in one of a page's four buffers.
pub const ROW_BYTES: u64 = 4 * TILE_COLUMNS as u64;

/// Rows of the smallest page.
const SMALLEST_PAGE: u32 = 1 << 15;

/// Cells of some tiles, in four buffers of one element for each cell.
#[derive(Debug)]
pub struct Page {
    rows: Ranges,
    /// Mass, thickness, temperature and stress.
    pub cells: [wgpu::Buffer; 4],
    /// Rows that have never been cleared: the page is not to be bound before.
    pub uncleared: Range<u32>,
}

/// Where a tile's cells are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The page.
    pub page: u32,
    /// First row of 64 cells in it.
    pub row: u32,
}

/// Memory that snowpacks may use \[bytes\].
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    /// All of it.
    pub most: u64,
    /// What is used beside pages.
    pub beside: u64,
}

/// Pages by their numbers; the place of one that was released is free.
#[derive(Debug, Default)]
pub struct Pages {
    pages: Vec<Option<Page>>,
    /// Counts pages that came and went, after which bindings have to be made anew.
    pub generation: u64,
}

impl Pages {
    /// A page, where there is one of that number.
    pub fn get(&self, page: u32) -> Option<&Page> {
        self.pages.get(page as usize)?.as_ref()
    }

    /// A page, where there is one of that number.
    pub fn get_mut(&mut self, page: u32) -> Option<&mut Page> {
        self.pages.get_mut(page as usize)?.as_mut()
    }

    /// Numbers of those that can be bound.
    pub fn cleared(&self) -> impl Iterator<Item = u32> + '_ {
        let cleared = |page: &Page| page.uncleared.is_empty();
        (0..)
            .zip(&self.pages)
            .filter_map(move |(number, page)| page.as_ref().is_some_and(cleared).then_some(number))
    }

    /// Numbers up to that of the last page, with the rows of each; none where there is no page.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = u32> + '_ {
        self.pages.iter().map(|page| page.as_ref().map_or(0, |page| page.rows.capacity()))
    }

    /// The pages there are.
    pub fn iter(&self) -> impl Iterator<Item = &Page> {
        self.pages.iter().flatten()
    }

    /// Bytes of all of them.
    pub fn bytes(&self) -> u64 {
        self.rows().map(page_bytes).sum()
    }

    /// Finds room for the cells of tiles: as many as fit in each page, new pages for the rest.
    ///
    /// # Errors
    /// [`EngineError::OutOfMemory`]; nothing is taken then.
    pub fn take(
        &mut self,
        device: &Device,
        count: u32,
        height: u32,
        budget: Budget,
    ) -> Result<Vec<Place>, EngineError> {
        let mut places = Vec::with_capacity(count as usize);
        while places.len() < count as usize {
            let left = count - places.len() as u32;
            let found = (0..).zip(&mut self.pages).find_map(|(number, page)| {
                let rows = &mut page.as_mut()?.rows;
                let fitting = (rows.longest() / height).min(left);
                if fitting == 0 {
                    return None;
                }
                rows.take(fitting * height).map(|taken| (number, taken))
            });
            if let Some((page, taken)) = found {
                places.extend(taken.step_by(height as usize).map(|row| Place { page, row }));
            } else if let Err(error) = self.add(device, left, height, budget) {
                self.give_back(&places, height);
                return Err(error);
            }
        }
        Ok(places)
    }

    /// Gives the cells of tiles back, and releases the pages that are empty then.
    pub fn give_back(&mut self, places: &[Place], height: u32) {
        for place in places {
            if let Some(page) = &mut self.pages[place.page as usize] {
                page.rows.give_back(place.row..place.row + height);
            }
        }
        for page in &mut self.pages {
            if page.as_ref().is_some_and(|page| page.rows.is_empty()) {
                *page = None;
                self.generation += 1;
            }
        }
    }

    /// Adds a page that holds `tiles` tiles, or as many as one binding does.
    fn add(
        &mut self,
        device: &Device,
        tiles: u32,
        height: u32,
        budget: Budget,
    ) -> Result<(), EngineError> {
        let most = (device.largest_binding() / ROW_BYTES).min(u64::from(u32::MAX / TILE_COLUMNS));
        let needed = (u64::from(tiles) * u64::from(height))
            .min(most / u64::from(height) * u64::from(height));
        // Pages grow with the arena, so that there are few of them to dispatch.
        let held: u64 = self.rows().map(u64::from).sum();
        let ample = held.max(u64::from(SMALLEST_PAGE)).max(needed).min(most);
        let taken = self.bytes() + budget.beside;
        let available = budget.most.saturating_sub(taken) / page_bytes(1);
        let rows = ample.min(available.max(needed));
        if needed > available || rows < u64::from(height) {
            return Err(EngineError::OutOfMemory(format!(
                "{} bytes for cells are needed; {taken} of the {} bytes that may be used are taken",
                page_bytes(needed as u32),
                budget.most
            )));
        }
        let (rows, cells) = match make_cells(device, rows) {
            Ok(cells) => (rows, cells),
            // What is needed may fit where an ample page doesn't.
            Err(_) if rows > needed => (needed, make_cells(device, needed)?),
            Err(error) => return Err(error),
        };
        let rows = rows as u32;
        let page = Some(Page { rows: Ranges::new(rows), cells, uncleared: 0..rows });
        match self.pages.iter_mut().find(|page| page.is_none()) {
            Some(free) => *free = page,
            None => self.pages.push(page),
        }
        self.generation += 1;
        Ok(())
    }
}

impl Page {
    /// Rows that hold no tile.
    pub fn free(&self) -> impl Iterator<Item = Range<u32>> + '_ {
        self.rows.free()
    }
}

/// The four buffers of a page.
fn make_cells(device: &Device, rows: u64) -> Result<[wgpu::Buffer; 4], EngineError> {
    let usage =
        wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
    device.allocate(|| {
        ["mass", "thickness", "temperature", "stress"].map(|label| {
            device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: rows * ROW_BYTES,
                usage,
                mapped_at_creation: false,
            })
        })
    })
}

/// Bytes of the four buffers of a page.
fn page_bytes(rows: u32) -> u64 {
    4 * ROW_BYTES * u64::from(rows)
}

/// Runs of neighbouring places as a page and its rows.
pub fn extents(places: &[Place], height: u32) -> Vec<(u32, Range<u32>)> {
    let mut extents: Vec<(u32, Range<u32>)> = Vec::new();
    for place in places {
        match extents.last_mut() {
            Some((page, rows)) if *page == place.page && rows.end == place.row => {
                rows.end += height;
            }
            _ => extents.push((place.page, place.row..place.row + height)),
        }
    }
    extents
}
