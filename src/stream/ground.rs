//! The ground under a subscription's tiles: told with each tile once, and anew when it changes. No I/O.

use axum::body::Bytes;

use crate::session::{Ground, Mirror};

use super::tiles::Sampling;

/// Ground that a client has still to be told.
#[derive(Debug)]
pub struct GroundNews {
    ground: Ground,
    tiles: Vec<u32>,
}

impl GroundNews {
    /// The ground under some tiles, be it none.
    pub fn new(mirror: &Mirror, tiles: Vec<u32>) -> GroundNews {
        GroundNews { ground: mirror.ground.clone(), tiles }
    }

    /// Whether there is nothing to tell.
    pub fn is_empty(&self) -> bool {
        self.tiles.is_empty()
    }

    /// Whether it says at once that all ground is level at 0, and no tile needs to be told.
    pub fn is_level(&self) -> bool {
        !self.is_empty() && (self.ground.lowest(), self.ground.highest()) == (0.0, 0.0)
    }

    /// Tiles that need to be told.
    pub fn count(&self) -> usize {
        if self.is_level() { 0 } else { self.tiles.len() }
    }

    /// Those tiles with their bytes. They are told once: keeping them for others is not worth the memory.
    pub fn encode(&self, sampling: &Sampling) -> Vec<(u32, Bytes)> {
        let encode = |&tile| (tile, sampling.encode_ground(tile, &self.ground).into());
        self.tiles[..self.count()].iter().map(encode).collect()
    }
}
