//! Memory that the record of a session takes. The sum is updated with each change, so that reading it does not
//! need the record.

use std::collections::VecDeque;
use std::mem::size_of;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use firn_protocol::{Body, SessionSpec, Site, SnowLayer, WeatherInput};

use crate::core::record::{Checkpoint, Entry, Identity, OVERHEAD, Stored};
use crate::core::session::{Command, Stamping};

/// Counters of an `Arc`.
const SHARED: usize = 2 * size_of::<usize>();

/// Bytes of a session's record. Clones are handles to the same.
#[derive(Clone, Debug, Default)]
pub(crate) struct Weight(Arc<AtomicU64>);

impl Weight {
    /// As it was noted last.
    pub fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

impl Stored {
    /// Updates the sum that is read through the session.
    pub fn weigh(&self) {
        let origin = self.origin.as_ref().map_or(0, |origin| SHARED + origin.len());
        let checkpoint = self.checkpoint.as_ref().map_or(0, |saved| saved.bytes());
        let own = size_of::<Stored>() + self.identity.bytes() + origin + checkpoint;
        let queued = self.entries.capacity() * size_of::<Arc<Entry>>() + self.entry_bytes;
        let all = own + queued + self.done.len() * OVERHEAD + self.points.weight();
        self.identity.weight.0.store(all as u64, Ordering::Relaxed);
    }
}

/// Memory that some entries take, beside their places in a queue.
pub(crate) fn bytes_of(entries: &VecDeque<Arc<Entry>>) -> usize {
    entries.iter().map(|entry| entry.bytes()).sum()
}

impl Identity {
    fn bytes(&self) -> usize {
        let texts = [&self.id, &self.created_at].map(|text| text.capacity());
        let heap = heap_bytes(&self.spec) + texts.iter().sum::<usize>();
        SHARED + size_of::<Identity>() + heap
    }
}

impl Checkpoint {
    fn bytes(&self) -> usize {
        let versions = self.versions.capacity() * size_of::<u64>();
        SHARED + size_of::<Checkpoint>() + versions + self.snapshot.capacity()
    }
}

impl Entry {
    pub(crate) fn bytes(&self) -> usize {
        let commands = self.commands.capacity() * size_of::<Command>();
        SHARED
            + size_of::<Entry>()
            + commands
            + self.commands.iter().map(Command::heap).sum::<usize>()
    }
}

impl Command {
    /// Memory that it takes beside its own size.
    fn heap(&self) -> usize {
        let (removed, put) = match self {
            Command::Objects { removed, put } => (removed, put),
            Command::Ground(ground) => return ground.bytes(),
            Command::Weather(weather) | Command::Settings { weather: Some(weather), .. } => {
                return weather_bytes(weather);
            }
            Command::ClearPath { path, .. } => return path.capacity() * size_of::<[f64; 2]>(),
            Command::Stamps(stamps) => {
                let outlines = stamps.iter().map(|stamp| stamp.shape.heap_bytes()).sum::<usize>();
                return stamps.capacity() * size_of::<Stamping>() + outlines;
            }
            _ => return 0,
        };
        let names = removed.iter().chain(put.iter().map(|(id, _)| id));
        let places = removed.capacity() * size_of::<Arc<str>>()
            + put.capacity() * size_of::<(Arc<str>, Body)>();
        let outlines = put.iter().map(|(_, object)| object.heap_bytes()).sum::<usize>();
        places + outlines + names.map(|id| SHARED + id.len()).sum::<usize>()
    }
}

/// Heap memory of a session's specification \[bytes\]. The ground is left out: copies share it.
pub(crate) fn heap_bytes(spec: &SessionSpec) -> usize {
    let weather = spec.weather.as_ref().map_or(0, weather_bytes);
    let site = spec.site.as_ref().map_or(0, |_| SHARED + size_of::<Site>());
    spec.initial_snow.capacity() * size_of::<SnowLayer>() + weather + site
}

fn weather_bytes(weather: &Arc<WeatherInput>) -> usize {
    SHARED + size_of::<WeatherInput>() + weather.heap_bytes()
}
