// Copies the topmost cells of columns to where the host reads them: a thread for each cell that a
// column may have. The twin of what firn-engine's cpu/job.rs reads of its columns.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> tiles: array<Tile>;
@group(0) @binding(1) var<storage, read> filled: array<u32>;
@group(0) @binding(2) var<storage, read> column_jobs: array<ColumnJob>;
@group(0) @binding(3) var<storage, read> column_lists: array<u32>;
@group(0) @binding(4) var<storage, read_write> column_cells: array<ColumnCell>;
@group(0) @binding(5) var<storage, read> mass: array<u32>;
@group(0) @binding(6) var<storage, read> thickness: array<u32>;
@group(0) @binding(7) var<storage, read> temperature: array<f32>;
@group(0) @binding(8) var<storage, read> stress: array<f32>;

@compute @workgroup_size(64)
fn columns(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let job = column_jobs[work.first];
    let index = flat_index(group, groups) * 64u + thread;
    if index >= job.columns * job.cells {
        return;
    }
    let column = column_lists[job.first_column + index / job.cells];
    let tile = tiles[column / TILE_COLUMNS];
    if tile.page != work.page {
        return;
    }
    let cells = filled[column];
    let slot = cells - min(cells, job.cells) + index % job.cells;
    var copy = ColumnCell();
    if slot < cells {
        let cell = (tile.row + slot) * TILE_COLUMNS + column % TILE_COLUMNS;
        copy = ColumnCell(mass[cell], thickness[cell], temperature[cell], stress[cell]);
    }
    column_cells[job.first + index] = copy;
}
