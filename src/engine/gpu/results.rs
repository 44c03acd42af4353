//! What a frame leaves for the host: sections of one buffer, so that mostly one command copies all of
//! it out and one clears what the next frame adds to.

use std::ops::Range;

use super::buffer::Table;
use super::device::Device;
use super::layout;
use super::survey::Totals;
use super::tables::PACKED_BYTES;

/// A multiple of this many bytes is where a section may begin: no device asks for more.
const ALIGNMENT: u64 = 256;

/// Bytes that are rather copied than left out by another command.
const GAP: u64 = 1 << 12;

/// A section of the buffer. Those that kernels add to come first, and in front of them the one that
/// few frames have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// What each operation refused or cleared.
    Operations,
    /// Number of packed tiles.
    PackedCount,
    /// Sums over each snowpack.
    Tallies,
    /// Which tiles are packed.
    PackedGroups,
    /// Heights of the packed tiles.
    Packed,
}

const SECTIONS: usize = 5;

/// Sections that are added to.
const SUMS: usize = 3;

/// The buffer. All sums in it are 0 between frames.
#[derive(Debug)]
pub struct Results {
    table: Table,
    /// Bytes that each section has room for.
    room: [u64; SECTIONS],
}

/// Where the results of one frame are: bytes of the buffer.
#[derive(Clone, Debug)]
pub struct Extent {
    sections: [Range<u64>; SECTIONS],
}

impl Results {
    /// Room for nothing yet.
    pub fn new(table: Table) -> Results {
        Results { table, room: [0; SECTIONS] }
    }

    /// The buffer as it is now.
    pub fn buffer(&self) -> &wgpu::Buffer {
        self.table.buffer()
    }

    /// What a kernel binds of it.
    pub fn binding(&self, section: Section) -> wgpu::BindingResource<'_> {
        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: self.table.buffer(),
            offset: self.start(section),
            size: wgpu::BufferSize::new(self.room[section as usize]),
        })
    }

    /// First byte of a section.
    pub fn start(&self, section: Section) -> u64 {
        self.room[..section as usize].iter().sum()
    }

    /// Makes room for a frame. Returns whether bindings have to be made anew.
    pub fn reserve(&mut self, device: &Device, totals: &Totals) -> bool {
        let sizes = sizes(totals);
        let fits = |(room, size): (&u64, &u64)| *room > 0 && size <= room;
        if self.room.iter().zip(&sizes).all(fits) {
            return false;
        }
        let most = device.largest_binding() / ALIGNMENT * ALIGNMENT;
        for (room, size) in self.room.iter_mut().zip(sizes) {
            *room = (*room).max(size.next_power_of_two().min(most)).max(ALIGNMENT);
        }
        if !self.table.reserve(&device.device, self.room.iter().sum()) {
            // What lies where another section was is no sum: a new buffer is all 0.
            self.table.replace(&device.device);
        }
        true
    }

    /// Where a frame's results are, those of `packed` tiles at the most.
    pub fn extent(&self, totals: &Totals, packed: u64) -> Extent {
        let sizes = sizes(&Totals { tiles: packed, ..totals.clone() });
        let mut next = 0;
        let sections = std::array::from_fn(|section| {
            let start = next;
            next += self.room[section];
            start..start + sizes[section]
        });
        Extent { sections }
    }

    /// Clears the sums of a frame, when they have been copied out.
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder, extent: &Extent) {
        for Range { start, end } in pieces(&extent.sections[..SUMS]) {
            encoder.clear_buffer(self.table.buffer(), start, Some(end - start));
        }
    }
}

impl Extent {
    /// What is copied out, piece by piece.
    pub fn pieces(&self) -> impl Iterator<Item = Range<u64>> + '_ {
        pieces(&self.sections)
    }

    /// Where a section is among the pieces, as if they were one.
    pub fn place(&self, section: Section) -> Range<usize> {
        let wanted = &self.sections[section as usize];
        let mut before = 0;
        for piece in self.pieces() {
            if piece.contains(&wanted.start) && !wanted.is_empty() {
                let start = (before + wanted.start - piece.start) as usize;
                return start..start + (wanted.end - wanted.start) as usize;
            }
            before += piece.end - piece.start;
        }
        0..0
    }
}

/// Sections, those that are not empty, with small gaps between them.
fn pieces(sections: &[Range<u64>]) -> impl Iterator<Item = Range<u64>> + '_ {
    let mut filled = sections.iter().filter(|section| !section.is_empty()).cloned().peekable();
    std::iter::from_fn(move || {
        let mut piece = filled.next()?;
        while let Some(next) = filled.next_if(|next| next.start - piece.end <= GAP) {
            piece.end = next.end;
        }
        Some(piece)
    })
}

/// Bytes of each section in a frame.
fn sizes(totals: &Totals) -> [u64; SECTIONS] {
    fn bytes<T>(count: u64) -> u64 {
        count * std::mem::size_of::<T>() as u64
    }
    [
        bytes::<layout::OperationResult>(totals.edits.into()),
        bytes::<u32>(1),
        bytes::<layout::Tally>(totals.work),
        bytes::<layout::PackedGroup>(totals.groups.len() as u64),
        totals.tiles * PACKED_BYTES,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_near_is_one_piece() {
        let extent = Extent { sections: [0..0, 256..260, 512..5000, 9000..9100, 40_000..50_000] };
        let pieces: Vec<_> = extent.pieces().collect();
        assert_eq!(pieces, [256..9100, 40_000..50_000]);
        assert_eq!(extent.place(Section::Operations), 0..0);
        assert_eq!(extent.place(Section::PackedCount), 0..4);
        assert_eq!(extent.place(Section::Tallies), 256..4744);
        assert_eq!(extent.place(Section::PackedGroups), 8744..8844);
        assert_eq!(extent.place(Section::Packed), 8844..18_844);
    }
}
