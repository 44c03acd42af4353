//! The body of a snapshot, read and checked as it is unpacked.

use std::collections::TryReserveError;
use std::io::Read;

use firn_engine::frame::TileCells;
use firn_engine::reserve::try_filled;
use firn_protocol::SessionSpec;
use firn_snow::{CELL, TILE_COLUMNS};

use crate::core::session::SessionError;
use crate::core::snapshot::{columns, refused};

/// Bytes of what is read first, before more is asked for.
const FIRST_BYTES: usize = 1 << 16;

/// Numbers that are unpacked at a time.
const WORDS_AT_ONCE: u64 = 1 << 16;

/// Reads the body of a snapshot, hashing it on the way.
pub struct Body<'a> {
    reader: zstd::Decoder<'static, std::io::BufReader<&'a [u8]>>,
    hasher: blake3::Hasher,
}

impl<'a> Body<'a> {
    /// Begins with the compressed body of a snapshot.
    pub fn open(compressed: &'a [u8]) -> Result<Body<'a>, SessionError> {
        let reader = zstd::Decoder::new(compressed).map_err(unreadable)?;
        Ok(Body { reader, hasher: blake3::Hasher::new() })
    }

    /// The next bytes. Memory grows with what is really there, not with what is announced.
    pub fn bytes(&mut self, length: u64) -> Result<Vec<u8>, SessionError> {
        let mut bytes = Vec::new();
        while (bytes.len() as u64) < length {
            let more = (length - bytes.len() as u64).min(bytes.len().max(FIRST_BYTES) as u64);
            bytes.try_reserve(more as usize).map_err(no_memory)?;
            let read = self.reader.by_ref().take(more).read_to_end(&mut bytes);
            if (read.map_err(unreadable)? as u64) < more {
                return Err(refused("it is cut short"));
            }
        }
        self.hasher.update(&bytes);
        Ok(bytes)
    }

    /// As many bytes as fit into an array.
    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], SessionError> {
        let bytes = self.bytes(N as u64)?;
        bytes.try_into().map_err(|_| refused("it is cut short"))
    }

    /// The cells of all tiles.
    pub fn tiles(&mut self, spec: &SessionSpec) -> Result<Vec<TileCells>, SessionError> {
        let grid = &spec.grid;
        let counts = self.bytes(grid.columns())?;
        if counts.iter().any(|&count| u32::from(count) > grid.height) {
            return Err(refused("a column has more cells than slots"));
        }
        // No more slots than are filled: a small file makes no large memory.
        let mut tops = try_filled(grid.tiles() as usize, 0).map_err(no_memory)?;
        for ((tile, _), &count) in columns(spec).zip(&counts) {
            tops[tile] = count.max(tops[tile]);
        }
        let mut tiles = Vec::new();
        tiles.try_reserve_exact(tops.len()).map_err(no_memory)?;
        for top in tops {
            tiles.push(TileCells::try_empty(top.into()).map_err(no_memory)?);
        }
        self.plane(spec, &counts, |tile, at, mass| tiles[tile].mass[at] = mass)?;
        self.plane(spec, &counts, |tile, at, thickness| tiles[tile].thickness[at] = thickness)?;
        self.plane(spec, &counts, |tile, at, word| {
            tiles[tile].temperature[at] = f32::from_bits(word);
        })?;
        self.plane(spec, &counts, |tile, at, word| tiles[tile].stress[at] = f32::from_bits(word))?;
        let celsius = -40.0..=0.0;
        // A thousandth, and two quanta, for what is rounded.
        let densest = grid.cell_size * spec.material.max_density / 64.0 * 1.001;
        let is_sound = |tile: &TileCells, at: usize| {
            let (mass, thickness) = (f64::from(tile.mass[at]), tile.thickness[at]);
            mass > 0.0
                && mass <= f64::from(thickness) * densest + 2.0
                && (1..=CELL).contains(&thickness)
                && celsius.contains(&tile.temperature[at])
                && tile.stress[at].is_finite()
        };
        let mut all = columns(spec).zip(&counts);
        if !all.all(|((tile, column), &count)| {
            places(column, count).all(|at| is_sound(&tiles[tile], at))
        }) {
            return Err(refused("a cell is not what a server would have saved"));
        }
        Ok(tiles)
    }

    /// Reads a number of every cell, column by column, and puts each where it belongs.
    fn plane(
        &mut self,
        spec: &SessionSpec,
        counts: &[u8],
        mut put: impl FnMut(usize, usize, u32),
    ) -> Result<(), SessionError> {
        let mut cells = columns(spec)
            .zip(counts)
            .flat_map(|((tile, column), &count)| places(column, count).map(move |at| (tile, at)));
        let mut left: u64 = counts.iter().map(|&count| u64::from(count)).sum();
        while left > 0 {
            let part = left.min(WORDS_AT_ONCE);
            let bytes = self.bytes(4 * part)?;
            for (word, (tile, at)) in bytes.chunks_exact(4).zip(&mut cells) {
                put(tile, at, u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
            }
            left -= part;
        }
        Ok(())
    }

    /// Makes sure that nothing is left over, and that everything is as it was saved.
    pub fn finish(mut self, digest: &[u8]) -> Result<(), SessionError> {
        let mut rest = [0];
        if self.reader.read(&mut rest).map_err(unreadable)? > 0 {
            return Err(refused("something follows its end"));
        }
        if self.hasher.finalize().as_bytes() != digest {
            return Err(refused("it is damaged: its digest is another"));
        }
        Ok(())
    }
}

/// Where the cells of a column are in its tile.
fn places(column: u32, count: u8) -> impl Iterator<Item = usize> {
    (0..usize::from(count)).map(move |slot| slot * TILE_COLUMNS as usize + column as usize)
}

fn no_memory(error: TryReserveError) -> SessionError {
    SessionError::NoMemory(format!("there is no memory to unpack the snapshot: {error}"))
}

fn unreadable(error: std::io::Error) -> SessionError {
    refused(&format!("it is damaged: {error}"))
}
