//! The body of a snapshot, read and checked as it is unpacked.

use std::io::Read;

use crate::engine::frame::TileCells;
use crate::session::error::SessionError;
use crate::session::spec::SessionSpec;
use crate::snow::{CELL, TILE_COLUMNS};

use super::{columns, refused};

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
        self.reader.by_ref().take(length).read_to_end(&mut bytes).map_err(unreadable)?;
        if (bytes.len() as u64) < length {
            return Err(refused("it is cut short"));
        }
        self.hasher.update(&bytes);
        Ok(bytes)
    }

    /// As many bytes as fit into an array.
    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], SessionError> {
        let bytes = self.bytes(N as u64)?;
        bytes.try_into().map_err(|_| refused("it is cut short"))
    }

    fn words(&mut self, count: u64) -> Result<Vec<u32>, SessionError> {
        let bytes = self.bytes(count * 4)?;
        let word = |b: &[u8]| u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        Ok(bytes.chunks_exact(4).map(word).collect())
    }

    /// The cells of all tiles.
    pub fn tiles(&mut self, spec: &SessionSpec) -> Result<Vec<TileCells>, SessionError> {
        let grid = &spec.grid;
        let counts = self.bytes(grid.columns())?;
        if counts.iter().any(|&count| u32::from(count) > grid.height) {
            return Err(refused("a column has more cells than slots"));
        }
        let total = counts.iter().map(|&count| u64::from(count)).sum();
        let (mass, thickness) = (self.words(total)?, self.words(total)?);
        let (temperature, stress) = (self.words(total)?, self.words(total)?);
        let celsius = -40.0..=0.0;
        // A thousandth, and two quanta, for what is rounded.
        let densest = grid.cell_size * spec.material.max_density / 64.0 * 1.001;
        let light = |(&mass, &d): (&u32, &u32)| f64::from(mass) <= f64::from(d) * densest + 2.0;
        let sound = mass.iter().all(|&mass| mass > 0)
            && mass.iter().zip(&thickness).all(light)
            && thickness.iter().all(|&d| (1..=CELL).contains(&d))
            && temperature.iter().all(|&t| celsius.contains(&f32::from_bits(t)))
            && stress.iter().all(|&s| f32::from_bits(s).is_finite());
        if !sound {
            return Err(refused("a cell is not what a server would have saved"));
        }
        // No more slots than are filled: a small file makes no large memory.
        let mut tops = vec![0; grid.tiles() as usize];
        for ((tile, _), &count) in columns(spec).zip(&counts) {
            tops[tile] = count.max(tops[tile]);
        }
        let mut tiles: Vec<TileCells> =
            tops.into_iter().map(|top| TileCells::empty(top.into())).collect();
        let mut next = 0;
        for ((tile, column), count) in columns(spec).zip(counts) {
            let tile = &mut tiles[tile];
            for slot in 0..usize::from(count) {
                let to = slot * TILE_COLUMNS as usize + column as usize;
                tile.mass[to] = mass[next];
                tile.thickness[to] = thickness[next];
                tile.temperature[to] = f32::from_bits(temperature[next]);
                tile.stress[to] = f32::from_bits(stress[next]);
                next += 1;
            }
        }
        Ok(tiles)
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

fn unreadable(error: std::io::Error) -> SessionError {
    refused(&format!("it is damaged: {error}"))
}
