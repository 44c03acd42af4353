//! Memory that a session takes, found without looking at what lies in it.

use std::any::Any;
use std::fmt;
use std::mem::size_of;
use std::sync::Arc;

use firn_protocol::{Body, ColliderView, MemoryBytes, UsageView};

use crate::core::record::heap_bytes;
use crate::core::session::{Collider, EVENT_BACKLOG, Ground, Happening, Simulation};
use crate::session::handle::Session;

/// What an object takes beside its descriptions: its name, places in maps, and its load.
const OBJECT: usize = 208;

/// What an engine knows of a footprint: its columns and tiles.
const FOOTPRINT: usize = 160;

/// Events that wait for streams: there is room for as many from the beginning, each with what tells
/// who has seen it.
const EVENTS: usize = EVENT_BACKLOG * (size_of::<Arc<[Happening]>>() + 48);

/// What the engine knows of a tile: where its cells are, and its places in lists of tiles.
const TILE: usize = 32;

/// What the streams keep beside a session.
pub trait Companion: Any + fmt::Debug + Send + Sync {
    /// Memory that it takes \[bytes\].
    fn bytes(&self) -> u64;
}

impl Session {
    /// What it takes of the server.
    pub fn usage(&self) -> UsageView {
        let device_seconds = self.device_time().as_secs_f64();
        UsageView { device_seconds, memory_bytes: self.memory() }
    }

    /// Memory that it takes.
    pub fn memory(&self) -> MemoryBytes {
        MemoryBytes {
            device: self.device_memory(),
            host: self.host_memory() as u64,
            journal: self.journal_weight.get(),
            streams: self.companion_bytes(),
        }
    }

    fn host_memory(&self) -> usize {
        let (mirror, objects, outlines, footprints) = {
            let mirror = self.mirror();
            let bodies = || mirror.colliders.iter().map(|collider| &collider.body);
            let outlines = bodies().map(Body::heap_bytes).sum::<usize>();
            let footprints = bodies().map(|body| body.outlines().count()).sum::<usize>();
            let changed = Some(&mirror.ground).filter(|ground| !ground.is(&self.ground));
            let ground = self.ground.bytes() + changed.map_or(0, Ground::bytes);
            (ground + mirror.bytes(), mirror.colliders.len(), outlines, footprints)
        };
        let own = size_of::<Session>() + EVENTS + heap_bytes(&self.spec) + mirror;
        let views = objects * (size_of::<ColliderView>() + OBJECT) + outlines;
        if self.is_hibernating() {
            return own + views;
        }
        let tiles = self.spec.grid.tiles() as usize * TILE;
        let simulation = size_of::<Simulation>() + objects * (size_of::<Collider>() + OBJECT);
        own + views + tiles + simulation + outlines + footprints * FOOTPRINT
    }
}
