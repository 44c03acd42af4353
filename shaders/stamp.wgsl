// Presses columns of listed tiles at once, by loads that cover a part of each: a workgroup for each tile, a thread
// for each column. The twin of Column::stamp in firn-snow/column/stamp.rs.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> sessions: array<Session>;
@group(0) @binding(1) var<storage, read> tiles: array<Tile>;
@group(0) @binding(2) var<storage, read_write> states: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> heights: array<u32>;
@group(0) @binding(4) var<storage, read> filled: array<u32>;
@group(0) @binding(5) var<storage, read> edit_jobs: array<EditJob>;
// Indexes into `stamps`.
@group(0) @binding(6) var<storage, read> operation_lists: array<u32>;
@group(0) @binding(7) var<storage, read> stamps: array<Stamp>;
@group(0) @binding(8) var<storage, read> shares: array<u32>;
@group(0) @binding(9) var<storage, read_write> operation_results: array<OperationResult>;
@group(0) @binding(10) var<storage, read> mass: array<u32>;
@group(0) @binding(11) var<storage, read_write> thickness: array<u32>;
@group(0) @binding(12) var<storage, read> temperature: array<f32>;

// Shares of a column that is covered whole.
const WHOLE: u32 = 64u;

// A cell that may be pressed.
struct Cell {
    mass: f32,
    temperature: f32,
    // The snow's weight on it [Pa], and the thickness of all above it in quanta, as pressed.
    weight: f32,
    above: u32,
    top: bool,
}

// Whether a cell of a thickness carries what it feels of a load, or feels nothing of it.
fn carries(session: Session, load: Stamp, cell: Cell, d: u32) -> bool {
    let depth = (f32(cell.above) + 0.5 * f32(d)) * session.metres;
    let felt = load.pressure * spread(session.load_distribution, depth, load.width, cell.top);
    if felt <= 0.0 {
        return true;
    }
    let density = cell.mass / f32(d) * session.density;
    return hardness(session, vec4(density), vec4(cell.temperature)).x >= cell.weight + felt;
}

// The largest thickness up to the present one at which the cell carries the load.
fn pressed(session: Session, load: Stamp, cell: Cell, present: u32) -> u32 {
    if carries(session, load, cell, present) {
        return present;
    }
    let densest = max(u32(ceil(cell.mass * session.densest)), 1u);
    var low = min(densest, present);
    if !carries(session, load, cell, low) {
        return low;
    }
    var high = present;
    while high - low > 1u {
        let middle = low + (high - low) / 2u;
        if carries(session, load, cell, middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// Presses a column by a share of the way to where it carries a load; returns the dent.
fn press(session: Session, load: Stamp, base: u32, cells: u32, share: u32) -> u32 {
    var sum = 0u;
    var above = 0u;
    var dent = 0u;
    for (var rank = 0u; rank < cells; rank++) {
        let i = base + (cells - 1u - rank) * TILE_COLUMNS;
        sum += mass[i];
        let weight = GRAVITY * (f32(sum) * MASS_QUANTUM);
        let present = thickness[i];
        let cell = Cell(f32(mass[i]), temperature[i], weight, above, rank == 0u);
        let d = pressed(session, load, cell, present);
        above += d;
        // A cell has at most 2^24 quanta, so that a share of them fits.
        let part = (present - d) * share / WHOLE;
        if part > 0u {
            thickness[i] = present - part;
            dent += part;
        }
    }
    return dent;
}

@compute @workgroup_size(64)
fn stamp(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let index = flat_index(group, groups);
    if index >= work.count {
        return;
    }
    let job = edit_jobs[work.first + index];
    let tile = tiles[job.tile];
    let session = sessions[tile.session];
    let position = column_position(session, job.tile, thread);
    let place = job.tile * TILE_COLUMNS + thread;
    let base = tile.row * TILE_COLUMNS + thread;

    for (var i = 0u; i < job.operations; i++) {
        let load = stamps[operation_lists[job.first_operation + i]];
        if any(position < load.columns.xy) || any(position >= load.columns.zw) {
            continue;
        }
        let place_in = position - load.columns.xy;
        let width = load.columns.z - load.columns.x;
        let share = shares[load.first_share + place_in.y * width + place_in.x];
        if share == 0u {
            continue;
        }
        let dent = press(session, load, base, filled[place], share);
        heights[place] -= dent;
        atomicMax(&operation_results[load.result].low, dent);
    }
    if thread == 0u {
        atomicOr(&states[job.tile], AWAKE | DIRTY);
    }
}
