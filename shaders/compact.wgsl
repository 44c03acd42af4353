// Compacts the cells of listed tiles: a workgroup for each tile, its threads striding over the
// cells. Stress is constant meanwhile, so all cycles of a run go in registers. A tile in which the
// last cycle changed no quantum goes to rest. The twin of Compaction in src/snow/column.rs.

@group(0) @binding(0) var<uniform> work: Pass;
@group(0) @binding(1) var<storage, read> sessions: array<Session>;
@group(0) @binding(2) var<storage, read> runs: array<Run>;
@group(0) @binding(3) var<storage, read> tiles: array<Tile>;
@group(0) @binding(4) var<storage, read_write> states: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read> tops: array<u32>;
@group(0) @binding(6) var<storage, read_write> heights: array<u32>;
@group(0) @binding(7) var<storage, read_write> tallies: array<Tally>;
// The list of tiles: its length, then the tiles.
@group(0) @binding(8) var<storage, read> due: array<u32>;
@group(0) @binding(9) var<storage, read> mass: array<u32>;
@group(0) @binding(10) var<storage, read_write> thickness: array<u32>;
@group(0) @binding(11) var<storage, read> temperature: array<f32>;
@group(0) @binding(12) var<storage, read> stress: array<f32>;

const THREADS: u32 = 256u;

var<workgroup> lost: array<atomic<u32>, 64>;
var<workgroup> last_change: atomic<u32>;

@compute @workgroup_size(256)
fn compact(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let index = flat_index(group, groups);
    if index >= due[work.first] {
        return;
    }
    let tile = due[work.first + 1u + index];
    let row = tiles[tile];
    let session = sessions[row.session];
    let run = runs[row.session];
    let awake = (atomicLoad(&states[tile]) & AWAKE) != 0u || run.always_awake != 0u;
    if !awake || work.cycle >= run.cycles {
        return;
    }
    let cycles = min(run.cycles - work.cycle, work.cycles);

    let column = thread % TILE_COLUMNS;
    let end = (row.row + tops[tile]) * TILE_COLUMNS;
    var last = 0u;
    var shrunk = 0u;
    for (var cell = row.row * TILE_COLUMNS + thread; cell < end; cell += THREADS) {
        let quanta = mass[cell];
        if quanta == 0u {
            continue;
        }
        let cell_mass = f32(quanta);
        let cell_temperature = temperature[cell];
        let sigma = stress[cell];
        let before = thickness[cell];
        let densest = u32(ceil(cell_mass * session.densest));
        var d = before;
        var cycle = 0u;
        for (; cycle < cycles; cycle++) {
            let x = indent_of(session, run.rate, cell_mass, f32(d), cell_temperature, sigma);
            let next = max(d - x, max(min(densest, d), 1u));
            if next == d {
                break;
            }
            d = next;
        }
        if d != before {
            thickness[cell] = d;
            shrunk += before - d;
            last = max(last, cycle);
        }
    }
    if shrunk > 0u {
        atomicAdd(&lost[column], shrunk);
        atomicMax(&last_change, last);
    }
    workgroupBarrier();
    if thread < TILE_COLUMNS {
        let change = atomicLoad(&lost[thread]);
        if change > 0u {
            heights[tile * TILE_COLUMNS + thread] -= change;
        }
    }
    if thread == 0u {
        let changed = atomicLoad(&last_change);
        if changed < cycles {
            atomicAnd(&states[tile], ~AWAKE);
        } else {
            atomicOr(&states[tile], AWAKE);
        }
        if changed > 0u {
            atomicOr(&states[tile], DIRTY);
            atomicMax(&tallies[row.session].last_change, work.cycle + changed);
        }
    }
}
