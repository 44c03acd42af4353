//! What a subscription has still to send. No I/O, and no history: the newest seq its client has
//! seen and the rectangle it holds say everything.

use std::sync::Arc;

use axum::body::Bytes;
use firn_protocol::stream::SubProtocol;
use firn_protocol::{ColliderView, Event, Events, Resume, Stamp, Subscribe, Update};
use firn_snow::{ColumnRect, Grid};
use tokio::time::Instant;

use crate::budget::{Budget, Reservation};
use crate::session::{Check, Happening, Mirror, SessionError, TileColumns};

use super::cache::{EncodedTiles, Layer};
use super::ground::GroundNews;
use super::pace::Pace;
use super::parts::{Head, Parts, most_bytes};
use super::quantum::Quantum;
use super::region::{columns_in, columns_of, meets};
use super::tiles::Sampling;
use super::watch::{Watch, watches};

/// Longest message of heights whose memory is not counted \[bytes\].
const SMALL: u64 = 64 * 1024;

/// Why a wish that was checked is there.
const NOTED: &str = "whatever is wrong with it was noted";

/// A client's view of a session.
#[derive(Debug)]
pub struct Subscription {
    id: i64,
    sampling: Sampling,
    /// Tiles encoded as this client wants them.
    layer: Arc<Layer>,
    /// Tiles wanted.
    view: ColumnRect,
    /// Tiles the client holds in their state at `seen`.
    held: Option<ColumnRect>,
    /// Newest seq the client has seen.
    seen: u64,
    /// What the first message says, until it is sent.
    first: Option<First>,
    wants_ground: bool,
    wants_colliders: bool,
    /// Fingerprint of the colliders the client was last told.
    told: Option<blake3::Hash>,
    /// Kinds of events wanted.
    events: Events,
    watches: Vec<Watch>,
    pace: Pace,
    /// What the newest message took.
    cost: Cost,
}

/// What a message took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Tiles that it tells.
    pub tiles: u64,
    /// Those of them that were encoded for it; the others were there already.
    pub encoded: u64,
}

/// What a subscription is told at its begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum First {
    /// Everything.
    Snapshot,
    /// Everything, for the state that the client named is not one that can be recovered.
    Lost,
    /// What has changed since the state that the client named.
    Recovered,
}

/// Where a subscription begins.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// The session's grid.
    pub grid: Grid,
    /// Whether all that has changed since a state is known.
    pub recovers: &'a dyn Fn(&Resume) -> bool,
    /// How the client wants heights to be written.
    pub protocol: SubProtocol,
    /// The session's encoded tiles.
    pub encoded: &'a EncodedTiles,
}

/// What was copied out of a mirror for one message.
#[derive(Debug)]
pub struct Copied {
    stamp: Stamp,
    /// Tiles, with their bytes where they were encoded before.
    tiles: Vec<(u32, Option<Bytes>)>,
    /// Version and heights of the others, in the same order.
    fresh: Vec<(u64, TileColumns)>,
    ground: GroundNews,
    colliders: Option<Arc<[ColliderView]>>,
    /// How watches stand of which the client was told otherwise.
    pub crossings: Vec<Event>,
    /// Counted where the message is a large one.
    memory: Option<Reservation>,
}

