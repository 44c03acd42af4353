//! Heights and colliders as JSON or bytes: tiles, and messages cut into parts. No I/O.

use std::io::Write;

use axum::body::Bytes;
use axum::extract::ws::Message;
use firn_protocol::stream::SubProtocol;
use firn_protocol::{ColliderView, Stamp, heights};
use firn_snow::{ColumnRect, Grid, TILE_COLUMNS};

use crate::budget::Reservation;
use crate::session::TileColumns;

use super::quantum::Quantum;

/// Largest message to a client \[bytes\]; what is longer is sent in parts.
pub const LARGEST_PART: usize = 1 << 20;

/// Room for what ends a part: closing brackets and `more`.
const TAIL: usize = 64;

/// Most bytes of what begins a binary part, and of what stands before each of its tiles.
const BINARY_HEAD: usize = 64;
const BINARY_RUN: usize = 16;

/// Memory that a message of so many tiles and objects takes at the most until it is written: their bytes,
/// and those of the part under way.
pub fn most_bytes(protocol: SubProtocol, tiles: usize, objects: usize) -> u64 {
    let tile = match protocol {
        SubProtocol::Json => 704,
        SubProtocol::Binary => 320,
    };
    let bytes = tiles * tile + objects * 512;
    (bytes + bytes.min(LARGEST_PART)) as u64
}

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
    /// A tile's bytes in the sub-protocol: the samples of its columns inside the grid.
    pub fn encode_tile(&self, tile: u32, heights: &TileColumns) -> Vec<u8> {
        match self.protocol {
            SubProtocol::Json => {
                let mut out = Vec::new();
                self.write_tile(tile, heights, &mut out);
                out
            }
            SubProtocol::Binary => self.pack_tile(tile, heights),
        }
    }

    fn pack_tile(&self, tile: u32, heights: &TileColumns) -> Vec<u8> {
        let rect = self.grid.tile_rect(tile);
        let mut samples = [0; TILE_COLUMNS as usize];
        let mut count = 0;
        for z in (rect.z0..rect.z1).step_by(self.stride as usize) {
            for x in (rect.x0..rect.x1).step_by(self.stride as usize) {
                let height = heights[self.grid.locate(x, z).1 as usize];
                let steps = self.quantum.steps(self.grid.metres(u64::from(height)));
                samples[count] = u32::try_from(steps).unwrap_or(u32::MAX);
                count += 1;
            }
        }
        let [width, depth] =
            [rect.x1 - rect.x0, rect.z1 - rect.z0].map(|columns| columns.div_ceil(self.stride));
        heights::encode_tile(width, depth, self.stride, &samples[..count])
    }

    /// Writes a tile as a JSON object.
    fn write_tile(&self, tile: u32, heights: &TileColumns, out: &mut Vec<u8>) {
        let rect = self.grid.tile_rect(tile);
        let samples = |from: u32, to: u32| (to - from).div_ceil(self.stride);
        text(
            out,
            format_args!(
                r#"{{"column_x":{},"column_z":{},"width":{},"depth":{},"heights":["#,
                rect.x0,
                rect.z0,
                samples(rect.x0, rect.x1),
                samples(rect.z0, rect.z1)
            ),
        );
        for z in (rect.z0..rect.z1).step_by(self.stride as usize) {
            for x in (rect.x0..rect.x1).step_by(self.stride as usize) {
                let height = heights[self.grid.locate(x, z).1 as usize];
                self.quantum.write(self.quantum.steps(self.grid.metres(u64::from(height))), out);
                out.push(b',');
            }
        }
        out.pop();
        out.extend_from_slice(b"]}");
    }
}

/// Whether an object's bounding box meets a rectangle of columns.
pub fn meets(collider: &ColliderView, columns: &ColumnRect, grid: &Grid) -> bool {
    let (low, high) = collider.object.bounds();
    let overlaps = |low: f64, high: f64, from: u32, to: u32| {
        high > f64::from(from) * grid.cell_size && low < f64::from(to) * grid.cell_size
    };
    overlaps(low.x, high.x, columns.x0, columns.x1)
        && overlaps(low.z, high.z, columns.z0, columns.z1)
}

/// What begins every part of a message.
#[derive(Clone, Copy, Debug)]
pub struct Head {
    /// Whether it is a snapshot or a delta.
    pub snapshot: bool,
    /// The subscription.
    pub id: i64,
    /// When this holds.
    pub stamp: Stamp,
    /// Whether the client was given exactly what it missed, where it asked for that.
    pub recovered: Option<bool>,
}

/// A message, written part by part as the client takes them.
#[derive(Debug)]
pub struct Parts {
    head: Head,
    sampling: Sampling,
    /// Tiles still to be written, each with its bytes, the next one last.
    tiles: Vec<(u32, Bytes)>,
    /// Colliders still to be written, each as JSON, the next one last.
    colliders: Option<Vec<Vec<u8>>>,
    largest: usize,
    first: bool,
    done: bool,
    /// What is counted of its memory.
    _memory: Option<Reservation>,
}

