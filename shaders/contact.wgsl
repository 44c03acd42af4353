// Evaluates how objects touch the snow: a workgroup for each object. The twin of Contact::evaluate
// in firn-snow/contact.rs, and of what firn-snow/snowpack.rs compares it with.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> sessions: array<Session>;
@group(0) @binding(1) var<storage, read> runs: array<Run>;
@group(0) @binding(2) var<storage, read> heights: array<u32>;
@group(0) @binding(3) var<storage, read> ground: array<Elevation>;
@group(0) @binding(4) var<storage, read> colliders: array<Collider>;
@group(0) @binding(5) var<storage, read> spans: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> contacts: array<Contact>;

const THREADS: u32 = 256u;

// The bottom: its cells, counted from the lowest that there may be, and its fraction.
var<workgroup> highest_cells: atomic<u32>;
var<workgroup> highest_fraction: atomic<u32>;
var<workgroup> support_low: atomic<u32>;
var<workgroup> support_high: atomic<u32>;

// Whole cells in the order of unsigned numbers.
const SIGN: u32 = 0x80000000u;
fn ordered(cells: i32) -> u32 {
    return bitcast<u32>(cells) ^ SIGN;
}

// Surface of the footprint's column at an index into its bounding box; NONE as its fraction beside it.
fn surface_at(session: Session, collider: Collider, index: u32) -> Elevation {
    let extent = collider.x1 - collider.x0;
    let row = index / extent;
    let x = collider.x0 + index % extent;
    let span = spans[collider.first_span + row];
    if x < span.x || x >= span.y {
        return Elevation(0, NONE);
    }
    let column = column_index(session, x, collider.z0 + row);
    return surface_of(ground[column], heights[column]);
}

@compute @workgroup_size(256)
fn contact(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let index = flat_index(group, groups);
    if index >= work.count {
        return;
    }
    let collider = colliders[work.first + index];
    let run = runs[collider.session];
    let evaluated = work.cycle == 0u && (run.flags & EDITED) != 0u;
    if (work.flags & AFTER_EDITS) == 0u && (evaluated || work.cycle >= run.cycles) {
        return;
    }
    let session = sessions[collider.session];
    let places = (collider.x1 - collider.x0) * collider.rows;

    for (var i = thread; i < places; i += THREADS) {
        let surface = surface_at(session, collider, i);
        if surface.fraction != NONE {
            atomicMax(&highest_cells, ordered(surface.cells));
        }
    }
    workgroupBarrier();
    let cells = atomicLoad(&highest_cells);
    for (var i = thread; i < places; i += THREADS) {
        let surface = surface_at(session, collider, i);
        if surface.fraction != NONE && ordered(surface.cells) == cells {
            atomicMax(&highest_fraction, surface.fraction);
        }
    }
    workgroupBarrier();
    let bottom = Elevation(bitcast<i32>(cells ^ SIGN), atomicLoad(&highest_fraction));

    // Sums of integers don't depend on their order.
    var low = 0u;
    var high = 0u;
    for (var i = thread; i < places; i += THREADS) {
        let surface = surface_at(session, collider, i);
        if surface.fraction != NONE {
            let units = share_units(bottom, surface);
            low += units;
            high += select(0u, 1u, low < units);
        }
    }
    let before = atomicAdd(&support_low, low);
    atomicAdd(&support_high, high + select(0u, 1u, before + low < before));
    workgroupBarrier();

    if thread == 0u {
        let support = vec2(atomicLoad(&support_low), atomicLoad(&support_high));
        write_contact(collider, bottom, support);
    }
}

fn write_contact(collider: Collider, bottom: Elevation, support: vec2<u32>) {
    let old = contacts[collider.contact];
    let placed = (work.flags & AFTER_EDITS) != 0u && collider.placed != 0u;
    let same = old.last_bottom.cells == bottom.cells && old.last_bottom.fraction == bottom.fraction
        && old.last_support_low == support.x && old.last_support_high == support.y;
    let sum = f32(support.y) * 4294967296.0 + f32(support.x);
    let area = collider.area * (sum / (f32(collider.columns) * f32(CONTACT_DEPTH)));
    var fresh = old;
    fresh.bottom = bottom;
    if placed {
        fresh.reference = bottom;
        fresh.last_bottom = Elevation(0, NONE);
    }
    fresh.support_low = support.x;
    fresh.support_high = support.y;
    fresh.area = area;
    fresh.pressure = collider.weight / area;
    fresh.width = sqrt(area);
    fresh.resting = select(0u, 1u, same && !placed);
    if collider.runs != 0u {
        fresh.last_bottom = bottom;
        fresh.last_support_low = support.x;
        fresh.last_support_high = support.y;
    }
    contacts[collider.contact] = fresh;
}
