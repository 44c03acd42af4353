// Compacts the cells of listed tiles: a workgroup for each tile, a thread for four neighbouring
// cells at a time, its slots equally far apart. Stress is constant meanwhile, so all cycles of a run
// go in registers. A tile in which the last cycle changed no quantum goes to rest. The twin of
// Compaction in firn-snow/column.rs.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> sessions: array<Session>;
@group(0) @binding(1) var<storage, read> runs: array<Run>;
@group(0) @binding(2) var<storage, read> tiles: array<Tile>;
@group(0) @binding(3) var<storage, read_write> states: array<atomic<u32>>;
// Four columns at a time, as the cells.
@group(0) @binding(4) var<storage, read> filled: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read_write> heights: array<u32>;
@group(0) @binding(6) var<storage, read_write> tallies: array<Tally>;
// Lists of tiles, and a word with the length of each.
@group(0) @binding(7) var<storage, read> due: array<u32>;
@group(0) @binding(8) var<storage, read> mass: array<vec4<u32>>;
@group(0) @binding(9) var<storage, read_write> thickness: array<vec4<u32>>;
@group(0) @binding(10) var<storage, read> temperature: array<vec4<f32>>;
@group(0) @binding(11) var<storage, read> stress: array<vec4<f32>>;

// Groups of four columns in a tile.
const GROUPS: u32 = TILE_COLUMNS / 4u;
const THREADS: u32 = 128u;

// Four neighbouring cells.
struct Cells {
    mass: vec4<u32>,
    thickness: vec4<u32>,
    temperature: vec4<f32>,
    stress: vec4<f32>,
}

// Their thickness after a run, and the cycles in which one of them changed.
struct Compacted {
    thickness: vec4<u32>,
    cycles: u32,
}

var<workgroup> lost: array<atomic<u32>, 64>;
var<workgroup> last_change: atomic<u32>;

fn load(i: u32) -> Cells {
    return Cells(mass[i], thickness[i], temperature[i], stress[i]);
}

// A cycle of cells of some hardness; returns their thickness after it.
fn cycle_once(
    session: Session,
    rate: f32,
    excess: vec4<f32>,
    density: vec4<f32>,
    d: vec4<f32>,
    thinnest: vec4<f32>,
) -> vec4<f32> {
    return max(d - indent_of(session, rate, excess, density, d), thinnest);
}

fn compact_cells(session: Session, rate: f32, cycles: u32, cells: Cells) -> Compacted {
    // An empty slot beside filled ones is a cell of one quantum without stress: it stays as it is.
    let quanta = vec4<f32>(max(cells.mass, vec4(1u)));
    let before = vec4<f32>(max(cells.thickness, vec4(1u)));
    // The density that a cell would have in one quantum of thickness.
    let content = quanta * session.density;
    // As dense as snow gets, or as it is already.
    let thinnest = max(min(ceil(quanta * session.densest), before), vec4(1.0));
    var d = before;
    var cycle = 0u;
    // Two loops, so that the common one keeps little in registers: more of it run at a time.
    if is_plain(session, content / before, cells.temperature) {
        let strength = strength_at(session, cells.temperature);
        for (; cycle < cycles; cycle++) {
            let density = content / d;
            let excess = cells.stress - evaluate(strength, density);
            let next = cycle_once(session, rate, excess, density, d, thinnest);
            if all(next == d) {
                break;
            }
            d = next;
        }
    } else {
        for (; cycle < cycles; cycle++) {
            let density = content / d;
            let excess = cells.stress - hardness(session, density, cells.temperature);
            let next = cycle_once(session, rate, excess, density, d, thinnest);
            if all(next == d) {
                break;
            }
            d = next;
        }
    }
    return Compacted(cells.thickness - vec4<u32>(before - d), cycle);
}

// A group of columns that a thread works on, its first slot, and how far it is to the next. At the
// far edges of a snowpack tiles have fewer groups, and more threads for each of them.
struct Share {
    columns: u32,
    slot: u32,
    stride: u32,
}

