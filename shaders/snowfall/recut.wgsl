// Re-cuts a column whose slots have run out into full cells. A part of snowfall.wgsl, and the twin of
// firn-snow/recut.rs.

// The van Leer slope of a value between its neighbours.
fn van_leer(below: f32, value: f32, above: f32) -> f32 {
    let lower = value - below;
    let upper = above - value;
    if lower * upper > 0.0 {
        return 2.0 * lower * upper / (lower + upper);
    }
    return 0.0;
}

// Density in mass quanta per thickness quantum.
fn density_of(cell: Cell) -> f32 {
    return f32(cell.mass) / f32(cell.thickness);
}

// An old cell, and what has been taken from it so far.
struct Source {
    cell: Cell,
    density_slope: f32,
    temperature_slope: f32,
    taken_mass: u32,
    taken_thickness: u32,
}

// Mass of the next piece of a source, with density linear over height.
fn mass_of(source: Source, piece: u32) -> u32 {
    let d = f32(source.cell.thickness);
    let u0 = f32(source.taken_thickness) / d;
    let u1 = f32(source.taken_thickness + piece) / d;
    let v0 = u0 - 0.5;
    let v1 = u1 - 0.5;
    let fraction = (u1 - u0) + source.density_slope * (v1 * v1 - v0 * v0) / 2.0;
    return u32(max(fraction * f32(source.cell.mass), 0.0));
}

// Mean temperature of the next piece of a mass, with temperature linear over mass.
fn temperature_of(source: Source, piece: u32) -> f32 {
    let whole = f32(source.cell.mass);
    let w0 = f32(source.taken_mass) / whole;
    let w1 = f32(source.taken_mass + piece) / whole;
    return source.cell.temperature + source.temperature_slope * ((w0 + w1) / 2.0 - 0.5);
}

// Moves a piece into a fresh cell: as much as the cell has room for.
fn pour(source: ptr<function, Source>, fresh: ptr<function, Cell>) {
    let left = (*source).cell.thickness - (*source).taken_thickness;
    let piece = min(left, CELL - (*fresh).thickness);
    var poured = (*source).cell.mass - (*source).taken_mass;
    if piece < left {
        // A quantum is kept for the last piece, so that every fresh cell has mass.
        poured = min(mass_of(*source, piece), poured - 1u);
    }
    let celsius = temperature_of(*source, poured);
    if (*fresh).mass == 0u {
        (*fresh).temperature = celsius;
    } else {
        (*fresh).temperature = mixed((*fresh).temperature, (*fresh).mass, celsius, poured);
    }
    (*fresh).mass += poured;
    (*fresh).thickness += piece;
    (*source).taken_mass += poured;
    (*source).taken_thickness += piece;
}

// Re-cuts the whole column in place: a fresh cell's index never exceeds its source's.
fn recut(column: ptr<function, Column>) {
    store_top(column);
    let base = (*column).base;
    let cells = (*column).cells;
    var fresh = Cell(0u, 0u, 0.0);
    var finished = 0u;
    var below = fresh;
    for (var i = 0u; i < cells; i++) {
        var source = Source(load_cell(base, i), 0.0, 0.0, 0u, 0u);
        let cell = source.cell;
        if i > 0u && i + 1u < cells {
            let above = load_cell(base, i + 1u);
            source.density_slope =
                van_leer(density_of(below), density_of(cell), density_of(above)) / density_of(cell);
            source.temperature_slope =
                van_leer(below.temperature, cell.temperature, above.temperature);
        }
        below = cell;
        while source.taken_thickness < cell.thickness {
            pour(&source, &fresh);
            if fresh.thickness == CELL {
                store_cell(base, finished, fresh);
                finished++;
                fresh = Cell(0u, 0u, 0.0);
            }
        }
    }
    if fresh.thickness > 0u {
        store_cell(base, finished, fresh);
        finished++;
    }
    empty_slots(base, finished, cells);
    (*column).cells = finished;
    load_top(column);
}
