// Lets snow fall on the columns of listed tiles, and lays and clears it: a workgroup for each tile, a thread
// for each column. Objects keep some of it off the columns under them. Tops up, opens cells and re-cuts
// (snowfall/recut.wgsl) where slots run out. The twin of Column::deposit and Column::clear in
// firn-snow/column.rs.

var<immediate> work: Pass;
@group(0) @binding(0) var<storage, read> sessions: array<Session>;
@group(0) @binding(1) var<storage, read> tiles: array<Tile>;
@group(0) @binding(2) var<storage, read_write> states: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> heights: array<u32>;
@group(0) @binding(4) var<storage, read_write> filled: array<u32>;
@group(0) @binding(5) var<storage, read> edit_jobs: array<EditJob>;
@group(0) @binding(6) var<storage, read> operations: array<Operation>;
@group(0) @binding(7) var<storage, read_write> operation_results: array<OperationResult>;
@group(0) @binding(8) var<storage, read_write> mass: array<u32>;
@group(0) @binding(9) var<storage, read_write> thickness: array<u32>;
@group(0) @binding(10) var<storage, read_write> temperature: array<f32>;
@group(0) @binding(11) var<storage, read_write> stress: array<f32>;
@group(0) @binding(12) var<storage, read> operation_lists: array<u32>;

const DEPOSIT: u32 = 0u;
const CLEAR: u32 = 1u;
const LAY: u32 = 2u;
// Largest difference in temperature at which fresh snow tops up the cell below [degrees C].
const TOP_UP_TEMPERATURE: f32 = 0.25;

// A piece of snow.
struct Cell {
    mass: u32,
    thickness: u32,
    temperature: f32,
}

// A column while it is worked on: its first cell, its slots, whether its snow is alpine, how many slots are filled, the
// thickness of all of them together, and the topmost cell, which is stored when another one is laid on it, and in the
// end.
struct Column {
    base: u32,
    slots: u32,
    alpine: bool,
    cells: u32,
    height: u32,
    top: Cell,
}

// Snow that is still to be laid on a column, and the mass of a full cell of it.
struct Fall {
    mass: u32,
    depth: u32,
    share: u32,
    temperature: f32,
}

fn cell_index(base: u32, slot: u32) -> u32 {
    return base + slot * TILE_COLUMNS;
}

fn load_cell(base: u32, slot: u32) -> Cell {
    let i = cell_index(base, slot);
    return Cell(mass[i], thickness[i], temperature[i]);
}

fn store_cell(base: u32, slot: u32, cell: Cell) {
    let i = cell_index(base, slot);
    mass[i] = cell.mass;
    thickness[i] = cell.thickness;
    temperature[i] = cell.temperature;
}

fn load_top(column: ptr<function, Column>) {
    if (*column).cells > 0u {
        (*column).top = load_cell((*column).base, (*column).cells - 1u);
    }
}

fn store_top(column: ptr<function, Column>) {
    if (*column).cells > 0u {
        store_cell((*column).base, (*column).cells - 1u, (*column).top);
    }
}

fn empty_slots(base: u32, first: u32, end: u32) {
    for (var slot = first; slot < end; slot++) {
        store_cell(base, slot, Cell(0u, 0u, 0.0));
        stress[cell_index(base, slot)] = 0.0;
    }
}

// Temperature of snow to which other snow is added.
fn mixed(old: f32, old_mass: u32, added: f32, added_mass: u32) -> f32 {
    return old + (added - old) * (f32(added_mass) / f32(old_mass + added_mass));
}

// Takes off a piece of a thickness, and returns its mass.
fn take(fall: ptr<function, Fall>, piece: u32) -> u32 {
    var taken = (*fall).mass;
    if piece < (*fall).depth {
        taken = wide_shift_24(wide_multiply((*fall).share, piece));
    }
    (*fall).depth -= piece;
    (*fall).mass -= taken;
    return taken;
}

// Whether snow tops up a cell: there is room in it, and it is much like the snow that falls.
fn is_like(cell: Cell, share: u32, celsius: f32) -> bool {
    if cell.thickness >= CELL || abs(cell.temperature - celsius) > TOP_UP_TEMPERATURE {
        return false;
    }
    // Densities are compared as masses, crosswise, so that no rounding decides.
    let own = wide_multiply(cell.mass, CELL);
    let like = wide_multiply(share, cell.thickness);
    var difference = wide_subtract(own, like);
    if wide_less(own, like) {
        difference = wide_subtract(like, own);
    }
    return difference.y < 1u << 26u && !wide_less(like, wide_scale(difference, 20u));
}

// Adds snow to a cell.
fn add(cell: ptr<function, Cell>, mass: u32, thickness: u32, celsius: f32) {
    (*cell).temperature = mixed((*cell).temperature, (*cell).mass, celsius, mass);
    (*cell).mass += mass;
    (*cell).thickness += thickness;
}

// Fills the top cell up to full thickness where it is much like the snow that falls.
fn top_up(column: ptr<function, Column>, fall: ptr<function, Fall>) {
    var cell = (*column).top;
    if (*column).cells == 0u || !is_like(cell, (*fall).share, (*fall).temperature) {
        return;
    }
    let piece = min((*fall).depth, CELL - cell.thickness);
    add(&cell, take(fall, piece), piece, (*fall).temperature);
    (*column).height += piece;
    (*column).top = cell;
}

