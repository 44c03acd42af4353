// The layout of the thesis that Firn's model comes from, for comparison only: one struct for each
// cell of the fixed grid, five kernels for each cycle. What it moves through memory is what counts;
// what it computes is about right. To every field that is written a zero from the host is added, so
// that no compiler leaves out what seems unchanged.

struct Cell {
    grid_index: array<i32, 3>,
    position: array<f32, 3>,
    index: u32,
    indent: f32,
    compression: f32,
    pressure: array<f32, 3>,
    applied_pressure: array<f32, 3>,
    hardness: f32,
    density: f32,
    temperature: f32,
    grain_size: f32,
    mass: f32,
    overlying_mass: f32,
    state: i32,
}

struct Column {
    height: f32,
    mass: f32,
}

struct Grid {
    width: u32,
    height: u32,
    depth: u32,
    cell_size: f32,
    dt: f32,
    snow_height: f32,
    zero: f32,
    integer_zero: i32,
}

@group(0) @binding(0) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read_write> cells: array<Cell>;
@group(0) @binding(2) var<storage, read_write> columns: array<Column>;

const AIR: i32 = 0;
const SNOW: i32 = 1;
const THREADS: u32 = 64u;

fn store(i: u32, cell: Cell) {
    let zero = grid.zero;
    let none = grid.integer_zero;
    let g = cell.grid_index;
    let at = cell.position;
    let p = cell.pressure;
    let a = cell.applied_pressure;
    cells[i] = Cell(
        array(g[0] + none, g[1] + none, g[2] + none),
        array(at[0] + zero, at[1] + zero, at[2] + zero),
        cell.index + u32(none),
        cell.indent + zero,
        cell.compression + zero,
        array(p[0] + zero, p[1] + zero, p[2] + zero),
        array(a[0] + zero, a[1] + zero, a[2] + zero),
        cell.hardness + zero,
        cell.density + zero,
        cell.temperature + zero,
        cell.grain_size + zero,
        cell.mass + zero,
        cell.overlying_mass + zero,
        cell.state + none,
    );
}

fn flat_index(group: vec3<u32>, groups: vec3<u32>, thread: u32) -> u32 {
    return (group.y * groups.x + group.x) * THREADS + thread;
}

fn cell_count() -> u32 {
    return grid.width * grid.height * grid.depth;
}

// First cell of a column, and how far it is to the next one above.
fn column_base(column: u32) -> u32 {
    return column % grid.width + column / grid.width * grid.width * grid.height;
}

fn hardness(density: f32, t: f32) -> f32 {
    return max(
        -0.16599 + 0.542153 * density - 0.08925 * t + 0.447667 * density * density
            + 0.159256 * density * t - 0.01336 * t * t - 0.15863 * density * density * t
            + 0.022601 * density * t * t + 0.260723 * t * t * t,
        0.0,
    );
}

// A thread for each cell: where it is and what it is made of.
@compute @workgroup_size(64)
fn populate(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = flat_index(group, groups, thread);
    if i >= cell_count() {
        return;
    }
    var cell = cells[i];
    let x = i % grid.width;
    let y = i / grid.width % grid.height;
    let z = i / (grid.width * grid.height);
    cell.grid_index = array(i32(x), i32(y), i32(z));
    cell.position =
        array(f32(x) * grid.cell_size, f32(y) * grid.cell_size, f32(z) * grid.cell_size);
    cell.index = i;
    let column = columns[x + z * grid.width];
    let filled = min(column.height, grid.snow_height);
    cell.state = select(AIR, SNOW, (f32(y) + 0.5) * grid.cell_size < filled);
    cell.hardness = hardness(cell.density, cell.temperature);
    store(i, cell);
}

// A thread for each column, top to bottom: the weight of what is above.
@compute @workgroup_size(64)
fn pressures(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let column = flat_index(group, groups, thread);
    if column >= grid.width * grid.depth {
        return;
    }
    var above = 0.0;
    for (var y = grid.height; y > 0u; y--) {
        let i = column_base(column) + (y - 1u) * grid.width;
        var cell = cells[i];
        above += select(0.0, cell.mass, cell.state == SNOW);
        cell.overlying_mass = above;
        let area = grid.cell_size * grid.cell_size;
        cell.pressure[1] = above * 9.81 / area + cell.applied_pressure[1];
        store(i, cell);
    }
}

// A thread for each cell: how far it gives way.
@compute @workgroup_size(64)
fn apply(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = flat_index(group, groups, thread);
    if i >= cell_count() {
        return;
    }
    var cell = cells[i];
    if cell.state == SNOW {
        let excess = max(cell.pressure[1] - cell.hardness, 0.0);
        cell.indent = min(excess / pow(cell.density, 3.56) * grid.dt, 0.99 * grid.cell_size);
        cell.compression += cell.indent;
        cell.density = min(cell.density * grid.cell_size / (grid.cell_size - cell.indent), 100.0);
    }
    store(i, cell);
}

// A thread for each column, bottom to top: back to cells of one size.
@compute @workgroup_size(64)
fn resample(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let column = flat_index(group, groups, thread);
    if column >= grid.width * grid.depth {
        return;
    }
    let volume = grid.cell_size * grid.cell_size * grid.cell_size;
    var lost = 0.0;
    for (var y = 0u; y < grid.height; y++) {
        let i = column_base(column) + y * grid.width;
        var cell = cells[i];
        lost += cell.indent;
        cell.mass = cell.density * volume;
        cell.compression = lost;
        store(i, cell);
    }
}

// A thread for each column: its height and mass.
@compute @workgroup_size(64)
fn update_columns(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let column = flat_index(group, groups, thread);
    if column >= grid.width * grid.depth {
        return;
    }
    var total = Column(0.0, 0.0);
    for (var y = 0u; y < grid.height; y++) {
        let cell = cells[column_base(column) + y * grid.width];
        if cell.state == SNOW {
            total.height += grid.cell_size - cell.indent;
            total.mass += cell.mass;
        }
    }
    columns[column] = total;
}