impl Subscription {
    /// A subscription that begins at once: with a snapshot, or with what its client has missed.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] names each field that is out of its range.
    pub fn new(
        id: i64,
        wish: &Subscribe,
        source: Source,
        now: Instant,
    ) -> Result<Self, SessionError> {
        let Source { grid, recovers, protocol, encoded } = source;
        let mut check = Check::default();
        if ![1, 2, 4, 8].contains(&wish.stride) {
            check.reject("/stride", format!("{} is not 1, 2, 4 or 8", wish.stride));
        }
        check.range("/max_rate", wish.max_rate, 0.1, 60.0, "Hz");
        let quantum = check.take(Quantum::new(wish.quantum));
        let columns = check.take(columns_in(wish.region, &grid, "/region"));
        let watches = watches(&wish.watch, &grid, &mut check);
        check.finish()?;
        let quantum = quantum.expect(NOTED);
        let view = columns.expect(NOTED).tiles();
        let is_json = protocol == SubProtocol::Json;
        let default = || if is_json { Events::all() } else { Events::none() };
        let events = wish.events.clone().unwrap_or_else(default);
        let (first, seen) = match &wish.resume {
            None => (First::Snapshot, 0),
            Some(resume) if recovers(resume) => (First::Recovered, resume.seq),
            Some(_) => (First::Lost, 0),
        };
        Ok(Subscription {
            id,
            sampling: Sampling { grid, stride: wish.stride, quantum, protocol },
            layer: encoded.layer(protocol, wish.stride, quantum),
            view,
            // Who resumes says that it holds all of the region, and its ground where that is wanted.
            held: (first == First::Recovered).then_some(view),
            seen,
            first: Some(first),
            wants_ground: wish.terrain,
            wants_colliders: wish.colliders,
            told: None,
            events,
            watches,
            pace: Pace::new(wish.max_rate, now),
            cost: Cost::default(),
        })
    }

    /// The client's number for it.
    pub fn id(&self) -> i64 {
        self.id
    }

    /// Moves the view, and changes what is wanted beside heights. The client keeps what it holds of the
    /// new view.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] names each field that is out of its range; nothing has changed then.
    pub fn update(&mut self, update: Update) -> Result<(), SessionError> {
        let grid = &self.sampling.grid;
        let mut check = Check::default();
        let columns = check.take(columns_in(update.region, grid, "/region"));
        let watches = update.watch.map(|wishes| watches(&wishes, grid, &mut check));
        check.finish()?;
        if let Some(watches) = watches {
            self.watches = watches;
        }
        if let Some(events) = update.events {
            self.events = events;
        }
        self.view = columns.expect(NOTED).tiles();
        self.held = self.held.and_then(|held| held.overlap(&self.view));
        self.told = None;
        self.pace.mark_move();
        Ok(())
    }

    /// Whether its client wants to hear of something.
    pub fn wants(&self, happening: &Happening) -> bool {
        let meets = |columns: &ColumnRect| columns.tiles().overlap(&self.view).is_some();
        happening.event.kind().is_some_and(|kind| self.events.contains(kind))
            && happening.columns.as_ref().is_none_or(meets)
    }

    /// Notes that there may be something to tell, and of which tick.
    pub fn mark(&mut self, tick: u64) {
        self.pace.mark(tick);
    }

    /// When the next message may be sent, where there may be one.
    pub fn due(&self) -> Option<Instant> {
        self.pace.due()
    }

    /// Tiles whose newest state the client does not hold, given their versions.
    fn missing(&self, version: impl Fn(u32) -> u64) -> Vec<u32> {
        let tiles_x = self.sampling.grid.tiles_x();
        let view = self.view;
        (view.z0..view.z1)
            .flat_map(|z| (view.x0..view.x1).map(move |x| (x, z)))
            .map(|(x, z)| (z * tiles_x + x, self.held.is_some_and(|held| held.contains(x, z))))
            .filter(|&(tile, held)| !held || version(tile) > self.seen)
            .map(|(tile, _)| tile)
            .collect()
    }

    /// Puts the next message off, because there is no memory for it now.
    pub fn put_off(&mut self, until: Instant) {
        self.pace.put_off(until);
    }

