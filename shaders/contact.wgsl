// Evaluates how objects touch the snow: a workgroup for each object. The twin of Contact::evaluate
// in firn-snow/contact.rs, and of what firn-snow/snowpack.rs compares it with.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> sessions: array<Session>;
@group(0) @binding(1) var<storage, read> runs: array<Run>;
@group(0) @binding(2) var<storage, read> heights: array<u32>;
@group(0) @binding(3) var<storage, read> ground: array<u32>;
@group(0) @binding(4) var<storage, read> colliders: array<Collider>;
@group(0) @binding(5) var<storage, read> spans: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> contacts: array<Contact>;

const THREADS: u32 = 256u;

var<workgroup> highest: atomic<u32>;
var<workgroup> support_low: atomic<u32>;
var<workgroup> support_high: atomic<u32>;

// Elevation of the footprint's column at an index into its bounding box; NONE beside it.
fn elevation_at(session: Session, collider: Collider, index: u32) -> u32 {
    let extent = collider.x1 - collider.x0;
    let row = index / extent;
    let x = collider.x0 + index % extent;
    let span = spans[collider.first_span + row];
    if x < span.x || x >= span.y {
        return NONE;
    }
    let column = column_index(session, x, collider.z0 + row);
    return ground[column] + (heights[column] >> 1u);
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
        let elevation = elevation_at(session, collider, i);
        if elevation != NONE {
            atomicMax(&highest, elevation);
        }
    }
    workgroupBarrier();
    let bottom = atomicLoad(&highest);

    // Sums of integers don't depend on their order.
    var low = 0u;
    var high = 0u;
    for (var i = thread; i < places; i += THREADS) {
        let elevation = elevation_at(session, collider, i);
        if elevation != NONE {
            let units = share_units(bottom, elevation);
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

fn write_contact(collider: Collider, bottom: u32, support: vec2<u32>) {
    let old = contacts[collider.contact];
    let placed = (work.flags & AFTER_EDITS) != 0u && collider.placed != 0u;
    let same = old.last_bottom == bottom && old.last_support_low == support.x
        && old.last_support_high == support.y;
    let sum = f32(support.y) * 4294967296.0 + f32(support.x);
    let area = collider.area * (sum / (f32(collider.columns) * f32(CONTACT_DEPTH)));
    var fresh: Contact;
    fresh.bottom = bottom;
    fresh.reference = select(old.reference, bottom, placed);
    fresh.support_low = support.x;
    fresh.support_high = support.y;
    fresh.area = area;
    fresh.pressure = collider.weight / area;
    fresh.width = sqrt(area);
    fresh.resting = select(0u, 1u, same && !placed);
    fresh.last_bottom = select(old.last_bottom, NONE, placed);
    fresh.last_support_low = old.last_support_low;
    fresh.last_support_high = old.last_support_high;
    if collider.runs != 0u {
        fresh.last_bottom = bottom;
        fresh.last_support_low = support.x;
        fresh.last_support_high = support.y;
    }
    contacts[collider.contact] = fresh;
}