impl Parts {
    /// A message of tiles and, where they are to be told, colliders.
    pub fn new(
        head: Head,
        sampling: Sampling,
        mut tiles: Vec<(u32, Bytes)>,
        mut colliders: Option<Vec<Vec<u8>>>,
    ) -> Parts {
        tiles.reverse();
        if let Some(colliders) = &mut colliders {
            colliders.reverse();
        }
        Parts {
            head,
            sampling,
            tiles,
            colliders,
            largest: LARGEST_PART,
            first: true,
            done: false,
            _memory: None,
        }
    }

    /// With memory that is given back when it has been written.
    pub fn holding(self, memory: Option<Reservation>) -> Parts {
        Parts { _memory: memory, ..self }
    }

    fn write_head(&mut self, out: &mut Vec<u8>) {
        let Head { snapshot, id, stamp, recovered } = self.head;
        let Stamp { tick, seq } = stamp;
        let op = if snapshot { "snapshot" } else { "delta" };
        text(out, format_args!(r#"{{"op":"{op}","id":{id},"seq":{seq},"tick":{tick}"#));
        if let (true, Some(recovered)) = (self.first, recovered) {
            text(out, format_args!(r#","recovered":{recovered}"#));
        }
        self.first = false;
    }

    fn write_tiles(&mut self, out: &mut Vec<u8>) {
        out.extend_from_slice(br#","tiles":["#);
        let begin = out.len();
        while let Some((_, bytes)) = self.tiles.last() {
            if out.len() > begin {
                if out.len() + 1 + bytes.len() + TAIL > self.largest {
                    break;
                }
                out.push(b',');
            }
            out.extend_from_slice(bytes);
            self.tiles.pop();
        }
        out.push(b']');
    }

    /// Writes as many colliders as there is room for. Returns whether that was all.
    fn write_colliders(&mut self, out: &mut Vec<u8>, empty: bool) -> bool {
        let Some(colliders) = &mut self.colliders else { return true };
        let key = match self.sampling.protocol {
            SubProtocol::Json => &br#","colliders":["#[..],
            SubProtocol::Binary => &b"["[..],
        };
        let (largest, before) = (self.largest, key.len() + TAIL);
        let fits = |out: &Vec<u8>, next: &[u8]| out.len() + before + next.len() <= largest;
        if colliders.last().is_some_and(|next| !empty && !fits(out, next)) {
            return false;
        }
        out.extend_from_slice(key);
        let begin = out.len();
        while let Some(next) = colliders.last() {
            if out.len() > begin {
                if !fits(out, next) {
                    break;
                }
                out.push(b',');
            }
            out.extend_from_slice(next);
            colliders.pop();
        }
        out.push(b']');
        colliders.is_empty()
    }

    fn next_text(&mut self) -> Vec<u8> {
        let mut out = Vec::new();
        self.write_head(&mut out);
        let empty = self.tiles.is_empty();
        self.write_tiles(&mut out);
        self.done = self.tiles.is_empty() && self.write_colliders(&mut out, empty);
        if !self.done {
            out.extend_from_slice(br#","more":true"#);
        }
        out.push(b'}');
        out
    }

    fn next_binary(&mut self) -> Vec<u8> {
        let empty = self.tiles.is_empty();
        let mut tiles = Vec::new();
        let mut size = BINARY_HEAD;
        while let Some((_, bytes)) = self.tiles.last() {
            let next = size + BINARY_RUN + bytes.len();
            if next > self.largest && !tiles.is_empty() {
                break;
            }
            size = next;
            tiles.extend(self.tiles.pop());
        }
        let mut colliders = vec![0; size];
        let told = self.tiles.is_empty() && self.colliders.is_some();
        self.done = self.tiles.is_empty() && self.write_colliders(&mut colliders, empty);
        // Nothing was written where there was no room for the first.
        let colliders = (told && colliders.len() > size).then(|| &colliders[size..]);
        let Head { snapshot, id, stamp, recovered } = self.head;
        let head = heights::Head {
            snapshot,
            id,
            seq: stamp.seq,
            tick: stamp.tick,
            recovered: recovered.filter(|_| std::mem::take(&mut self.first)),
            more: !self.done,
            stride: self.sampling.stride,
            tiles_x: self.sampling.grid.tiles_x(),
        };
        heights::encode(&head, &tiles, colliders)
    }
}

impl Iterator for Parts {
    type Item = Message;

    fn next(&mut self) -> Option<Message> {
        if self.done {
            return None;
        }
        Some(match self.sampling.protocol {
            SubProtocol::Json => {
                let text = String::from_utf8(self.next_text()).expect("only text was written");
                Message::Text(text.into())
            }
            SubProtocol::Binary => Message::Binary(self.next_binary().into()),
        })
    }
}

fn text(out: &mut Vec<u8>, arguments: std::fmt::Arguments) {
    out.write_fmt(arguments).expect("writing to memory does not fail");
}

#[cfg(test)]
mod tests;
