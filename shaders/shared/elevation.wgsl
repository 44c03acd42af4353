// Elevations in two words. firn-snow/elevation.rs has them in one.

// Where ground under snow of a height has its surface.
fn surface_of(ground: Elevation, height: u32) -> Elevation {
    let fraction = ground.fraction + height % CELL;
    return Elevation(ground.cells + i32(height / CELL + fraction / CELL), fraction % CELL);
}

// The elevation so far below another, in quanta.
fn less(elevation: Elevation, depth: u32) -> Elevation {
    let fraction = elevation.fraction + CELL - depth % CELL;
    return Elevation(elevation.cells - i32(depth / CELL) - 1 + i32(fraction / CELL), fraction % CELL);
}

// How far one elevation lies above another, in quanta. Whole cells are cut to [-1, 32] before they are
// joined with the fractions, so that any relief fits a word: what is farther away touches nothing.
fn difference(upper: Elevation, lower: Elevation) -> i32 {
    let cells = clamp(upper.cells - lower.cells, -1, 32);
    return cells * i32(CELL) + i32(upper.fraction) - i32(lower.fraction);
}

// A column's share of contact in units of 1/CONTACT_DEPTH.
fn share_units(bottom: Elevation, surface: Elevation) -> u32 {
    return CONTACT_DEPTH - u32(clamp(difference(bottom, surface), 0, i32(CONTACT_DEPTH)));
}
