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
// Secants at the most, and quanta on each side of what they find within which halvings go on.
const SECANTS: u32 = 8u;
const AROUND: f32 = 16.0;

// A cell that may be pressed.
struct Cell {
    mass: f32,
    temperature: f32,
    // The snow's weight on it [Pa], and the thickness of all above it in quanta, as pressed.
    weight: f32,
    above: u32,
    top: bool,
}

// How many times over a cell of a thickness carries what is on it; often enough where it feels nothing of the load.
fn strength(session: Session, load: Stamp, cell: Cell, d: f32) -> f32 {
    let depth = (f32(cell.above) + 0.5 * d) * session.metres;
    let felt = load.pressure * spread(session.load_distribution, depth, load.width, cell.top);
    if felt <= 0.0 {
        return 2.0;
    }
    let density = cell.mass / d * session.density;
    if session.hardness_law == ALPINE {
        // It settles under its own weight, and carries the load alone.
        return alpine_hardness(alpine_strength(cell.mass, cell.temperature), density) / felt;
    }
    return hardness(session, vec4(density), vec4(cell.temperature)).x / (cell.weight + felt);
}

// What is about proportional to density: hardness goes about with its square, by Gold's law with its fourth power.
fn root_of(session: Session, strength: f32) -> f32 {
    let root = sqrt(strength);
    if session.hardness_law == CALIBRATED || session.hardness_law == REGRESSION {
        return root;
    }
    return sqrt(root);
}

// The largest thickness up to the present one at which the cell carries the load.
fn pressed(session: Session, load: Stamp, cell: Cell, present: f32) -> f32 {
    let before = strength(session, load, cell, present);
    if before >= 1.0 {
        return present;
    }
    let least = min(max(ceil(cell.mass * session.densest), 1.0), present);
    // What counts as carrying, and the least that is known not to.
    var low = least - 1.0;
    var high = present;
    // Over 1/d a root of the strength is nearly a line, and secants lead next to the thickness that is searched for.
    var last = present;
    var root = root_of(session, before);
    var near = present * root;
    for (var i = 0u; i < SECANTS && high - low > 1.0; i++) {
        let here = clamp(floor(near), low + 1.0, high - 1.0);
        let found = root_of(session, strength(session, load, cell, here));
        if found >= 1.0 {
            low = here;
        } else {
            high = here;
        }
        let slope = max((found - root) / (1.0 / here - 1.0 / last), 0.25 * here);
        near = 1.0 / max(1.0 / here + (1.0 - found) / slope, 1.0 / present);
        // What is left of the error is about the product of the last two.
        let error = abs(near - here) * abs(here - last) / here;
        last = here;
        root = found;
        if error < 0.25 * AROUND {
            break;
        }
    }
    for (var side = -1.0; side < 2.0; side += 2.0) {
        let here = floor(near) + side * AROUND;
        if here > low && here < high {
            if strength(session, load, cell, here) >= 1.0 {
                low = here;
            } else {
                high = here;
            }
        }
    }
    while high - low > 1.0 {
        let middle = low + floor(0.5 * (high - low));
        if strength(session, load, cell, middle) >= 1.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    return max(low, least);
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
        let d = u32(pressed(session, load, cell, f32(present)));
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
