// Evaluates the vertical stress in the columns of listed tiles, top to bottom: the weight of the
// snow and the loads of the objects on it, gathered in ascending order of the objects' ids. A tile
// in which a bit of a stress changes wakes. The twin of Column::stress in firn-snow/column.rs.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> sessions: array<Session>;
@group(0) @binding(1) var<storage, read> runs: array<Run>;
@group(0) @binding(2) var<storage, read> tiles: array<Tile>;
@group(0) @binding(3) var<storage, read_write> states: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read> heights: array<u32>;
@group(0) @binding(5) var<storage, read> filled: array<u32>;
@group(0) @binding(6) var<storage, read> ground: array<Elevation>;
@group(0) @binding(7) var<storage, read> colliders: array<Collider>;
@group(0) @binding(8) var<storage, read> spans: array<vec2<u32>>;
@group(0) @binding(9) var<storage, read> contacts: array<Contact>;
@group(0) @binding(10) var<storage, read> load_jobs: array<LoadJob>;
// Indexes into `colliders`.
@group(0) @binding(11) var<storage, read> loads: array<u32>;
@group(0) @binding(12) var<storage, read> mass: array<u32>;
@group(0) @binding(13) var<storage, read> thickness: array<u32>;
@group(0) @binding(14) var<storage, read_write> stress: array<f32>;
// How high undersides that are not flat are over the columns, in thickness quanta.
@group(0) @binding(15) var<storage, read> lifts: array<u32>;

// Loads on one column that are kept in registers; any more are looked up for every cell.
const KEPT: u32 = 4u;

var<workgroup> any_changed: atomic<u32>;

// Surface stress and width of a load on a column; nothing where the object is not above it.
fn load_on(session: Session, load: u32, position: vec2<u32>, surface: Elevation) -> vec2<f32> {
    let collider = colliders[load];
    let row = position.y - collider.z0;
    if position.y < collider.z0 || row >= collider.rows {
        return vec2(0.0);
    }
    let span = spans[collider.first_span + row];
    if position.x < span.x || position.x >= span.y {
        return vec2(0.0);
    }
    let contact = contacts[collider.contact];
    var touching = surface;
    if collider.first_lift != NONE {
        let index = row * (collider.x1 - collider.x0) + position.x - collider.x0;
        touching = less(surface, lifts[collider.first_lift + index]);
    }
    let share = f32(share_units(contact.bottom, touching)) / f32(CONTACT_DEPTH);
    return vec2(contact.pressure * share, contact.width);
}

// Cells of a column that are fetched together, while those above them are evaluated.
const AT_ONCE: u32 = 4u;

struct Cells {
    mass: vec4<u32>,
    thickness: vec4<u32>,
    stress: vec4<f32>,
}

// The topmost of the lowest `count` cells of a column, from above; the lowest again where they are
// fewer than four. How thick they are matters under loads alone.
fn load(row: u32, count: u32, column: u32, loaded: bool) -> Cells {
    let top = vec4(max(count, 1u) - 1u);
    let i = (row + top - min(top, vec4(0u, 1u, 2u, 3u))) * TILE_COLUMNS + column;
    var cells: Cells;
    cells.mass = vec4(mass[i.x], mass[i.y], mass[i.z], mass[i.w]);
    if loaded {
        cells.thickness = vec4(thickness[i.x], thickness[i.y], thickness[i.z], thickness[i.w]);
    }
    cells.stress = vec4(stress[i.x], stress[i.y], stress[i.z], stress[i.w]);
    return cells;
}

@compute @workgroup_size(64)
fn evaluate_stress(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) column: u32,
) {
    let index = flat_index(group, groups);
    if index >= work.count {
        return;
    }
    let job = load_jobs[work.first + index];
    let tile = job.tile;
    let row = tiles[tile];
    let session = sessions[row.session];
    if (work.flags & AFTER_EDITS) == 0u && work.cycle >= runs[row.session].cycles {
        return;
    }
    let position = column_position(session, tile, column);
    let place = tile * TILE_COLUMNS + column;
    let surface = surface_of(ground[place], heights[place]);

    // Loads on this column: the first ones, and where the rest begin.
    var kept: array<vec2<f32>, KEPT>;
    var count = 0u;
    var next = job.first_load;
    let end = job.first_load + job.loads;
    while next < end && count < KEPT {
        let load = load_on(session, loads[next], position, surface);
        if load.x > 0.0 {
            kept[count] = load;
            count++;
        }
        next++;
    }

    var sum = 0u;
    var above = 0u;
    var changed = false;
    let cells = filled[place];
    let loaded = job.loads > 0u;
    var below = load(row.row, cells, column, loaded);
    for (var first = 0u; first < cells; first += AT_ONCE) {
        let here = below;
        below = load(row.row, cells - min(cells, first + AT_ONCE), column, loaded);
        for (var i = 0u; i < AT_ONCE && first + i < cells; i++) {
            let rank = first + i;
            sum += here.mass[i];
            let d = here.thickness[i];
            let depth = (f32(above) + 0.5 * f32(d)) * session.metres;
            var load_stress = 0.0;
            for (var j = 0u; j < count; j++) {
                load_stress += kept[j].x * spread(session.load_distribution, depth, kept[j].y, rank == 0u);
            }
            for (var j = next; j < end; j++) {
                let more = load_on(session, loads[j], position, surface);
                if more.x > 0.0 {
                    load_stress += more.x * spread(session.load_distribution, depth, more.y, rank == 0u);
                }
            }
            let sigma = GRAVITY * (f32(sum) * MASS_QUANTUM) + load_stress;
            if bitcast<u32>(sigma) != bitcast<u32>(here.stress[i]) {
                stress[(row.row + cells - 1u - rank) * TILE_COLUMNS + column] = sigma;
                changed = true;
            }
            above += d;
        }
    }
    if changed {
        atomicStore(&any_changed, 1u);
    }
    workgroupBarrier();
    if column == 0u && atomicLoad(&any_changed) != 0u {
        atomicOr(&states[tile], AWAKE);
    }
}
