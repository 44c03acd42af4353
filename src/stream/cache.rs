//! Encoded tiles, shared by all who watch a session: a tile's newest version is encoded once for
//! each way of encoding it, however many streams it goes to.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use axum::body::Bytes;
use firn_protocol::stream::SubProtocol;

use crate::session::Companion;

use super::memory::{OpenStream, Part, StreamMemory};
use super::quantum::Quantum;

/// Ways of encoding that are shared in one session at a time. A stream that wants another has its
/// tiles encoded by itself: otherwise a client could fill the memory with quanta that nobody else uses.
const MOST_WAYS: usize = 16;

/// The encoded tiles of a session, and how often they were made and shared.
#[derive(Debug, Default)]
pub struct EncodedTiles {
    layers: Mutex<HashMap<Way, Weak<Layer>>>,
    counts: Arc<Counts>,
    memory: StreamMemory,
}

impl Companion for EncodedTiles {
    fn bytes(&self) -> u64 {
        self.memory.bytes()
    }
}

#[derive(Debug, Default)]
struct Counts {
    encoded: AtomicU64,
    shared: AtomicU64,
}

/// All that a tile's bytes depend on beside its heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Way {
    protocol: SubProtocol,
    stride: u32,
    quantum: u64,
}

impl EncodedTiles {
    /// How often a tile was encoded.
    pub fn encoded(&self) -> u64 {
        self.counts.encoded.load(Ordering::Relaxed)
    }

    /// How often a tile was sent that had been encoded before.
    pub fn shared(&self) -> u64 {
        self.counts.shared.load(Ordering::Relaxed)
    }

    /// Counts a stream's memory until what is returned is dropped.
    pub(super) fn open(&self) -> OpenStream {
        self.memory.open()
    }

    /// The tiles encoded in one way. They are kept while anybody holds this.
    pub(super) fn layer(&self, protocol: SubProtocol, stride: u32, quantum: Quantum) -> Arc<Layer> {
        let way = Way { protocol, stride, quantum: quantum.metres().to_bits() };
        let mut layers = lock(&self.layers);
        if let Some(layer) = layers.get(&way).and_then(Weak::upgrade) {
            return layer;
        }
        layers.retain(|_, layer| layer.strong_count() > 0);
        let keeps = layers.len() < MOST_WAYS;
        let kept = || Kept { tiles: HashMap::new(), payload: 0, part: self.memory.part() };
        let tiles = keeps.then(|| Mutex::new(kept()));
        let layer = Arc::new(Layer { tiles, counts: self.counts.clone() });
        if keeps {
            layers.insert(way, Arc::downgrade(&layer));
        }
        layer
    }
}

/// Tiles encoded in one way: of each that was asked for, the newest version only.
#[derive(Debug)]
pub struct Layer {
    /// `None` where nothing is kept.
    tiles: Option<Mutex<Kept>>,
    counts: Arc<Counts>,
}

/// Encoded tiles with their versions, and the memory that they take.
#[derive(Debug)]
struct Kept {
    tiles: HashMap<u32, (u64, Bytes)>,
    payload: usize,
    part: Part,
}

impl Kept {
    fn insert(&mut self, tile: u32, version: u64, bytes: Bytes) {
        self.payload += bytes.len();
        let before = self.tiles.insert(tile, (version, bytes));
        self.payload -= before.map_or(0, |(_, bytes)| bytes.len());
        let shared = self.tiles.len() * SHARED_BYTES;
        self.part.set(self.payload + shared + table_bytes(&self.tiles));
    }
}

/// What a text takes that several hold, beside its own length.
const SHARED_BYTES: usize = 3 * size_of::<usize>();

/// Memory that a table takes, beside what its keys and values lead to: a place and a byte for each
/// of a power of two of buckets, of which seven in eight may be in use.
fn table_bytes<K, V>(table: &HashMap<K, V>) -> usize {
    match table.capacity() {
        0 => 0,
        most => (most * 8 / 7).next_power_of_two() * (size_of::<(K, V)>() + 1),
    }
}

impl Layer {
    /// A tile's bytes, where this version of it was encoded already.
    pub fn get(&self, tile: u32, version: u64) -> Option<Bytes> {
        let kept = lock(self.tiles.as_ref()?);
        let (_, bytes) = kept.tiles.get(&tile).filter(|(kept, _)| *kept == version)?;
        self.counts.shared.fetch_add(1, Ordering::Relaxed);
        Some(bytes.clone())
    }

