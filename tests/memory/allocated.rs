//! How much memory the process has allocated.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

static BYTES: AtomicI64 = AtomicI64::new(0);
static PEAK: AtomicI64 = AtomicI64::new(0);

/// The system's allocator, counting.
struct Counting;

#[global_allocator]
static COUNTING: Counting = Counting;

/// Bytes that are allocated, without what the allocator adds to each piece.
fn bytes() -> i64 {
    BYTES.load(Ordering::Relaxed)
}

/// Bytes that are allocated once nothing is under way any more.
pub async fn settled() -> i64 {
    // Nothing tells when the last thread has given back what it held: it is less and less until then.
    let (mut least, mut quiet) = (i64::MAX, 0);
    while quiet < 40 {
        tokio::time::sleep(Duration::from_millis(25)).await;
        let now = bytes();
        quiet = if now < least { 0 } else { quiet + 1 };
        least = least.min(now);
    }
    least
}

/// The most bytes that were allocated at a time since [`watch`].
pub fn peak() -> i64 {
    PEAK.load(Ordering::Relaxed)
}

/// Begins to look for the most anew. Returns what is allocated now.
pub fn watch() -> i64 {
    let now = bytes();
    PEAK.store(now, Ordering::Relaxed);
    now
}

/// From this size on a piece is the question whether there is memory (`firn_engine::reserve`), and given back
/// untouched. No test makes a larger one \[bytes\].
const QUESTION: usize = 64 << 20;

/// Bytes of a piece that count: as many as were asked for.
fn counted(layout: Layout) -> i64 {
    if layout.size() < QUESTION { layout.size() as i64 } else { 0 }
}

// SAFETY: everything is left to the system's allocator.
#[expect(unsafe_code, reason = "an allocator is unsafe to write")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let more = counted(layout);
        let bytes = BYTES.fetch_add(more, Ordering::Relaxed) + more;
        PEAK.fetch_max(bytes, Ordering::Relaxed);
        // SAFETY: the caller's promises are those that the system's allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        BYTES.fetch_sub(counted(layout), Ordering::Relaxed);
        // SAFETY: as above.
        unsafe { System.dealloc(place, layout) }
    }
}
