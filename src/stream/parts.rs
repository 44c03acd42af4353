//! Messages of heights, ground and objects, cut into parts. No I/O.

use std::io::Write;

use axum::body::Bytes;
use axum::extract::ws::Message;
use firn_protocol::stream::SubProtocol;
use firn_protocol::{Stamp, heights};

use crate::budget::Reservation;

use super::tiles::Sampling;

/// Largest message to a client \[bytes\]; what is longer is sent in parts.
pub const LARGEST_PART: usize = 1 << 20;

/// Room for what ends a part: closing brackets and `more`.
const TAIL: usize = 64;

/// Most bytes of what begins a binary part, and of what stands before each of its tiles.
const BINARY_HEAD: usize = 64;
const BINARY_RUN: usize = 16;

/// Memory that a message of so many tiles, tiles of ground and objects takes at the most until it is written:
/// their bytes, and those of the part under way.
pub fn most_bytes(protocol: SubProtocol, tiles: usize, ground: usize, objects: usize) -> u64 {
    let (tile, below) = match protocol {
        SubProtocol::Json => (704, 896),
        SubProtocol::Binary => (320, 320),
    };
    let bytes = tiles * tile + ground * below + objects * 512;
    (bytes + bytes.min(LARGEST_PART)) as u64
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
    /// Whether the client was given exactly what it missed, where it asked for that; told in the first part.
    pub recovered: Option<bool>,
    /// Whether all ground is level, but what the message tells; told in the first part.
    pub level: bool,
}

/// Tiles still to be written, each with its bytes, the next one last.
type Tiles = Vec<(u32, Bytes)>;

/// A message, written part by part as the client takes them.
#[derive(Debug)]
pub struct Parts {
    head: Head,
    sampling: Sampling,
    tiles: Tiles,
    ground: Tiles,
    /// Colliders still to be written, each as JSON, the next one last.
    colliders: Option<Vec<Vec<u8>>>,
    largest: usize,
    first: bool,
    done: bool,
    /// What is counted of its memory.
    _memory: Option<Reservation>,
}

impl Parts {
    /// A message of tiles, of tiles of ground and, where they are to be told, colliders.
    pub fn new(
        head: Head,
        sampling: Sampling,
        mut tiles: Vec<(u32, Bytes)>,
        mut ground: Vec<(u32, Bytes)>,
        mut colliders: Option<Vec<Vec<u8>>>,
    ) -> Parts {
        tiles.reverse();
        ground.reverse();
        if let Some(colliders) = &mut colliders {
            colliders.reverse();
        }
        Parts {
            head,
            sampling,
            tiles,
            ground,
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

    /// Whether only colliders are left.
    fn all_ground_told(&self) -> bool {
        self.tiles.is_empty() && self.ground.is_empty()
    }

    fn write_head(&self, first: bool, out: &mut Vec<u8>) {
        let Head { snapshot, id, stamp, recovered, level } = self.head;
        let Stamp { tick, seq } = stamp;
        let op = if snapshot { "snapshot" } else { "delta" };
        text(out, format_args!(r#"{{"op":"{op}","id":{id},"seq":{seq},"tick":{tick}"#));
        if let (true, Some(recovered)) = (first, recovered) {
            text(out, format_args!(r#","recovered":{recovered}"#));
        }
        if first && level {
            out.extend_from_slice(br#","level":true"#);
        }
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
        let first = std::mem::take(&mut self.first);
        self.write_head(first, &mut out);
        let empty = self.all_ground_told();
        let anything = !self.tiles.is_empty();
        write_tiles(br#","tiles":["#, &mut self.tiles, self.largest, &mut out);
        let room = |next: &(u32, Bytes)| out.len() + TAIL + next.1.len() <= self.largest;
        if self.tiles.is_empty() && self.ground.last().is_some_and(|next| !anything || room(next)) {
            write_tiles(br#","terrain":["#, &mut self.ground, self.largest, &mut out);
        }
        self.done = self.all_ground_told() && self.write_colliders(&mut out, empty);
        if !self.done {
            out.extend_from_slice(br#","more":true"#);
        }
        out.push(b'}');
        out
    }

    fn next_binary(&mut self) -> Vec<u8> {
        let first = std::mem::take(&mut self.first);
        let empty = self.all_ground_told();
        let mut size = BINARY_HEAD;
        let tiles = take_tiles(&mut self.tiles, self.largest, &mut size);
        let ground = match self.tiles.last() {
            Some(_) => Vec::new(),
            None => take_tiles(&mut self.ground, self.largest, &mut size),
        };
        let mut colliders = vec![0; size];
        let told = self.all_ground_told() && self.colliders.is_some();
        self.done = self.all_ground_told() && self.write_colliders(&mut colliders, empty);
        // Nothing was written where there was no room for the first.
        let colliders = (told && colliders.len() > size).then(|| &colliders[size..]);
        let Head { snapshot, id, stamp, recovered, level } = self.head;
        let head = heights::Head {
            snapshot,
            id,
            seq: stamp.seq,
            tick: stamp.tick,
            recovered: recovered.filter(|_| first),
            more: !self.done,
            level: level && first,
            stride: self.sampling.stride,
            tiles_x: self.sampling.grid.tiles_x(),
        };
        heights::encode(&head, &tiles, &ground, colliders)
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

/// Writes a list of tiles, as many as a part has room for: one always fits.
fn write_tiles(key: &[u8], tiles: &mut Tiles, largest: usize, out: &mut Vec<u8>) {
    out.extend_from_slice(key);
    let begin = out.len();
    while let Some((_, bytes)) = tiles.last() {
        if out.len() > begin {
            if out.len() + 1 + bytes.len() + TAIL > largest {
                break;
            }
            out.push(b',');
        }
        out.extend_from_slice(bytes);
        tiles.pop();
    }
    out.push(b']');
}

/// Takes as many tiles as a binary part has room for beside its `size`: one always fits into an empty part.
fn take_tiles(tiles: &mut Tiles, largest: usize, size: &mut usize) -> Vec<(u32, Bytes)> {
    let mut taken = Vec::new();
    while let Some((_, bytes)) = tiles.last() {
        let next = *size + BINARY_RUN + bytes.len();
        if next > largest && *size > BINARY_HEAD {
            break;
        }
        *size = next;
        taken.extend(tiles.pop());
    }
    taken
}

fn text(out: &mut Vec<u8>, arguments: std::fmt::Arguments) {
    out.write_fmt(arguments).expect("writing to memory does not fail");
}

#[cfg(test)]
mod tests;
