//! What a frame leaves for the host: sections of one buffer, so that mostly one command copies all of
//! it out and one clears what the next frame adds to.

use std::ops::Range;

use super::buffer::Table;
use super::device::Device;
use super::kernels::Resource;
use super::layout;
use super::sections::{Sections, pieces};
use super::survey::Totals;
use super::tables::PACKED_BYTES;

/// A section of the buffer. Those that kernels add to come first, and in front of them those that
/// few frames have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// What each operation refused or cleared.
    Operations,
    /// What snowpacks exchange with the weather.
    Exchanges,
    /// Number of packed tiles.
    PackedCount,
    /// Sums over each snowpack.
    Tallies,
    /// Which tiles are packed.
    PackedGroups,
    /// Heights of the packed tiles.
    Packed,
}

const SECTIONS: usize = 6;

/// Sections that are added to.
const SUMS: usize = 4;

/// The buffer. All sums in it are 0 between frames.
#[derive(Debug)]
pub struct Results(Sections<SECTIONS>);

/// Where the results of one frame are: bytes of the buffer.
#[derive(Clone, Debug)]
pub struct Extent([Range<u64>; SECTIONS]);

impl Results {
    /// Room for nothing yet.
    pub fn new(table: Table) -> Results {
        Results(Sections::new(table))
    }

    /// The buffer as it is now.
    pub fn buffer(&self) -> &wgpu::Buffer {
        self.0.buffer()
    }

    /// First byte of a section.
    pub fn start(&self, section: Section) -> u64 {
        self.0.start(section as usize)
    }

    /// What a kernel binds; `None` where it is no result.
    pub fn binding(&self, resource: Resource) -> Option<wgpu::BindingResource<'_>> {
        let section = match resource {
            Resource::OperationResults => Section::Operations,
            Resource::Exchanges => Section::Exchanges,
            Resource::PackedCount => Section::PackedCount,
            Resource::Tallies => Section::Tallies,
            Resource::PackedGroups => Section::PackedGroups,
            Resource::Packed => Section::Packed,
            _ => return None,
        };
        Some(self.0.binding(section as usize))
    }

    /// Makes room for a frame. Returns whether bindings have to be made anew.
    pub fn reserve(&mut self, device: &Device, totals: &Totals) -> bool {
        self.0.reserve(device, sizes(totals, totals.tiles))
    }

    /// Where a frame's results are, those of `packed` tiles at the most.
    pub fn extent(&self, totals: &Totals, packed: u64) -> Extent {
        Extent(self.0.places(sizes(totals, packed)))
    }

    /// Clears the sums of a frame, when they have been copied out.
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder, extent: &Extent) {
        for Range { start, end } in pieces(&extent.0[..SUMS]) {
            encoder.clear_buffer(self.buffer(), start, Some(end - start));
        }
    }
}

impl Extent {
    /// What is copied out, piece by piece.
    pub fn pieces(&self) -> impl Iterator<Item = Range<u64>> + '_ {
        pieces(&self.0)
    }

    /// Where a section is among the pieces, as if they were one.
    pub fn place(&self, section: Section) -> Range<usize> {
        let wanted = &self.0[section as usize];
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

/// Bytes of each section in a frame.
fn sizes(totals: &Totals, packed: u64) -> [u64; SECTIONS] {
    fn bytes<T>(count: u64) -> u64 {
        count * std::mem::size_of::<T>() as u64
    }
    [
        bytes::<layout::OperationResult>(totals.edits.into()),
        bytes::<layout::ExchangeResult>(if totals.weathers { totals.work } else { 0 }),
        bytes::<u32>(1),
        bytes::<layout::Tally>(totals.work),
        bytes::<layout::PackedGroup>(totals.groups.len() as u64),
        packed * PACKED_BYTES,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_near_is_one_piece() {
        let extent = Extent([0..0, 0..0, 256..260, 512..5000, 8960..9060, 40_960..50_960]);
        let pieces: Vec<_> = extent.pieces().collect();
        assert_eq!(pieces, [256..9216, 40_960..51_200]);
        assert_eq!(extent.place(Section::Operations), 0..0);
        assert_eq!(extent.place(Section::PackedCount), 0..4);
        assert_eq!(extent.place(Section::Tallies), 256..4744);
        assert_eq!(extent.place(Section::PackedGroups), 8704..8804);
        assert_eq!(extent.place(Section::Packed), 8960..18_960);
    }
}
