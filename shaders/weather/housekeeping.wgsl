// Cells that are joined, so that a column needs few of them. The twin of firn-snow/alpine/housekeeping.rs.

// A topmost cell with less mass [kg/m2], or thinner than this, is joined with the one below.
const SCRAP_MASS: f32 = 0.3;
const SCRAP_THICKNESS: u32 = CELL / 50u;
// [kg/m2]
const LAST_SCRAP: f32 = 0.05;
const THIN: u32 = 10066329u;
// Largest difference between densities that are joined, as a part of their mean.
const ALIKE_CELLS: f32 = 0.2;
const FEW: u32 = 20u;
const TOO_FEW: u32 = 4u;

fn density_of(cell: Cell, metres: f32) -> f32 {
    return kilograms(cell.mass) / (f32(cell.thickness) * metres);
}

// Whether a cell is joined with the one below it, with so many free slots.
fn joins(below: Cell, cell: Cell, free: u32, metres: f32) -> bool {
    if cell.thickness >= THIN || !fit(below, cell) {
        return false;
    }
    let one = density_of(below, metres);
    let other = density_of(cell, metres);
    return free < FEW || abs(one - other) <= ALIKE_CELLS * 0.5 * (one + other);
}

// Joins a topmost scrap with the cell below; returns how many cells there are then.
fn join_top(column: Column, cells: u32, snows: bool) -> u32 {
    if cells < 2u {
        return cells;
    }
    let top = load_cell(column, cells - 1u);
    let below = load_cell(column, cells - 2u);
    let scrap = kilograms(top.mass) < SCRAP_MASS || top.thickness < SCRAP_THICKNESS;
    if !scrap || (snows && water_in(top) == 0u) || !fit(below, top) {
        return cells;
    }
    store_cell(column, cells - 2u, merge(below, top));
    return cells - 1u;
}

// Joins thin cells with those below, but for the topmost two.
fn join_inner(column: Column, cells: u32, metres: f32) -> u32 {
    if cells < 4u {
        return cells;
    }
    let inner = cells - 2u;
    var free = column.slots - min(cells, column.slots);
    var kept = 0u;
    var below = load_cell(column, 0u);
    for (var upper = 1u; upper < cells; upper++) {
        let cell = load_cell(column, upper);
        if upper < inner && joins(below, cell, free, metres) {
            below = merge(below, cell);
            free++;
        } else {
            store_cell(column, kept, below);
            kept++;
            below = cell;
        }
    }
    store_cell(column, kept, below);
    return kept + 1u;
}

// Joins the thinnest and most alike pair that fits one cell, where there is one.
fn join_least(column: Column, cells: u32, metres: f32) -> u32 {
    var found = NONE;
    var least = 0.0;
    for (var lower = 0u; lower + 1u < cells; lower++) {
        let below = load_cell(column, lower);
        let above = load_cell(column, lower + 1u);
        let unlike = abs(density_of(below, metres) - density_of(above, metres));
        let weight = f32(below.thickness + above.thickness) * (1.0 + unlike / 50.0);
        if fit(below, above) && (found == NONE || weight < least) {
            found = lower;
            least = weight;
        }
    }
    if found == NONE {
        return cells;
    }
    store_cell(column, found, merge(load_cell(column, found), load_cell(column, found + 1u)));
    for (var slot = found + 1u; slot + 1u < cells; slot++) {
        store_cell(column, slot, load_cell(column, slot + 1u));
    }
    return cells - 1u;
}

// Whether snow of that mass alone is a last scrap.
fn is_last_scrap(column: Column, cells: u32, snows: bool) -> bool {
    return cells == 1u && !snows && kilograms(load_cell(column, 0u).mass) < LAST_SCRAP;
}
