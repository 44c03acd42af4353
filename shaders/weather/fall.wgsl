// What comes from above onto a column: snow and hoar. The twin of firn-snow/alpine/fall.rs.

// Density of hoar [kg/m3].
const HOAR_DENSITY: f32 = 150.0;
// Difference in density at which snow tops up the cell below, as a part of the new snow's.
const ALIKE_SNOW: f32 = 0.4;

// What came into a column and left it.
struct Exchange {
    refused: u32,
    deposited: u32,
    sublimated: u32,
    runoff: u32,
}

// Lets the snow fall that is due; returns how many cells there are then.
fn snow_falls(column: Column, cells: u32, weather: WeatherStep, exchange: ptr<function, Exchange>) -> u32 {
    if cells > 0u {
        let top = load_cell(column, cells - 1u);
        let fresh = f32(weather.snow) / f32(weather.snow_thickness);
        let present = f32(top.mass) / f32(top.thickness);
        if water_in(top) == 0u && top.thickness + weather.snow_thickness <= CELL
            && abs(present - fresh) <= ALIKE_SNOW * fresh {
            let before = bitcast<f32>(top.word);
            let part = f32(weather.snow) / (f32(top.mass) + f32(weather.snow));
            let celsius = before + (weather.snow_temperature - before) * part;
            let both = top.thickness + weather.snow_thickness;
            store_cell(column, cells - 1u, Cell(top.mass + weather.snow, both, heat_word(celsius, 0u)));
            return cells;
        }
    }
    var left = weather.snow;
    var depth = weather.snow_thickness;
    var count = cells;
    while depth > 0u && count < column.slots {
        let piece = min(depth, CELL);
        let share = min(part_of(left, f32(piece) / f32(depth)), left);
        store_cell(column, count, Cell(share, piece, heat_word(weather.snow_temperature, 0u)));
        left -= share;
        depth -= piece;
        count++;
    }
    (*exchange).refused = left;
    return count;
}

// Lays hoar on the topmost cell; returns a cell of its own where it doesn't fit there.
fn lay_hoar(column: Column, cells: u32, hoar: u32, metres: f32, skin: f32) -> Cell {
    if hoar == 0u {
        return Cell(0u, 0u, 0u);
    }
    var top = load_cell(column, cells - 1u);
    let depth = max(u32(round(kilograms(hoar) / HOAR_DENSITY / metres)), 1u);
    if top.thickness + depth > CELL && cells < column.slots {
        return Cell(hoar, depth, bitcast<u32>(skin));
    }
    top.mass += hoar;
    top.thickness = min(top.thickness + depth, CELL);
    store_cell(column, cells - 1u, top);
    return Cell(0u, 0u, 0u);
}