    /// A tile's bytes, encoded where they are not there. Others who want it wait meanwhile.
    pub fn get_or_encode(
        &self,
        tile: u32,
        version: u64,
        encode: impl FnOnce() -> Vec<u8>,
    ) -> Bytes {
        let encode = || {
            self.counts.encoded.fetch_add(1, Ordering::Relaxed);
            Bytes::from(encode())
        };
        let Some(kept) = &self.tiles else { return encode() };
        let mut kept = lock(kept);
        match kept.tiles.get(&tile) {
            Some((kept, bytes)) if *kept == version => {
                self.counts.shared.fetch_add(1, Ordering::Relaxed);
                bytes.clone()
            }
            // Newer ones are there already; nobody will ask for this one again.
            Some((kept, _)) if *kept > version => encode(),
            _ => {
                let bytes = encode();
                kept.insert(tile, version, bytes.clone());
                bytes
            }
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Every change of the maps is one insertion: one left by a panic is still sound.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quantum(metres: f64) -> Quantum {
        Quantum::new(metres).unwrap()
    }

    #[test]
    fn a_version_is_encoded_once_and_only_the_newest_is_kept() {
        let all = EncodedTiles::default();
        let layer = all.layer(SubProtocol::Binary, 1, quantum(0.001));
        assert_eq!(layer.get(3, 7), None);
        let encode = |version: u64, text: &'static [u8]| {
            let layer = all.layer(SubProtocol::Binary, 1, quantum(0.001));
            layer.get_or_encode(3, version, || text.to_vec())
        };
        assert_eq!(encode(7, b"a"), "a");
        assert_eq!(encode(7, b"never"), "a");
        assert_eq!(layer.get(3, 7), Some("a".into()));
        assert_eq!((all.encoded(), all.shared()), (1, 2));
        assert_eq!(encode(9, b"b"), "b");
        assert_eq!(encode(7, b"late"), "late");
        assert_eq!(layer.get(3, 9), Some("b".into()));
        assert_eq!(layer.get(3, 7), None);
        assert_eq!((all.encoded(), all.shared()), (3, 3));
    }

    #[test]
    fn every_way_has_its_own_bytes_while_somebody_wants_them() {
        let all = EncodedTiles::default();
        let ways = [
            (SubProtocol::Binary, 1, 0.001),
            (SubProtocol::Json, 1, 0.001),
            (SubProtocol::Binary, 2, 0.001),
            (SubProtocol::Binary, 1, 0.01),
        ];
        let held: Vec<_> =
            ways.iter().map(|&(way, stride, step)| all.layer(way, stride, quantum(step))).collect();
        for (i, layer) in held.iter().enumerate() {
            layer.get_or_encode(0, 1, || vec![i as u8]);
        }
        for (i, layer) in held.iter().enumerate() {
            assert_eq!(layer.get(0, 1), Some(vec![i as u8].into()));
        }
        drop(held);
        assert_eq!(all.layer(SubProtocol::Json, 1, quantum(0.001)).get(0, 1), None);
    }

    #[test]
    fn what_is_kept_is_counted_until_nobody_wants_it() {
        let all = EncodedTiles::default();
        let layer = all.layer(SubProtocol::Binary, 1, quantum(0.001));
        for tile in 0..1000 {
            layer.get_or_encode(tile, 1, || vec![0; 100]);
        }
        // 1024 buckets hold 896.
        let table = 2048 * (size_of::<(u32, (u64, Bytes))>() + 1);
        assert_eq!(all.bytes(), (table + 1000 * (100 + SHARED_BYTES)) as u64);
        for tile in 0..1000 {
            layer.get_or_encode(tile, 2, || vec![0; 40]);
        }
        assert_eq!(all.bytes(), (table + 1000 * (40 + SHARED_BYTES)) as u64);
        let mut stream = all.open();
        let open = all.bytes();
        stream.writes(777);
        assert_eq!(all.bytes(), open + 777);
        drop(layer);
        stream.writes(0);
        drop(stream);
        assert_eq!(all.bytes(), 0);
    }

    #[test]
    fn ways_beyond_the_most_are_not_kept() {
        let all = EncodedTiles::default();
        let step = |i: usize| quantum(0.001 * (i + 1) as f64);
        let held: Vec<_> =
            (0..=MOST_WAYS).map(|i| all.layer(SubProtocol::Json, 1, step(i))).collect();
        for layer in &held {
            layer.get_or_encode(0, 1, Vec::new);
        }
        assert!(held[MOST_WAYS - 1].get(0, 1).is_some());
        assert!(held[MOST_WAYS].get(0, 1).is_none());
    }
}
