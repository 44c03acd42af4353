// A cycle of the tiles under objects in snowpacks whose snow is pressed rather than that it creeps under them: a
// workgroup for each tile, a thread for each column, from the top down. The twin of firn-snow/column/press.rs.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> sessions: array<Session>;
@group(0) @binding(1) var<storage, read> runs: array<Run>;
@group(0) @binding(2) var<storage, read> tiles: array<Tile>;
@group(0) @binding(3) var<storage, read_write> states: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read> filled: array<u32>;
@group(0) @binding(5) var<storage, read_write> heights: array<u32>;
@group(0) @binding(6) var<storage, read_write> tallies: array<Tally>;
// A list of tiles, and a word with its length.
@group(0) @binding(7) var<storage, read> due: array<u32>;
@group(0) @binding(8) var<storage, read> mass: array<u32>;
@group(0) @binding(9) var<storage, read_write> thickness: array<u32>;
@group(0) @binding(10) var<storage, read> temperature: array<f32>;
@group(0) @binding(11) var<storage, read> stress: array<f32>;

// A cell. No number of its quanta of thickness is above 2^24: a float holds each of them.
struct Cell {
    // Density that it would have in one quantum of thickness [kg/m3].
    content: f32,
    temperature: f32,
    stress: f32,
    // Thickness at the largest density, and now.
    thinnest: f32,
    thickness: f32,
}

var<workgroup> any_changed: atomic<u32>;

// Hardness at four thicknesses.
fn hardness_at(session: Session, cell: Cell, d: vec4<f32>) -> vec4<f32> {
    return hardness(session, cell.content / d, vec4(cell.temperature));
}

// The largest thickness from `least` up to below `present` at which the cell is as hard as wanted, where it is
// at `least`. Of four in between some are: so the search goes on in a fifth.
fn thickest(session: Session, cell: Cell, wanted: f32, least: f32, present: f32) -> f32 {
    var low = least;
    var high = present;
    while high - low > 1.0 {
        let part = max(floor((high - low) / 5.0), 1.0);
        let between = min(low + part * vec4(1.0, 2.0, 3.0, 4.0), vec4(high));
        let carries = (hardness_at(session, cell, between) >= vec4(wanted)) & (between < vec4(high));
        let count = select(select(select(select(0.0, 1.0, carries.x), 2.0, carries.y), 3.0, carries.z), 4.0, carries.w);
        if count < 4.0 {
            high = min(low + part * (count + 1.0), high);
        }
        low += part * count;
    }
    return low;
}

// Thickness after a cycle in which a load presses the cell by up to `step`.
fn pressed(session: Session, cell: Cell, weight: f32, step: f32) -> f32 {
    let present = cell.thickness;
    let least = max(cell.thinnest, present - step);
    let found = hardness_at(session, cell, vec4(present, least, least, least));
    // What still gives way to the snow above it is pressed no further than by the load alone.
    let wanted = select(cell.stress, found.x + (cell.stress - weight), found.x < weight);
    if found.x >= wanted || least >= present {
        return present;
    }
    if found.y < wanted {
        return least;
    }
    return thickest(session, cell, wanted, least, present);
}

// Thickness after a cycle in which it creeps.
fn crept(session: Session, rate: f32, cell: Cell) -> f32 {
    let d = vec4(cell.thickness);
    let excess = vec4(cell.stress) - hardness_at(session, cell, d);
    let indent = indent_of(session, rate, excess, cell.content / d, d).x;
    return max(cell.thickness - indent, min(cell.thinnest, cell.thickness));
}

@compute @workgroup_size(64)
fn press(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) column: u32,
) {
    let index = flat_index(group, groups);
    if index >= work.count {
        return;
    }
    let tile = due[work.first + index];
    let row = tiles[tile];
    let session = sessions[row.session];
    let run = runs[row.session];
    let awake = (atomicLoad(&states[tile]) & AWAKE) != 0u || (run.flags & ALWAYS_AWAKE) != 0u;
    if !awake || run.press == 0u || work.cycle >= run.cycles {
        return;
    }
    let stepped = (work.flags & STEPPED) != 0u;
    let rate = select(run.rate, work.rate, stepped);
    let most = f32(select(run.press, work.press, stepped));
    let place = tile * TILE_COLUMNS + column;
    let cells = filled[place];
    var sum = 0u;
    var lost = 0u;
    for (var rank = 0u; rank < cells; rank++) {
        let i = (row.row + cells - 1u - rank) * TILE_COLUMNS + column;
        sum += mass[i];
        // The same sum as in the stress: equal where nothing else is in that.
        let weight = GRAVITY * (f32(sum) * MASS_QUANTUM);
        let quanta = f32(mass[i]);
        let thinnest = max(ceil(quanta * session.densest), 1.0);
        let before = f32(thickness[i]);
        let cell = Cell(quanta * session.density, temperature[i], stress[i], thinnest, before);
        var after = before;
        if session.hardness_law == ALPINE {
            // It settles under its own weight, and carries the load alone.
            if cell.stress > weight {
                let strength = alpine_strength(quanta, cell.temperature);
                let load = cell.stress - weight;
                let found = alpine_pressed(strength, cell.content, load, u32(thinnest), u32(before));
                after = max(f32(found), before - most);
            }
        } else if cell.stress > weight {
            after = pressed(session, cell, weight, most);
        } else {
            after = crept(session, rate, cell);
        }
        if after != before {
            thickness[i] = u32(after);
            lost += u32(before - after);
        }
    }
    if lost > 0u {
        heights[place] -= lost;
        atomicStore(&any_changed, 1u);
    }
    workgroupBarrier();
    if column == 0u {
        if atomicLoad(&any_changed) == 0u {
            // What rests in a step need not rest in a cycle.
            if !stepped {
                atomicAnd(&states[tile], ~AWAKE);
            }
        } else {
            atomicOr(&states[tile], AWAKE | DIRTY);
            atomicMax(&tallies[run.tally].last_change, work.cycle + 1u);
        }
    }
}
