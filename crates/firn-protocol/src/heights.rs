//! The binary messages of the height stream, `firn.v1.bin`: an encoder and a decoder.
//! `api/height-stream.md` describes every byte. No I/O.
//!
//! A tile's bytes depend on its heights, the stride and the quantum only, so that one encoding
//! serves all who watch it. The ground is told in tiles of the same layout.

mod bits;
mod decode;
mod encode;

pub use decode::{DecodeError, decode};
pub use encode::{encode, encode_tile};

/// Samples along one side of a tile at stride 1.
const SIDE: u32 = 8;

/// The first byte of a message.
const SNAPSHOT: u8 = 1;
const DELTA: u8 = 2;

/// Multiples that elevations of the ground are told in, of each metre: tenths of a millimetre.
pub const GROUND_STEPS_PER_METRE: f64 = 10_000.0;

/// Flags of a message, its second byte. Bits 4 and 5 hold the stride's logarithm.
const MORE: u8 = 1;
const RESUMED: u8 = 2;
const RECOVERED: u8 = 4;
const COLLIDERS: u8 = 8;
const STRIDE_SHIFT: u32 = 4;
const STRIDE_BITS: u8 = 0b11_0000;
const TERRAIN: u8 = 0x40;
const LEVEL: u8 = 0x80;

/// Flags of a tile, its first byte.
const ROWS: u8 = 1;
const CLIPPED: u8 = 2;

/// A row's code: five bits of width, two of predictor, and whether only some residuals are there.
const WIDTH_BITS: u8 = 0b1_1111;
const PREDICTOR_SHIFT: u32 = 5;
const SPARSE: u8 = 0x80;
/// The width code of 32 bits; lower ones stand for themselves.
const WIDEST: u8 = 31;

/// What a height is guessed from. The residual is what it differs by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Predictor {
    /// The sample before it in its row; of a row's first, the one above.
    Left,
    /// The sample at its place in the row above.
    Above,
    /// Left + above − the one above the left; of a row's first, the one above.
    Slope,
}

impl Predictor {
    const ALL: [Predictor; 3] = [Predictor::Left, Predictor::Above, Predictor::Slope];

    /// The guess for place `x` of a row of which everything before it is known.
    fn guess(self, row: &[u32], above: &[u32], x: usize) -> u32 {
        match (self, x.checked_sub(1)) {
            (Predictor::Above, _) | (_, None) => above[x],
            (Predictor::Left, Some(left)) => row[left],
            (Predictor::Slope, Some(left)) => {
                row[left].wrapping_add(above[x]).wrapping_sub(above[left])
            }
        }
    }
}

/// What begins every message of heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Head {
    /// Whether everything in the region is told, or what changed.
    pub snapshot: bool,
    /// The subscription.
    pub id: i64,
    /// Number of the state that is told. It only grows, and may exceed 32 bits.
    pub seq: u64,
    /// Ticks until that state.
    pub tick: u64,
    /// Whether the client got exactly what it had missed; in the first answer to a subscribe that
    /// asked to resume.
    pub recovered: Option<bool>,
    /// Whether further parts of the message follow.
    pub more: bool,
    /// Whether all ground is level at 0, but what the message tells.
    pub level: bool,
    /// Every how many columns one is told: 1, 2, 4 or 8.
    pub stride: u32,
    /// Tiles in one row of the grid, at least 1.
    pub tiles_x: u32,
}

/// A message of heights.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeightMessage {
    /// What it is about.
    pub head: Head,
    /// The tiles, in ascending order of their places.
    pub runs: Vec<Run>,
    /// Tiles of the ground where it is told, in the same order.
    pub terrain: Vec<Run>,
    /// The colliders where they are told: a JSON array.
    pub colliders: Option<String>,
}

impl HeightMessage {
    /// Every tile told: the column of its first sample along x and along z, and its samples.
    pub fn tiles(&self) -> impl Iterator<Item = (u64, u64, &Tile)> {
        self.placed(&self.runs)
    }

    /// Every tile of ground told, in the same way; [`Tile::elevations`] has its samples.
    pub fn ground(&self) -> impl Iterator<Item = (u64, u64, &Tile)> {
        self.placed(&self.terrain)
    }

    fn placed<'a>(&self, runs: &'a [Run]) -> impl Iterator<Item = (u64, u64, &'a Tile)> + use<'a> {
        let tiles_x = u64::from(self.head.tiles_x.max(1));
        let side = u64::from(SIDE);
        runs.iter().flat_map(move |run| {
            let first = u64::from(run.first);
            (first..first + u64::from(run.count))
                .map(move |tile| (tile % tiles_x * side, tile / tiles_x * side, &run.tile))
        })
    }
}

/// Tiles in succession that are all the same.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Run {
    /// Place of the first: tile row · tiles in a row + tile column.
    pub first: u32,
    /// How many, at least 1.
    pub count: u32,
    /// Their samples.
    pub tile: Tile,
}

/// Heights of a tile, or its ground.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tile {
    /// Samples along x, 1 to 8.
    pub width: u32,
    /// Samples along z, 1 to 8.
    pub depth: u32,
    /// Snow depths in quanta, row by row: index = z · width + x. Of ground, elevations modulo 2³².
    pub heights: Vec<u32>,
}

impl Tile {
    /// Elevations of a tile of ground in tenths of a millimetre, row by row.
    pub fn elevations(&self) -> impl Iterator<Item = i32> {
        self.heights.iter().map(|&height| height.cast_signed())
    }
}

fn zigzag(difference: i32) -> u32 {
    ((difference << 1) ^ (difference >> 31)) as u32
}

fn unzigzag(code: u32) -> i32 {
    (code >> 1) as i32 ^ -((code & 1) as i32)
}

#[cfg(test)]
mod tests;
