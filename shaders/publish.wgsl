// Packs the heights of the tiles that changed since the last publication, and counts the tiles that
// are awake: a thread for each tile to look, then all threads of the workgroup to copy.

@group(0) @binding(0) var<uniform> work: Pass;
@group(0) @binding(1) var<storage, read> runs: array<Run>;
@group(0) @binding(2) var<storage, read> tiles: array<Tile>;
@group(0) @binding(3) var<storage, read_write> states: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read> heights: array<u32>;
@group(0) @binding(5) var<storage, read_write> tallies: array<Tally>;
// The number of tiles packed.
@group(0) @binding(6) var<storage, read_write> packed_count: atomic<u32>;
// For each tile its index and its heights.
@group(0) @binding(7) var<storage, read_write> packed: array<u32>;

const ENTRY: u32 = 1u + TILE_COLUMNS;

var<workgroup> dirty: array<u32, 64>;
var<workgroup> dirty_count: atomic<u32>;
var<workgroup> first: u32;

@compute @workgroup_size(64)
fn publish(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let tile = flat_index(group, groups) * 64u + thread;
    if tile < work.count {
        let session = tiles[tile].session;
        if session != NONE && (runs[session].flags & PUBLISH) != 0u {
            let state = atomicAnd(&states[tile], ~DIRTY);
            if (state & AWAKE) != 0u {
                atomicAdd(&tallies[session].active_tiles, 1u);
            }
            if (state & DIRTY) != 0u {
                dirty[atomicAdd(&dirty_count, 1u)] = tile;
            }
        }
    }
    workgroupBarrier();
    let count = atomicLoad(&dirty_count);
    if thread == 0u && count > 0u {
        first = atomicAdd(&packed_count, count);
    }
    workgroupBarrier();
    for (var i = 0u; i < count; i++) {
        let entry = (first + i) * ENTRY;
        if thread == 0u {
            packed[entry] = dirty[i];
        }
        packed[entry + 1u + thread] = heights[dirty[i] * TILE_COLUMNS + thread];
    }
}
