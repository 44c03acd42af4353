//! Several tables in one buffer, so that one command serves them all.

use std::ops::Range;

use super::buffer::Table;
use super::device::Device;

/// A multiple of this many bytes is where a section may begin: no device asks for more.
const ALIGNMENT: u64 = 256;

/// Bytes that are rather taken along than left out by another command.
const GAP: u64 = 1 << 12;

/// A buffer with a number of sections, each with room for the most that it has held.
#[derive(Debug)]
pub struct Sections<const N: usize> {
    table: Table,
    room: [u64; N],
}

impl<const N: usize> Sections<N> {
    /// Sections without room.
    pub fn new(table: Table) -> Sections<N> {
        Sections { table, room: [0; N] }
    }

    /// The buffer as it is now.
    pub fn buffer(&self) -> &wgpu::Buffer {
        self.table.buffer()
    }

    /// Bytes of all sections.
    pub fn size(&self) -> u64 {
        self.room.iter().sum()
    }

    /// First byte of a section.
    pub fn start(&self, section: usize) -> u64 {
        self.room[..section].iter().sum()
    }

    /// What a kernel binds of it.
    pub fn binding(&self, section: usize) -> wgpu::BindingResource<'_> {
        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: self.table.buffer(),
            offset: self.start(section),
            size: wgpu::BufferSize::new(self.room[section]),
        })
    }

    /// Makes room for a number of bytes in each section. Returns whether the buffer was replaced for
    /// that: the new one is all 0.
    pub fn reserve(&mut self, device: &Device, sizes: [u64; N]) -> bool {
        let fits = |(room, size): (&u64, &u64)| *room > 0 && size <= room;
        if self.room.iter().zip(&sizes).all(fits) {
            return false;
        }
        let most = device.largest_binding() / ALIGNMENT * ALIGNMENT;
        for (room, size) in self.room.iter_mut().zip(sizes) {
            // A section that can't be bound fails the device, which is told, instead of being cut.
            let ample = size.next_power_of_two().min(most).max(size.next_multiple_of(ALIGNMENT));
            *room = (*room).max(ample).max(ALIGNMENT);
        }
        if !self.table.reserve(&device.device, self.size()) {
            self.table.replace(&device.device);
        }
        true
    }

    /// Where the first bytes of each section are.
    pub fn places(&self, sizes: [u64; N]) -> [Range<u64>; N] {
        std::array::from_fn(|section| {
            let start = self.start(section);
            start..start + sizes[section]
        })
    }
}

/// Ranges that begin where sections do, in ascending order; those with small gaps between them make one.
/// Each ends where a section may begin: copies to and from odd places take longer.
pub fn pieces(ranges: &[Range<u64>]) -> impl Iterator<Item = Range<u64>> + '_ {
    let mut filled = ranges.iter().filter(|range| !range.is_empty()).cloned().peekable();
    std::iter::from_fn(move || {
        let mut piece = filled.next()?;
        while let Some(next) = filled.next_if(|next| next.start - piece.end <= GAP) {
            piece.end = next.end;
        }
        piece.end = piece.end.next_multiple_of(ALIGNMENT);
        Some(piece)
    })
}
