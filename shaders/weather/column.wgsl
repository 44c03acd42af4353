// Where a column of alpine snow is stored: its cells, behind them rows with its surface, and rows for what is
// eliminated in a step.

// Rows behind the slots that hold the surface.
const SURFACE_ROWS: u32 = 2u;

// What a column has beside its cells.
struct Surface {
    albedo: f32,
    skin: f32,
    soil: vec4<f32>,
    runoff: vec2<u32>,
}

// The first word of a column, and how many slots it has.
struct Column {
    base: u32,
    slots: u32,
}

fn slot_of(column: Column, slot: u32) -> u32 {
    return column.base + slot * TILE_COLUMNS;
}

fn load_cell(column: Column, slot: u32) -> Cell {
    let i = slot_of(column, slot);
    return Cell(mass[i], thickness[i], temperature[i]);
}

fn store_cell(column: Column, slot: u32, cell: Cell) {
    let i = slot_of(column, slot);
    mass[i] = cell.mass;
    thickness[i] = cell.thickness;
    temperature[i] = cell.word;
}

fn load_surface(column: Column, job: WeatherJob) -> Surface {
    let first = slot_of(column, column.slots);
    let second = first + TILE_COLUMNS;
    let albedo = bitcast<f32>(mass[first]);
    // Memory that was cleared: the column has not begun yet.
    if albedo == 0.0 {
        let soil = vec4(job.soil_0, job.soil_1, job.soil_2, job.soil_3);
        return Surface(FRESH_ALBEDO, job.skin, soil, vec2(0u));
    }
    let soil = vec4(bitcast<f32>(temperature[first]), bitcast<f32>(stress[first]),
        bitcast<f32>(mass[second]), bitcast<f32>(thickness[second]));
    let runoff = vec2(temperature[second], stress[second]);
    return Surface(albedo, bitcast<f32>(thickness[first]), soil, runoff);
}

fn store_surface(column: Column, surface: Surface) {
    let first = slot_of(column, column.slots);
    let second = first + TILE_COLUMNS;
    mass[first] = bitcast<u32>(surface.albedo);
    thickness[first] = bitcast<u32>(surface.skin);
    temperature[first] = bitcast<u32>(surface.soil.x);
    stress[first] = bitcast<u32>(surface.soil.y);
    mass[second] = bitcast<u32>(surface.soil.z);
    thickness[second] = bitcast<u32>(surface.soil.w);
    temperature[second] = surface.runoff.x;
    stress[second] = surface.runoff.y;
}

// T = free + bound * T of the element above.
struct Eliminated {
    free: f32,
    bound: f32,
}

fn keep_eliminated(column: Column, slot: u32, element: Eliminated) {
    stress[slot_of(column, slot)] = bitcast<u32>(element.free);
    let i = slot_of(column, column.slots + SURFACE_ROWS + slot / 4u);
    let bound = bitcast<u32>(element.bound);
    switch slot % 4u {
        case 0u: { mass[i] = bound; }
        case 1u: { thickness[i] = bound; }
        case 2u: { temperature[i] = bound; }
        default: { stress[i] = bound; }
    }
}

fn kept_eliminated(column: Column, slot: u32) -> Eliminated {
    let free = bitcast<f32>(stress[slot_of(column, slot)]);
    let i = slot_of(column, column.slots + SURFACE_ROWS + slot / 4u);
    var bound: u32;
    switch slot % 4u {
        case 0u: { bound = mass[i]; }
        case 1u: { bound = thickness[i]; }
        case 2u: { bound = temperature[i]; }
        default: { bound = stress[i]; }
    }
    return Eliminated(free, bitcast<f32>(bound));
}
