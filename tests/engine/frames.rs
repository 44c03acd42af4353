//! What a frame costs beside the snow in it.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use firn_engine::frame::{Backend, Run, Work};
use firn_snow::{Grid, Material};

use crate::support::*;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting.
struct Counting;

// SAFETY: everything is left to the system's allocator.
#[expect(unsafe_code, reason = "an allocator is unsafe to write")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // A thread that ends may allocate after its counter is gone.
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promises are those that the system's allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(place, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

#[test]
fn an_empty_frame_finds_nothing() {
    let Some(mut gpu) = gpu(false) else { return };
    let mut cpu = cpu();
    for backend in [&mut gpu as &mut dyn Backend, &mut cpu] {
        let outcome = carry_out(backend, Vec::new());
        assert_eq!((outcome.work.len(), outcome.published.count()), (0, 0));
    }
}

#[test]
fn a_frame_allocates_nothing_for_a_snowpack() {
    let allocations = |snowpacks: u32| {
        let mut gpu = gpu(false)?;
        let grid = Grid { width: 8, depth: 8, height: 20, cell_size: 0.2 };
        for slot in 0..snowpacks {
            gpu.create(slot, &level(grid, Material::default())).unwrap();
            edit(&mut gpu, slot, vec![snow(&grid, grid.all(), 3.0, 20.0, -3.0)]);
        }
        let run = Run { cycles: 1, dt: 1.0 / 60.0 };
        let frame = || -> Vec<Work> {
            (0..snowpacks)
                .map(|slot| Work { slot, run, publish: true, ..Work::default() })
                .collect()
        };
        // The first ones make room.
        for _ in 0..4 {
            carry_out(&mut gpu, frame());
        }
        let frames: Vec<Vec<Work>> = (0..8).map(|_| frame()).collect();
        let of_a_frame = |work| {
            let before = ALLOCATIONS.get();
            let outcome = carry_out(&mut gpu, work);
            assert_eq!(outcome.published.count(), snowpacks);
            ALLOCATIONS.get() - before
        };
        // The graphics library's own vary, as it asks the device once more or less often.
        frames.into_iter().map(of_a_frame).min()
    };
    let (Some(few), Some(many)) = (allocations(4), allocations(60)) else { return };
    // One for each snowpack would be 56 more.
    assert!(many < few + 28, "{few} and {many}");
}
