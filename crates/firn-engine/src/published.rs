//! Heights of the tiles that changed, packed as a backend leaves them, so that many snowpacks can
//! take theirs at the same time.

use std::fmt::Debug;
use std::ops::Range;

use firn_snow::TILE_COLUMNS;

/// Tiles that share a group.
const GROUP: u32 = u64::BITS;

/// Column heights of a tile in thickness quanta; 0 outside the grid.
pub type TileColumns = [u32; TILE_COLUMNS as usize];

/// Packed heights, wherever they lie.
pub trait Packed: Debug + Send + Sync {
    /// The heights of one tile after another.
    fn heights(&self) -> &[TileColumns];
}

impl Packed for Vec<TileColumns> {
    #[inline]
    fn heights(&self) -> &[TileColumns] {
        self
    }
}

/// Which of 64 neighbouring tiles changed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Group {
    /// A bit for each tile.
    pub changed: u64,
    /// Where the first of them is packed; the others follow.
    pub first: u32,
}

/// Tiles that changed. A frame numbers the tiles of all its snowpacks; what numbers a snowpack has
/// is in its outcome.
#[derive(Debug)]
pub struct Published {
    /// Number of the first group over all.
    first_group: u32,
    groups: Vec<Group>,
    heights: Box<dyn Packed>,
}

impl Default for Published {
    fn default() -> Self {
        Published { first_group: 0, groups: Vec::new(), heights: Box::new(Vec::new()) }
    }
}

impl Published {
    /// Groups that follow each other, and the heights of their tiles.
    pub fn new(first_group: u32, groups: Vec<Group>, heights: Box<dyn Packed>) -> Published {
        Published { first_group, groups, heights }
    }

    /// Tiles by their numbers, in ascending order.
    pub fn from_tiles(tiles: impl Iterator<Item = (u32, TileColumns)>) -> Published {
        let mut groups: Vec<Group> = Vec::new();
        let mut heights = Vec::new();
        for (number, columns) in tiles {
            let group = (number / GROUP) as usize;
            if groups.len() <= group {
                groups.resize(group + 1, Group { changed: 0, first: heights.len() as u32 });
            }
            groups[group].changed |= 1 << (number % GROUP);
            heights.push(columns);
        }
        Published::new(0, groups, Box::new(heights))
    }

    /// Tiles that changed.
    #[inline]
    pub fn count(&self) -> u32 {
        self.groups.iter().map(|group| group.changed.count_ones()).sum()
    }

    /// The changed ones among some numbers, counted from the first of these, with their heights.
    #[inline]
    pub fn tiles(&self, numbers: Range<u32>) -> impl Iterator<Item = (u32, &TileColumns)> {
        let (heights, first) = (self.heights.heights(), numbers.start);
        (numbers.start / GROUP..numbers.end.div_ceil(GROUP))
            .filter_map(|index| {
                let own = index.checked_sub(self.first_group)?;
                Some((index, self.groups.get(own as usize)?))
            })
            .flat_map(|(index, group)| {
                ones(group.changed).map(move |bit| index * GROUP + bit).zip(group.first..)
            })
            .filter(move |(number, _)| numbers.contains(number))
            .map(move |(number, packed)| (number - first, &heights[packed as usize]))
    }
}

/// Numbers of the bits that are set.
fn ones(mut bits: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let bit = (bits != 0).then(|| bits.trailing_zeros())?;
        bits &= bits - 1;
        Some(bit)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_takes_its_own() {
        let numbers = [0, 5, 63, 64, 130, 131, 200];
        let tiles = numbers.map(|number| (number, [number; 64]));
        let published = Published::from_tiles(tiles.into_iter());
        assert_eq!(published.count(), 7);
        let of = |range: Range<u32>| -> Vec<(u32, u32)> {
            published.tiles(range).map(|(tile, heights)| (tile, heights[63])).collect()
        };
        assert_eq!(of(0..64), [(0, 0), (5, 5), (63, 63)]);
        assert_eq!(of(60..131), [(3, 63), (4, 64), (70, 130)]);
        assert_eq!(of(131..500), [(0, 131), (69, 200)]);
        assert_eq!(of(6..63), []);
    }
}
