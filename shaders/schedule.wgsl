// Lists the tiles that are due and not at rest, page by page, and writes the arguments of the
// dispatches that will compact them.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> runs: array<Run>;
@group(0) @binding(1) var<storage, read> tiles: array<Tile>;
@group(0) @binding(2) var<storage, read_write> states: array<atomic<u32>>;
// For each page where its part of `due` begins.
@group(0) @binding(3) var<storage, read> page_starts: array<u32>;
// For each page the groups along x, y and z and the length of its list, then the lists.
@group(0) @binding(4) var<storage, read_write> due: array<atomic<u32>>;

const ROW: u32 = 256u;

var<workgroup> shared_page: atomic<u32>;
var<workgroup> shared_count: atomic<u32>;
var<workgroup> shared_first: u32;

fn is_due(tile: u32) -> bool {
    if tile >= work.count {
        return false;
    }
    let row = tiles[tile];
    if row.session == NONE {
        return false;
    }
    let run = runs[row.session];
    if (run.flags & WAKE) != 0u {
        atomicOr(&states[tile], AWAKE);
    }
    let awake = (atomicLoad(&states[tile]) & AWAKE) != 0u || (run.flags & ALWAYS_AWAKE) != 0u;
    return run.cycles > 0u && awake && (run.flags & PARTED) == 0u;
}

fn reserve(page: u32, count: u32) -> u32 {
    let first = atomicAdd(&due[page * 4u + 3u], count);
    let end = first + count;
    atomicMax(&due[page * 4u], min(end, ROW));
    atomicMax(&due[page * 4u + 1u], (end + ROW - 1u) / ROW);
    atomicMax(&due[page * 4u + 2u], 1u);
    return first;
}

@compute @workgroup_size(64)
fn schedule(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let tile = flat_index(group, groups) * 64u + thread;
    let listed = is_due(tile);
    var page = 0u;
    if listed {
        page = tiles[tile].page;
        atomicMax(&shared_page, page + 1u);
    }
    workgroupBarrier();
    // Neighbouring tiles are mostly in one page: one reservation serves them all.
    let page_of_most = atomicLoad(&shared_page) - 1u;
    let in_shared = listed && page == page_of_most;
    var rank = 0u;
    if in_shared {
        rank = atomicAdd(&shared_count, 1u);
    }
    workgroupBarrier();
    let count = atomicLoad(&shared_count);
    if thread == 0u && count > 0u {
        shared_first = reserve(page_of_most, count);
    }
    workgroupBarrier();
    if in_shared {
        atomicStore(&due[page_starts[page] + shared_first + rank], tile);
    } else if listed {
        let place = reserve(page, 1u);
        atomicStore(&due[page_starts[page] + place], tile);
    }
}
