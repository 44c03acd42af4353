// Samples the fixed grid from the material cells: a thread for each column of a box. The twin of
// firn-snow/sample.rs.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> sessions: array<Session>;
@group(0) @binding(1) var<storage, read> tiles: array<Tile>;
@group(0) @binding(2) var<storage, read> filled: array<u32>;
@group(0) @binding(3) var<storage, read> ground: array<Elevation>;
@group(0) @binding(4) var<storage, read> sample_jobs: array<SampleJob>;
@group(0) @binding(5) var<storage, read_write> samples: array<Sample>;
@group(0) @binding(6) var<storage, read> mass: array<u32>;
@group(0) @binding(7) var<storage, read> thickness: array<u32>;
@group(0) @binding(8) var<storage, read> temperature: array<f32>;
@group(0) @binding(9) var<storage, read> stress: array<f32>;

const AIR: u32 = 0u;
const SNOW: u32 = 1u;
const GROUND: u32 = 2u;

// The column's cells among the samples.
struct Target {
    first: u32,
    stride: u32,
    y0: u32,
    height: u32,
    side: f32,
}

fn sample_of_content(content: u32) -> Sample {
    var cell = Sample();
    cell.content = content;
    return cell;
}

fn write_sample(place: Target, y: u32, cell: Sample) {
    if y >= place.y0 && y < place.y0 + place.height {
        samples[place.first + (y - place.y0) * place.stride] = cell;
    }
}

// Turns sums into means and writes them.
fn finish(place: Target, y: u32, sums: Sample) {
    if !(sums.fill > 0.0) {
        return;
    }
    var cell = sums;
    cell.content = SNOW;
    cell.density = sums.mass / (sums.fill * place.side);
    cell.temperature = sums.temperature / sums.mass;
    cell.hardness = sums.hardness / sums.fill;
    cell.stiffness = sums.stiffness / sums.fill;
    cell.stress = sums.stress / sums.fill;
    cell.load_stress = sums.load_stress / sums.fill;
    cell.indent = sums.indent / sums.fill;
    write_sample(place, y, cell);
}

@compute @workgroup_size(64)
fn sample(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let job = sample_jobs[work.first];
    let index = flat_index(group, groups) * 64u + thread;
    if index >= job.width * job.depth {
        return;
    }
    let session = sessions[job.session];
    let i = index % job.width;
    let k = index / job.width;
    let column = column_index(session, job.x0 + i, job.z0 + k);
    let tile = tiles[column / TILE_COLUMNS];
    if tile.page != work.page {
        return;
    }
    let first = job.first + k * job.height * job.width + i;
    let place = Target(first, job.width, job.y0, job.height, session.metres * f32(CELL));

    // The column begins inside the cell that its ground ends in.
    var y = 0u;
    var full = 0u;
    if job.floor.fraction != NONE {
        let above = ground[column];
        y = u32(above.cells - job.floor.cells) - u32(above.fraction < job.floor.fraction);
        full = (above.fraction - job.floor.fraction) % CELL;
    }
    for (var j = job.y0; j < job.y0 + job.height; j++) {
        write_sample(place, j, sample_of_content(select(AIR, GROUND, j < y)));
    }

    let base = tile.row * TILE_COLUMNS + column % TILE_COLUMNS;
    let cells = filled[column];
    var above = 0u;
    for (var slot = 0u; slot < cells; slot++) {
        above += mass[base + slot * TILE_COLUMNS];
    }
    var sums = Sample();
    for (var slot = 0u; slot < cells; slot++) {
        let cell = base + slot * TILE_COLUMNS;
        let quanta = f32(mass[cell]);
        let d = thickness[cell];
        let celsius = celsius_of(temperature[cell]);
        let sigma = stress[cell];
        let density = quanta / f32(d) * session.density;
        // The law takes four cells at a time; here they are all the same.
        var hard = hardness(session, vec4(density), vec4(celsius)).x;
        if session.hardness_law == ALPINE {
            hard = alpine_hardness(alpine_strength(quanta, temperature[cell]), density);
        }
        let stiffness = pow(density, session.stiffness_exponent);
        let load_stress = max(sigma - GRAVITY * (f32(above) * MASS_QUANTUM), 0.0);
        // Alpine snow settles with the weather, not from cycle to cycle.
        let excess = vec4(select(sigma - hard, 0.0, session.hardness_law == ALPINE));
        let x = indent_of(session, job.rate, excess, vec4(density), vec4(f32(d))).x * session.metres;
        above -= mass[cell];
        var left = d;
        while left > 0u {
            let overlap = min(left, CELL - full);
            let fill = f32(overlap) / f32(CELL);
            let part = quanta * MASS_QUANTUM * (f32(overlap) / f32(d));
            sums.fill += fill;
            sums.mass += part;
            sums.temperature += celsius * part;
            sums.hardness += hard * fill;
            sums.stiffness += stiffness * fill;
            sums.stress += sigma * fill;
            sums.load_stress += load_stress * fill;
            sums.indent += x * fill;
            sums.liquid_water += f32(water_of(temperature[cell])) * MASS_QUANTUM * (f32(overlap) / f32(d));
            left -= overlap;
            full += overlap;
            if full == CELL {
                finish(place, y, sums);
                sums = Sample();
                y++;
                full = 0u;
            }
        }
    }
    finish(place, y, sums);
}
