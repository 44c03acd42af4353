//! Tiles of heights and of the ground, as JSON or bytes. No I/O.

use std::io::Write;

use firn_protocol::heights;
use firn_protocol::stream::SubProtocol;
use firn_snow::{Grid, TILE_COLUMNS};

use crate::session::{Ground, TileColumns};

use super::quantum::Quantum;

/// How a subscription wants its tiles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// The session's grid.
    pub grid: Grid,
    /// Every how many columns one is sent: 1, 2, 4 or 8.
    pub stride: u32,
    /// Step that heights are rounded to.
    pub quantum: Quantum,
    /// How they are written.
    pub protocol: SubProtocol,
}

impl Sampling {
    /// A tile's bytes in the sub-protocol: the heights of its columns inside the grid.
    pub fn encode_tile(&self, tile: u32, heights: &TileColumns) -> Vec<u8> {
        self.encode(tile, &self.quantum, |x, z| {
            let height = heights[self.grid.locate(x, z).1 as usize];
            self.grid.metres(u64::from(height))
        })
    }

    /// The bytes of the ground under a tile, in the same way.
    pub fn encode_ground(&self, tile: u32, ground: &Ground) -> Vec<u8> {
        self.encode(tile, &Quantum::OF_GROUND, |x, z| ground.height(&self.grid, x, z))
    }

    fn encode(&self, tile: u32, quantum: &Quantum, metres: impl Fn(u32, u32) -> f64) -> Vec<u8> {
        let rect = self.grid.tile_rect(tile);
        let [width, depth] =
            [rect.x1 - rect.x0, rect.z1 - rect.z0].map(|columns| columns.div_ceil(self.stride));
        let rows = (rect.z0..rect.z1).step_by(self.stride as usize);
        let steps = rows.flat_map(|z| {
            let row = (rect.x0..rect.x1).step_by(self.stride as usize);
            row.map(move |x| (x, z))
        });
        let steps = steps.map(|(x, z)| quantum.steps(metres(x, z)));
        match self.protocol {
            SubProtocol::Json => {
                let corner = (rect.x0, rect.z0);
                write_tile(corner, (width, depth), steps, quantum)
            }
            SubProtocol::Binary => {
                let mut samples = [0; TILE_COLUMNS as usize];
                for (sample, steps) in samples.iter_mut().zip(steps) {
                    // Those of ground may lie below 0: they are told modulo 2³².
                    *sample = steps.min(u32::MAX.into()) as u32;
                }
                let count = (width * depth) as usize;
                heights::encode_tile(width, depth, self.stride, &samples[..count])
            }
        }
    }
}

/// A tile as a JSON object.
fn write_tile(
    (x, z): (u32, u32),
    (width, depth): (u32, u32),
    steps: impl Iterator<Item = i64>,
    quantum: &Quantum,
) -> Vec<u8> {
    let mut out = Vec::new();
    write!(out, r#"{{"column_x":{x},"column_z":{z},"width":{width},"depth":{depth},"heights":["#)
        .expect("writing to memory does not fail");
    for steps in steps {
        quantum.write(steps, &mut out);
        out.push(b',');
    }
    out.pop();
    out.extend_from_slice(b"]}");
    out
}

#[cfg(test)]
mod tests;