    /// Copies what the client has not seen; the client counts as having seen it from here on. Nothing
    /// where `unsent` has no room for it.
    pub fn copy(&mut self, mirror: &Mirror, frame: u64, unsent: &Budget) -> Option<Copied> {
        let tiles = self.missing(|tile| mirror.tile(tile).1);
        let unknown = |_| mirror.ground_version;
        let ground = if self.wants_ground { self.missing(unknown) } else { Vec::new() };
        let ground = GroundNews::new(mirror, ground);
        let changed = self.told.is_none() || mirror.colliders_version > self.seen;
        let colliders = (self.wants_colliders && changed).then(|| mirror.colliders.clone());
        let objects = colliders.as_ref().map_or(0, |colliders| colliders.len());
        let bytes = most_bytes(self.sampling.protocol, tiles.len(), ground.count(), objects);
        let memory = match bytes {
            0..=SMALL => None,
            bytes => Some(unsent.try_reserve(bytes)?),
        };
        let stamp = mirror.stamp_at(frame);
        let watches = self.watches.iter_mut();
        let crossings =
            watches.filter_map(|watch| watch.news(mirror, stamp, self.id, self.seen)).collect();
        self.seen = mirror.seq;
        self.held = Some(self.view);
        self.pace.take_news(stamp.tick);
        let mut fresh = Vec::new();
        let encoded = |tile| {
            let (heights, version) = mirror.tile(tile);
            let bytes = self.layer.get(tile, version);
            if bytes.is_none() {
                fresh.push((version, *heights));
            }
            (tile, bytes)
        };
        let tiles = tiles.into_iter().map(encoded).collect();
        Some(Copied { stamp, tiles, fresh, ground, colliders, crossings, memory })
    }

    /// The message about what was copied, if anything in the view has changed.
    pub fn message(&mut self, copied: Copied, now: Instant) -> Option<Parts> {
        let colliders = copied.colliders.and_then(|all| self.news_of(&all));
        let first = self.first.take();
        let is_news = !copied.tiles.is_empty() || !copied.ground.is_empty() || colliders.is_some();
        if first.is_none() && !is_news {
            return None;
        }
        match first {
            Some(_) => self.pace.begin(now),
            None => self.pace.take_turn(now),
        }
        let head = Head {
            snapshot: matches!(first, Some(First::Snapshot | First::Lost)),
            id: self.id,
            stamp: copied.stamp,
            recovered: match first {
                None | Some(First::Snapshot) => None,
                Some(First::Lost) => Some(false),
                Some(First::Recovered) => Some(true),
            },
            level: copied.ground.is_level(),
        };
        let ground = copied.ground.encode(&self.sampling);
        let tiles = self.encode(copied.tiles, copied.fresh);
        Some(Parts::new(head, self.sampling, tiles, ground, colliders).holding(copied.memory))
    }

    /// Notes that something was told.
    pub fn take_turn(&mut self, now: Instant) {
        self.pace.take_turn(now);
    }

    /// What the newest message took.
    pub fn cost(&self) -> Cost {
        self.cost
    }

    /// The bytes of all tiles, those made that are not there yet.
    fn encode(
        &mut self,
        tiles: Vec<(u32, Option<Bytes>)>,
        fresh: Vec<(u64, TileColumns)>,
    ) -> Vec<(u32, Bytes)> {
        let mut fresh = fresh.iter();
        self.cost = Cost { tiles: tiles.len() as u64, encoded: 0 };
        let mut make = |tile| {
            let (version, heights) = fresh.next().expect("each without bytes has heights");
            let encode = || {
                self.cost.encoded += 1;
                self.sampling.encode_tile(tile, heights)
            };
            self.layer.get_or_encode(tile, *version, encode)
        };
        tiles.into_iter().map(|(tile, bytes)| (tile, bytes.unwrap_or_else(|| make(tile)))).collect()
    }

    /// The colliders in the view, each as JSON, where the client was last told others.
    fn news_of(&mut self, all: &[ColliderView]) -> Option<Vec<Vec<u8>>> {
        let grid = self.sampling.grid;
        let columns = columns_of(&self.view, &grid);
        let colliders: Vec<Vec<u8>> = all
            .iter()
            .filter(|collider| meets(collider, &columns, &grid))
            .map(|collider| serde_json::to_vec(collider).expect("colliders have string keys"))
            .collect();
        let mut hasher = blake3::Hasher::new();
        for collider in &colliders {
            hasher.update(collider);
        }
        let told = Some(hasher.finalize());
        (std::mem::replace(&mut self.told, told) != told).then_some(colliders)
    }
}

#[cfg(test)]
mod tests;
