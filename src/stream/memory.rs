//! Memory that the streams of a session take.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// What an open stream takes beside the message under way \[bytes\]: its buffers and its task, as
/// measured with many that listen.
const OPEN_STREAM: usize = 20 * 1024;

/// A sum over all streams of a session. Clones are handles to the same.
#[derive(Clone, Debug, Default)]
pub struct StreamMemory(Arc<AtomicU64>);

impl StreamMemory {
    /// Bytes that they take together.
    pub fn bytes(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    /// A part of it, of no bytes yet.
    pub fn part(&self) -> Part {
        Part { sum: self.clone(), bytes: 0 }
    }

    /// The part of an open stream.
    pub fn open(&self) -> OpenStream {
        let mut part = self.part();
        part.set(OPEN_STREAM);
        OpenStream(part)
    }
}

/// Bytes that are counted until this is dropped.
#[derive(Debug)]
pub struct Part {
    sum: StreamMemory,
    bytes: u64,
}

impl Part {
    /// Has other bytes counted in place of those before.
    pub fn set(&mut self, bytes: usize) {
        let before = std::mem::replace(&mut self.bytes, bytes as u64);
        // What comes first: the sum never falls below 0.
        self.sum.0.fetch_add(self.bytes, Ordering::Relaxed);
        self.sum.0.fetch_sub(before, Ordering::Relaxed);
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        self.set(0);
    }
}

/// An open stream.
#[derive(Debug)]
pub struct OpenStream(Part);

impl OpenStream {
    /// Notes the length of the message that is being written: 0 where none is.
    pub fn writes(&mut self, bytes: usize) {
        self.0.set(OPEN_STREAM + bytes);
    }
}
