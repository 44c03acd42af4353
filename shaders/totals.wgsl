// Sums up columns of alpine snow where the host reads them: a thread for each column of a rectangle.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> sessions: array<Session>;
@group(0) @binding(1) var<storage, read> tiles: array<Tile>;
@group(0) @binding(2) var<storage, read> filled: array<u32>;
// Rectangles of columns: what is said of heights does not count.
@group(0) @binding(3) var<storage, read> sample_jobs: array<SampleJob>;
@group(0) @binding(4) var<storage, read_write> column_totals: array<ColumnTotals>;
@group(0) @binding(5) var<storage, read> mass: array<u32>;
@group(0) @binding(6) var<storage, read> thickness: array<u32>;
@group(0) @binding(7) var<storage, read> temperature: array<u32>;
@group(0) @binding(8) var<storage, read> stress: array<u32>;

@compute @workgroup_size(64)
fn totals(
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
    let place = column_index(session, job.x0 + index % job.width, job.z0 + index / job.width);
    let tile = tiles[place / TILE_COLUMNS];
    if tile.page != work.page {
        return;
    }
    let base = tile.row * TILE_COLUMNS + place % TILE_COLUMNS;
    var sum = ColumnTotals();
    for (var slot = 0u; slot < filled[place]; slot++) {
        let i = base + slot * TILE_COLUMNS;
        sum.mass += mass[i];
        sum.water += water_of(bitcast<f32>(temperature[i]));
    }
    let first = base + session.height * TILE_COLUMNS;
    let second = first + TILE_COLUMNS;
    sum.surface = array(mass[first], thickness[first], temperature[first], stress[first],
        mass[second], thickness[second], temperature[second], stress[second]);
    column_totals[job.first + index] = sum;
}
