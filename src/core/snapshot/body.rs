//! The body of a snapshot, read and checked as it is unpacked.

use std::collections::TryReserveError;
use std::io::Read;

use firn_engine::frame::TileCells;
use firn_engine::reserve::try_filled;
use firn_protocol::{Physics, SessionSpec};
use firn_snow::alpine::{ICE_DENSITY, Surface, WATER_DENSITY};
use firn_snow::{CELL, Cell, TILE_COLUMNS};

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
        let is_sound = |tile: &TileCells, at: usize| is_sound(spec, &tile.cell(at));
        let mut all = columns(spec).zip(&counts);
        if !all.all(|((tile, column), &count)| {
            places(column, count).all(|at| is_sound(&tiles[tile], at))
        }) {
            return Err(refused("a cell is not what a server would have saved"));
        }
        if spec.physics == Physics::Alpine {
            self.surfaces(spec, &mut tiles)?;
        }
        Ok(tiles)
    }

    /// What each column of alpine snow has beside its cells.
    fn surfaces(
        &mut self,
        spec: &SessionSpec,
        tiles: &mut [TileCells],
    ) -> Result<(), SessionError> {
        for tile in tiles.iter_mut() {
            let bare = Surface { albedo: 0.0, skin: 0.0, soil: [0.0; 4], runoff: 0 };
            tile.surfaces = try_filled(TILE_COLUMNS as usize, bare).map_err(no_memory)?;
        }
        let mut all = columns(spec);
        let mut left = spec.grid.columns();
        while left > 0 {
            let part = left.min(WORDS_AT_ONCE);
            let bytes = self.bytes(32 * part)?;
            for (bytes, (tile, column)) in bytes.as_chunks::<32>().0.iter().zip(&mut all) {
                let surface = surface(bytes);
                if !is_sound_surface(&surface) {
                    return Err(refused("a surface is not what a server would have saved"));
                }
                tiles[tile].surfaces[column as usize] = surface;
            }
            left -= part;
        }
        Ok(())
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

/// Whether a cell is one that a server would have saved.
fn is_sound(spec: &SessionSpec, cell: &Cell) -> bool {
    // A thousandth, and two quanta, for what is rounded.
    let most = |density: f64| {
        f64::from(cell.thickness) * spec.grid.cell_size * density / 64.0 * 1.001 + 2.0
    };
    let heats = match spec.physics {
        Physics::Thesis => {
            f64::from(cell.mass) <= most(spec.material.max_density)
                && (-40.0..=0.0).contains(&cell.temperature)
        }
        // Its word says whether it is wet.
        Physics::Alpine => {
            let cold = (-100.0..=0.0).contains(&cell.temperature);
            let wet = cell.temperature >= 2.0 && cell.water() <= cell.mass;
            (cold || wet) && {
                let room = f64::from(cell.ice()) / most(f64::from(ICE_DENSITY))
                    + f64::from(cell.water()) / most(f64::from(WATER_DENSITY));
                room <= 1.0
            }
        }
    };
    cell.mass > 0 && (1..=CELL).contains(&cell.thickness) && heats && cell.stress.is_finite()
}

/// What is written of a column beside its cells.
fn surface(bytes: &[u8; 32]) -> Surface {
    let word = |at: usize| {
        let at = 4 * at;
        [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]
    };
    let number = |at: usize| f32::from_le_bytes(word(at));
    let [low, high] = [6, 7].map(|at| u64::from(u32::from_le_bytes(word(at))));
    Surface {
        albedo: number(0),
        skin: number(1),
        soil: [2, 3, 4, 5].map(number),
        runoff: low | high << 32,
    }
}

fn is_sound_surface(surface: &Surface) -> bool {
    let earthly = |celsius: &f32| (-150.0..=150.0).contains(celsius);
    (0.0..=1.0).contains(&surface.albedo)
        && earthly(&surface.skin)
        && surface.soil.iter().all(earthly)
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