// Opens full cells, the last one thinner, as long as there are slots.
fn open_cells(column: ptr<function, Column>, fall: ptr<function, Fall>) {
    while (*fall).depth > 0u && (*column).cells < (*column).slots {
        let piece = min((*fall).depth, CELL);
        var taken = take(fall, piece);
        if taken == 0u {
            // Too thin a rest to have a quantum of mass of its own.
            if (*column).cells == 0u || (*column).top.mass - water_of((*column).top.temperature) <= 1u {
                (*fall).depth = 0u;
                return;
            }
            (*column).top.mass -= 1u;
            taken = 1u;
        }
        store_top(column);
        (*column).top = Cell(taken, piece, (*fall).temperature);
        (*column).height += piece;
        (*column).cells++;
    }
}

// Lays snow on the column; returns the mass that did not fit.
fn deposit(column: ptr<function, Column>, snow: Fall) -> u32 {
    if snow.depth == 0u {
        return snow.mass;
    }
    var fall = snow;
    top_up(column, &fall);
    open_cells(column, &fall);
    // No cell of alpine snow is cut anew to make room: water would go astray.
    if fall.depth > 0u && !(*column).alpine {
        recut(column);
        open_cells(column, &fall);
    }
    return fall.mass;
}

// Removes what is above a depth; returns the mass removed. The cell that is cut keeps its part of
// the mass, rounded down, and goes whole where that is nothing.
fn clear(column: ptr<function, Column>, depth: u32) -> u32 {
    store_top(column);
    let base = (*column).base;
    var left = depth;
    var cleared = 0u;
    var kept_cells = 0u;
    var height = 0u;
    for (var slot = 0u; slot < (*column).cells; slot++) {
        var cell = load_cell(base, slot);
        let kept = min(cell.thickness, left);
        left -= kept;
        if kept < cell.thickness {
            let part = wide_divide(wide_multiply(cell.mass, kept), cell.thickness);
            cleared += cell.mass - part;
            let water = water_of(cell.temperature);
            if water > 0u {
                cell.temperature = wet(wide_divide(wide_multiply(water, kept), cell.thickness));
            }
            cell.mass = part;
            cell.thickness = kept;
            if part > 0u {
                store_cell(base, slot, cell);
            }
        }
        if cell.mass > 0u {
            kept_cells = slot + 1u;
            height += cell.thickness;
        }
    }
    empty_slots(base, kept_cells, (*column).cells);
    (*column).cells = kept_cells;
    (*column).height = height;
    load_top(column);
    return cleared;
}

fn add_result(result: u32, quanta: u32) {
    if quanta > 0u {
        let before = atomicAdd(&operation_results[result].low, quanta);
        if before + quanta < before {
            atomicAdd(&operation_results[result].high, 1u);
        }
    }
}

// What falls in an operation; in a clearing, what is left standing, without a mass.
fn fall_of(index: u32) -> Fall {
    let snow = operations[index].snow;
    return Fall(snow.x, snow.y, snow.z, bitcast<f32>(snow.w));
}

// What an object keeps from a column.
struct Cover {
    sheltered: bool,
    stood_on: bool,
}

fn cover_of(job: EditJob, thread: u32) -> Cover {
    let high = thread >= 32u;
    let sheltered = select(job.sheltered_low, job.sheltered_high, high);
    let stood_on = select(job.stood_on_low, job.stood_on_high, high);
    let bit = 1u << (thread % 32u);
    return Cover((sheltered & bit) != 0u, (stood_on & bit) != 0u);
}

// Does an operation on a column where that is little: it is about other columns, or lays snow of
// which the topmost cell takes all. Returns whether it was. Most are, and of what lets others be done
// some devices go through all of it for every operation.
fn do_lightly(column: ptr<function, Column>, position: vec2<u32>, cover: Cover, index: u32) -> bool {
    let columns = operations[index].columns;
    if any(position < columns.xy) || any(position >= columns.zw) {
        return true;
    }
    let kind = operations[index].kind;
    if (cover.sheltered && kind == DEPOSIT) || (cover.stood_on && kind == CLEAR) {
        return true;
    }
    let fall = fall_of(index);
    var cell = (*column).top;
    let room = CELL - min(cell.thickness, CELL);
    let fits = fall.mass > 0u && fall.depth > 0u && fall.depth <= room && (*column).cells > 0u;
    if !fits || !is_like(cell, fall.share, fall.temperature) {
        return false;
    }
    add(&cell, fall.mass, fall.depth, fall.temperature);
    (*column).height += fall.depth;
    (*column).top = cell;
    return true;
}

// Does an operation on a column.
fn do_heavily(column: ptr<function, Column>, index: u32) {
    let fall = fall_of(index);
    var quanta = 0u;
    let kind = operations[index].kind;
    if kind == DEPOSIT || kind == LAY {
        quanta = deposit(column, fall);
    } else {
        quanta = clear(column, fall.depth);
    }
    add_result(operations[index].result, quanta);
}

@compute @workgroup_size(64)
fn snowfall(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let index = flat_index(group, groups);
    if index >= work.count {
        return;
    }
    let job = edit_jobs[work.first + index];
    let tile = tiles[job.tile];
    let session = sessions[tile.session];
    let position = column_position(session, job.tile, thread);
    let place = job.tile * TILE_COLUMNS + thread;
    let base = tile.row * TILE_COLUMNS + thread;
    let cover = cover_of(job, thread);
    let alpine = session.hardness_law == ALPINE;
    var column =
        Column(base, session.height, alpine, filled[place], heights[place], Cell(0u, 0u, 0.0));
    load_top(&column);

    let end = job.first_operation + job.operations;
    var next = job.first_operation;
    while next < end {
        while next < end && do_lightly(&column, position, cover, operation_lists[next]) {
            next++;
        }
        if next < end {
            do_heavily(&column, operation_lists[next]);
            next++;
        }
    }
    store_top(&column);

    filled[place] = column.cells;
    heights[place] = column.height;
    if thread == 0u {
        atomicOr(&states[job.tile], AWAKE | DIRTY);
    }
}
