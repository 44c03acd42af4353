// Heat that is conducted through snow and soil, eliminated from below. The twin of firn-snow/alpine/conduction.rs.

// Thickness [m] of the layers of soil, from the top down.
const SOIL_THICKNESS: vec4<f32> = vec4(0.1, 0.2, 0.4, 0.8);
// [W/(m K)]
const SOIL_CONDUCTIVITY: f32 = 0.5;
// [J/(m3 K)]
const SOIL_CAPACITY: f32 = 2.5e6;
// Of the water in the soil, which freezes from 0 down to -1 degrees C [J/m3].
const SOIL_FUSION: f32 = 0.5 * 334000.0 * 1000.0;
// Least half of a cell's resistance [m2 K/W], that of some micrometres of snow: through less, f32 tells no heat that is
// conducted from the rounding of temperatures.
const LEAST_HALF: f32 = 1e-4;
// From below the soil [W/m2].
const GROUND_HEAT: f32 = 2.0;

// Half the resistance of an element [m2 K/W].
fn half_resistance(thickness: f32, conductivity: f32) -> f32 {
    return 0.5 * thickness / conductivity;
}

// Half the resistance of a cell: its ice conducts.
fn half_of(cell: Cell, metres: f32) -> f32 {
    let thickness = f32(cell.thickness) * metres;
    let density = kilograms(cell.mass - water_in(cell)) / thickness;
    let conductivity = 2.5e-6 * density * density - 1.23e-4 * density + 0.024;
    return max(half_resistance(thickness, conductivity), LEAST_HALF);
}

// Heat that warms a layer of soil by 1 K [J/(m2 K)].
fn capacity_of_soil(layer: u32, celsius: f32) -> f32 {
    let freezes = celsius > -1.0 && celsius < 0.0;
    return (SOIL_CAPACITY + select(0.0, SOIL_FUSION, freezes)) * SOIL_THICKNESS[layer];
}

// An element in terms of the one above; `down` and `up` are the conductances to its neighbours.
fn eliminated(below: Eliminated, down: f32, up: f32, capacity: f32, celsius: f32, heat: f32) -> Eliminated {
    let whole = capacity + down * (1.0 - below.bound) + up;
    return Eliminated((capacity * celsius + heat + down * below.free) / whole, up / whole);
}

// The ground and the snow, eliminated.
struct Stack {
    soil: array<Eliminated, 4>,
    top: Eliminated,
    // Half the resistance of the topmost element.
    half: f32,
}

fn eliminate(column: Column, cells: u32, soil: vec4<f32>, metres: f32, source: f32, seconds: f32) -> Stack {
    var stack: Stack;
    var below = Eliminated(0.0, 1.0);
    // Conductance to the element below; none under the soil.
    var down = 0.0;
    var own = half_resistance(SOIL_THICKNESS[3], SOIL_CONDUCTIVITY);
    var next: Cell;
    var above = 0.0;
    if cells > 0u {
        next = load_cell(column, 0u);
        above = half_of(next, metres);
    }
    for (var i = 0u; i < 4u; i++) {
        let layer = 3u - i;
        let capacity = capacity_of_soil(layer, soil[layer]) / seconds;
        var over = above;
        if layer > 0u {
            over = half_resistance(SOIL_THICKNESS[layer - 1u], SOIL_CONDUCTIVITY);
        }
        let up = 1.0 / (own + over);
        below = eliminated(below, down, up, capacity, soil[layer], select(0.0, GROUND_HEAT, i == 0u));
        stack.soil[layer] = below;
        stack.half = own;
        down = up;
        own = over;
    }
    for (var slot = 0u; slot < cells; slot++) {
        let cell = next;
        stack.half = own;
        above = 0.0;
        if slot + 1u < cells {
            next = load_cell(column, slot + 1u);
            above = half_of(next, metres);
        }
        let up = 1.0 / (own + above);
        let heat = select(0.0, source, slot + 1u == cells);
        below = eliminated(below, down, up, capacity_of(cell) / seconds, celsius_in(cell), heat);
        keep_eliminated(column, slot, below);
        down = up;
        own = above;
    }
    stack.top = below;
    return stack;
}