fn share_of(thread: u32, shape: u32) -> Share {
    let across = ((shape & 0xffu) + 3u) / 4u;
    let groups = across * ((shape >> 8u) & 0xffu);
    let group = thread % groups;
    let columns = group / across * (TILE_SIDE / 4u) + group % across;
    return Share(columns, thread / groups, THREADS / groups);
}

@compute @workgroup_size(THREADS)
fn compact(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let index = flat_index(group, groups);
    let listed = due[work.length];
    if index >= listed {
        return;
    }
    var entry = index;
    if (work.flags & BACKWARDS) != 0u {
        entry = listed - 1u - index;
    }
    let tile = due[work.first + entry];
    let row = tiles[tile];
    let state = atomicLoad(&states[tile]);
    let share = share_of(thread, row.shape);
    let columns = share.columns;
    let most = filled[tile * GROUPS + columns];
    // Threads that are left over have nothing to do.
    let end = select(0u, max(max(most.x, most.y), max(most.z, most.w)), share.slot < share.stride);

    // The first cells are on their way while it is found out what is to be done with them.
    var slot = share.slot;
    var place = (row.row + slot) * GROUPS + columns;
    var cells: Cells;
    if slot < end {
        cells = load(place);
    }
    let session = sessions[row.session];
    let run = runs[row.session];
    let awake = (state & AWAKE) != 0u || (run.flags & ALWAYS_AWAKE) != 0u;
    let loaded = (row.shape & LOADED) != 0u && (work.flags & LISTED) == 0u;
    // Under objects each cycle after the first has contacts evaluated before it, and a pass of its
    // own.
    let first_only = loaded && (work.flags & UNDER_OBJECTS) == 0u;
    // `press` has them where loads press.
    let pressed = loaded && run.press > 0u;
    let stepped = (work.flags & STEPPED) != 0u;
    if session.hardness_law == ALPINE && !pressed {
        // Alpine snow settles with the weather, not from cycle to cycle.
        if thread == 0u && work.cycle < run.cycles {
            atomicAnd(&states[tile], ~AWAKE);
        }
        return;
    }
    let rate = select(run.rate, work.rate, stepped);
    if !awake || pressed || work.cycle >= run.cycles || (first_only && work.cycle > 0u) {
        return;
    }
    let cycles = select(min(run.cycles - work.cycle, work.cycles), 1u, first_only);

    var last = 0u;
    var shrunk = vec4(0u);
    while slot < end {
        let here = place;
        let current = cells;
        slot += share.stride;
        place += share.stride * GROUPS;
        if slot < end {
            cells = load(place);
        }
        let after = compact_cells(session, rate, cycles, current);
        if after.cycles > 0u {
            thickness[here] = after.thickness;
            shrunk += current.thickness - after.thickness;
            last = max(last, after.cycles);
        }
    }
    if last > 0u {
        atomicAdd(&lost[4u * columns], shrunk.x);
        atomicAdd(&lost[4u * columns + 1u], shrunk.y);
        atomicAdd(&lost[4u * columns + 2u], shrunk.z);
        atomicAdd(&lost[4u * columns + 3u], shrunk.w);
        atomicMax(&last_change, last);
    }
    workgroupBarrier();
    if thread < TILE_COLUMNS {
        let change = atomicLoad(&lost[thread]);
        if change > 0u {
            heights[tile * TILE_COLUMNS + thread] -= change;
        }
    }
    if thread == 0u {
        let changed = atomicLoad(&last_change);
        if changed < cycles && !stepped {
            atomicAnd(&states[tile], ~AWAKE);
        } else {
            atomicOr(&states[tile], AWAKE);
        }
        if changed > 0u {
            atomicOr(&states[tile], DIRTY);
            atomicMax(&tallies[run.tally].last_change, work.cycle + changed);
        }
    }
}
