// Packs the heights of the tiles that changed since the last publication, in the order of the tiles,
// and tells which tiles are awake, and how many: a workgroup for each group of 64 tiles, a thread for each
// tile to look, then all threads to copy.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> runs: array<Run>;
@group(0) @binding(1) var<storage, read> tiles: array<Tile>;
@group(0) @binding(2) var<storage, read_write> states: array<atomic<u32>>;
// Four columns at a time.
@group(0) @binding(3) var<storage, read> heights: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> tallies: array<Tally>;
// The number of tiles packed.
@group(0) @binding(5) var<storage, read_write> packed_count: atomic<u32>;
@group(0) @binding(6) var<storage, read_write> packed_groups: array<PackedGroup>;
// Heights of each packed tile, four columns at a time.
@group(0) @binding(7) var<storage, read_write> packed: array<vec4<u32>>;

const THREADS: u32 = 64u;
// Vectors of heights in a tile.
const VECTORS: u32 = TILE_COLUMNS / 4u;

var<workgroup> changed: array<atomic<u32>, 2>;
var<workgroup> awake: array<atomic<u32>, 2>;
var<workgroup> first: u32;

@compute @workgroup_size(64)
fn publish(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    // Groups are counted from the first that publishes.
    let index = flat_index(group, groups);
    let first_tile = (work.first + index) * THREADS;
    let tile = first_tile + thread;
    if index < work.count {
        let session = tiles[tile].session;
        if session != NONE && (runs[session].flags & PUBLISH) != 0u {
            let state = atomicAnd(&states[tile], ~DIRTY);
            if (state & AWAKE) != 0u {
                atomicAdd(&tallies[runs[session].tally].active_tiles, 1u);
                atomicOr(&awake[thread / 32u], 1u << (thread % 32u));
            }
            if (state & DIRTY) != 0u {
                atomicOr(&changed[thread / 32u], 1u << (thread % 32u));
            }
        }
    }
    workgroupBarrier();
    let mask = vec2(atomicLoad(&changed[0]), atomicLoad(&changed[1]));
    let count = countOneBits(mask.x) + countOneBits(mask.y);
    if thread == 0u && index < work.count {
        if count > 0u {
            first = atomicAdd(&packed_count, count);
        }
        packed_groups[index] =
            PackedGroup(mask.x, mask.y, atomicLoad(&awake[0]), atomicLoad(&awake[1]), first);
    }
    workgroupBarrier();
    // 16 threads copy a tile.
    for (var i = thread / VECTORS; i < 64u; i += THREADS / VECTORS) {
        let bit = 1u << (i % 32u);
        let half = select(mask.x, mask.y, i >= 32u);
        if (half & bit) != 0u {
            let before = countOneBits(half & (bit - 1u)) + select(0u, countOneBits(mask.x), i >= 32u);
            packed[(first + before) * VECTORS + thread % VECTORS] =
                heights[(first_tile + i) * VECTORS + thread % VECTORS];
        }
    }
}
