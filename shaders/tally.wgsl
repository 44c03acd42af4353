// Sums the masses of all cells of listed tiles, exactly: a workgroup for each tile.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> tiles: array<Tile>;
@group(0) @binding(1) var<storage, read> filled: array<u32>;
@group(0) @binding(2) var<storage, read> runs: array<Run>;
@group(0) @binding(3) var<storage, read_write> tallies: array<Tally>;
@group(0) @binding(4) var<storage, read> mass: array<u32>;

@compute @workgroup_size(64)
fn tally(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) column: u32,
) {
    let index = flat_index(group, groups);
    if index >= work.count {
        return;
    }
    let tile = work.first + index;
    let row = tiles[tile];
    if row.page != work.page {
        return;
    }
    // A column's mass fits 32 bits.
    var sum = 0u;
    let cells = filled[tile * TILE_COLUMNS + column];
    for (var slot = 0u; slot < cells; slot++) {
        sum += mass[(row.row + slot) * TILE_COLUMNS + column];
    }
    if sum > 0u {
        let sums = runs[row.session].tally;
        let before = atomicAdd(&tallies[sums].mass_low, sum);
        if before + sum < before {
            atomicAdd(&tallies[sums].mass_high, 1u);
        }
    }
}
