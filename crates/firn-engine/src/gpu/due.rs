//! Lists of tiles for `compact`: one for each page that the device makes, with the arguments of the
//! dispatch that goes through it, and behind those the lists that the host makes.

use super::arena::Arena;
use super::buffer::{Mail, Table};
use super::device::Device;

/// Words of a page's arguments, one for each dimension, and the length of its list.
const HEAD_WORDS: u32 = 4;

/// The lists, and where they begin.
#[derive(Debug)]
pub struct Due {
    /// Heads of all pages, then their lists, then those of the host.
    table: Table,
    /// First word of each page's list.
    firsts: Vec<u32>,
    /// The same, for the device.
    starts: Table,
    /// First word of the host's lists.
    host_lists: u32,
    /// The host's lists, each led by its length, and those that the device has.
    lists: Vec<u32>,
    told: Vec<u32>,
}

impl Due {
    /// No pages yet.
    pub fn new(table: Table, starts: Table) -> Due {
        let (firsts, lists, told) = (Vec::new(), Vec::new(), Vec::new());
        Due { table, firsts, starts, host_lists: 0, lists, told }
    }

    /// The lists.
    pub fn buffer(&self) -> &wgpu::Buffer {
        self.table.buffer()
    }

    /// Where those of the pages begin.
    pub fn starts(&self) -> &wgpu::Buffer {
        self.starts.buffer()
    }

    /// Where the length of a page's list stands.
    pub fn length_of(page: u32) -> u32 {
        page * HEAD_WORDS + HEAD_WORDS - 1
    }

    /// First word of a page's list.
    pub fn first_of(&self, page: u32) -> u32 {
        self.firsts[page as usize]
    }

    /// Byte at which the arguments of a page's dispatch begin.
    pub fn arguments_of(page: u32) -> u64 {
        u64::from(page * HEAD_WORDS) * 4
    }

    /// Makes room for the tiles of every page.
    pub fn fit_to(&mut self, device: &Device, arena: &Arena) {
        // The heads come first, so that they are cleared at once.
        let pages = arena.pages.rows();
        self.host_lists = pages.len() as u32 * HEAD_WORDS;
        self.firsts.clear();
        for rows in pages {
            self.firsts.push(self.host_lists);
            // No tile has less than one row of cells.
            self.host_lists += rows;
        }
        let bytes: &[u8] = bytemuck::cast_slice(&self.firsts);
        self.starts.reserve(&device.device, bytes.len() as u64);
        device.queue.write_buffer(self.starts.buffer(), 0, bytes);
        // A new buffer is all 0, as heads have to be.
        self.table.replace(&device.device);
        self.told.clear();
    }

    /// Adds a list, and returns where its length stands.
    pub fn list(
        &mut self,
        tiles: impl IntoIterator<Item = u32, IntoIter: ExactSizeIterator>,
    ) -> u32 {
        let first = self.host_lists + self.lists.len() as u32;
        let tiles = tiles.into_iter();
        self.lists.push(tiles.len() as u32);
        self.lists.extend(tiles);
        first
    }

    /// Gives the host's lists to the mail, where the device has others, and forgets them. Returns
    /// whether the buffer was replaced.
    pub fn flush(&mut self, device: &wgpu::Device, mail: &mut Mail) -> bool {
        let first = u64::from(self.host_lists) * 4;
        let grew = self.table.reserve(device, first + self.lists.len() as u64 * 4);
        if grew || !self.told.starts_with(&self.lists) {
            mail.write(self.table.buffer(), first, bytemuck::cast_slice(&self.lists));
            std::mem::swap(&mut self.lists, &mut self.told);
        }
        self.lists.clear();
        grew
    }

    /// Clears the lengths of the pages' lists, and the arguments made of them, for the next frame.
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(
            self.table.buffer(),
            0,
            Some(Due::arguments_of(self.firsts.len() as u32)),
        );
    }
}
