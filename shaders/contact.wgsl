// Evaluates how objects touch the snow: a workgroup for each object, that of its first footprint. The twin of Contact::evaluate
// in firn-snow/contact.rs, and of what firn-snow/snowpack.rs compares it with.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> sessions: array<Session>;
@group(0) @binding(1) var<storage, read> runs: array<Run>;
@group(0) @binding(2) var<storage, read> heights: array<u32>;
@group(0) @binding(3) var<storage, read> ground: array<Elevation>;
@group(0) @binding(4) var<storage, read> colliders: array<Collider>;
@group(0) @binding(5) var<storage, read> spans: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> contacts: array<Contact>;
// How high undersides that are not flat are over the columns, in thickness quanta.
@group(0) @binding(7) var<storage, read> lifts: array<u32>;

const THREADS: u32 = 256u;

// The bottom: its cells, counted from the lowest that there may be, and its fraction.
var<workgroup> highest_cells: atomic<u32>;
var<workgroup> highest_fraction: atomic<u32>;
// Sums of shares, for each footprint.
const MOST_FOOTPRINTS: u32 = 16u;
var<workgroup> support_low: array<atomic<u32>, MOST_FOOTPRINTS>;
var<workgroup> support_high: array<atomic<u32>, MOST_FOOTPRINTS>;

// Whole cells in the order of unsigned numbers.
const SIGN: u32 = 0x80000000u;
fn ordered(cells: i32) -> u32 {
    return bitcast<u32>(cells) ^ SIGN;
}

// Surface of the footprint's column at an index into its bounding box, less the underside's lift over it; NONE
// as its fraction beside the footprint.
fn surface_at(session: Session, collider: Collider, index: u32) -> Elevation {
    let extent = collider.x1 - collider.x0;
    let row = index / extent;
    let x = collider.x0 + index % extent;
    let span = spans[collider.first_span + row];
    if x < span.x || x >= span.y {
        return Elevation(0, NONE);
    }
    let column = column_index(session, x, collider.z0 + row);
    let surface = surface_of(ground[column], heights[column]);
    if collider.first_lift == NONE {
        return surface;
    }
    return less(surface, lifts[collider.first_lift + index]);
}

fn places(collider: Collider) -> u32 {
    return (collider.x1 - collider.x0) * collider.rows;
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
    let first = work.first + index;
    let object = colliders[first];
    let end = first + object.footprints;
    let run = runs[object.session];
    let evaluated = work.cycle == 0u && (run.flags & EDITED) != 0u;
    if (work.flags & AFTER_EDITS) == 0u && (evaluated || work.cycle >= run.cycles) {
        return;
    }
    if object.footprints == 0u {
        return;
    }
    let session = sessions[object.session];

    for (var row = first; row < end; row++) {
        let collider = colliders[row];
        for (var i = thread; i < places(collider); i += THREADS) {
            let surface = surface_at(session, collider, i);
            if surface.fraction != NONE {
                atomicMax(&highest_cells, ordered(surface.cells));
            }
        }
    }
    workgroupBarrier();
    let cells = atomicLoad(&highest_cells);
    for (var row = first; row < end; row++) {
        let collider = colliders[row];
        for (var i = thread; i < places(collider); i += THREADS) {
            let surface = surface_at(session, collider, i);
            if surface.fraction != NONE && ordered(surface.cells) == cells {
                atomicMax(&highest_fraction, surface.fraction);
            }
        }
    }
    workgroupBarrier();
    let bottom = Elevation(bitcast<i32>(cells ^ SIGN), atomicLoad(&highest_fraction));

    // Sums of integers don't depend on their order.
    for (var row = first; row < end; row++) {
        let collider = colliders[row];
        var sum = vec2(0u);
        for (var i = thread; i < places(collider); i += THREADS) {
            let surface = surface_at(session, collider, i);
            if surface.fraction != NONE {
                sum = wide_add(sum, vec2(share_units(bottom, surface), 0u));
            }
        }
        let before = atomicAdd(&support_low[row - first], sum.x);
        let carried = select(0u, 1u, before + sum.x < before);
        atomicAdd(&support_high[row - first], sum.y + carried);
    }
    workgroupBarrier();

    if thread == 0u {
        write_contacts(first, end, bottom);
    }
}

fn write_contacts(first: u32, end: u32, bottom: Elevation) {
    var support = vec2(0u);
    var area = 0.0;
    for (var row = first; row < end; row++) {
        let collider = colliders[row];
        let shares = vec2(atomicLoad(&support_low[row - first]), atomicLoad(&support_high[row - first]));
        let own = wide_add(shares, wide_multiply(collider.overhang, CONTACT_DEPTH));
        let sum = f32(own.y) * 4294967296.0 + f32(own.x);
        let touching = collider.area * (sum / (f32(collider.columns) * f32(CONTACT_DEPTH)));
        contacts[collider.contact].width = sqrt(touching);
        area += touching;
        support = wide_add(support, own);
    }
    let collider = colliders[first];
    let pressure = collider.weight / area;
    let contact = touched(collider, bottom, support, area, pressure);
    contacts[collider.contact] = contact;
    // Stresses are evaluated footprint by footprint.
    for (var row = first + 1u; row < end; row++) {
        let other = colliders[row].contact;
        contacts[other].bottom = bottom;
        contacts[other].pressure = pressure;
    }
}

// How the object touches the snow now, in the row of its first footprint.
fn touched(
    collider: Collider,
    bottom: Elevation,
    support: vec2<u32>,
    area: f32,
    pressure: f32,
) -> Contact {
    let old = contacts[collider.contact];
    let placed = (work.flags & AFTER_EDITS) != 0u && collider.placed != 0u;
    let same = old.last_bottom.cells == bottom.cells && old.last_bottom.fraction == bottom.fraction
        && old.last_support_low == support.x && old.last_support_high == support.y;
    var fresh = old;
    fresh.bottom = bottom;
    if placed {
        fresh.reference = bottom;
        fresh.last_bottom = Elevation(0, NONE);
    }
    fresh.support_low = support.x;
    fresh.support_high = support.y;
    fresh.area = area;
    fresh.pressure = pressure;
    fresh.resting = select(0u, 1u, same && !placed);
    if collider.runs != 0u {
        fresh.last_bottom = bottom;
        fresh.last_support_low = support.x;
        fresh.last_support_high = support.y;
    }
    return fresh;
}
