//! What a frame leaves for the host beside heights: sections of one buffer, so that one command clears
//! them and one copies them out.

use std::ops::Range;

use super::buffer::Table;
use super::device::Device;
use super::layout;
use super::survey::Totals;

/// A multiple of this many bytes is where a section may begin: no device asks for more.
const ALIGNMENT: u64 = 256;

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
}

const SECTIONS: usize = 4;

/// The buffer.
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
            offset: self.start(section as usize),
            size: wgpu::BufferSize::new(self.room[section as usize]),
        })
    }

    fn start(&self, section: usize) -> u64 {
        self.room[..section].iter().sum()
    }

    /// Makes room for a frame. Returns whether bindings have to be made anew.
    pub fn reserve(&mut self, device: &Device, totals: &Totals) -> bool {
        let sizes = sizes(totals);
        let fits = |(room, size): (&u64, &u64)| *room > 0 && size <= room;
        if self.room.iter().zip(&sizes).all(fits) {
            return false;
        }
        for (room, size) in self.room.iter_mut().zip(sizes) {
            *room = (*room).max(size.next_power_of_two()).max(ALIGNMENT);
        }
        self.table.reserve(&device.device, self.start(SECTIONS));
        true
    }

    /// Where a frame's results are.
    pub fn extent(&self, totals: &Totals) -> Extent {
        let sizes = sizes(totals);
        let sections = std::array::from_fn(|section| {
            let start = self.start(section);
            start..start + sizes[section]
        });
        Extent { sections }
    }

    /// Clears what kernels add to.
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder, totals: &Totals) {
        let used = self.extent(totals).used();
        let end = self.start(Section::PackedGroups as usize);
        let bytes = used.end.min(end) - used.start;
        encoder.clear_buffer(self.table.buffer(), used.start, Some(bytes));
    }
}

impl Extent {
    /// The bytes from the first section that the frame has to the last.
    pub fn used(&self) -> Range<u64> {
        let mut used = self.sections.iter().filter(|section| !section.is_empty());
        let Some(first) = used.next() else { return 0..0 };
        first.start..used.next_back().unwrap_or(first).end
    }

    /// A section, counted from the first byte that the frame uses.
    pub fn section(&self, section: Section) -> Range<usize> {
        let first = self.used().start;
        let Range { start, end } = self.sections[section as usize];
        if start == end {
            return 0..0;
        }
        (start - first) as usize..(end - first) as usize
    }
}

/// Bytes of each section in a frame.
fn sizes(totals: &Totals) -> [u64; SECTIONS] {
    fn bytes<T>(count: u64) -> u64 {
        count * std::mem::size_of::<T>() as u64
    }
    let groups = totals.groups.len() as u64;
    [
        bytes::<layout::OperationResult>(totals.edits.into()),
        bytes::<u32>(1),
        bytes::<layout::Tally>(totals.work),
        bytes::<layout::PackedGroup>(groups),
    ]
}
