// Cells of alpine snow, and what a column has beside them. The twin of firn-snow/alpine/wet.rs.

// [J/(kg K)]
const ICE_HEAT: f32 = 2100.0;
const WATER_HEAT: f32 = 4180.0;
// [J/kg]
const FUSION: f32 = 334000.0;
const VAPORISATION: f32 = 2501000.0;
// [kg/m3]
const ICE_DENSITY: f32 = 917.0;
const WATER_DENSITY: f32 = 1000.0;
const MASS_QUANTA: f32 = 262144.0;
// A cell as it is stored.
struct Cell {
    mass: u32,
    thickness: u32,
    // Temperature below 0 degrees C, or water.
    word: u32,
}

fn water_in(cell: Cell) -> u32 {
    return water_of(bitcast<f32>(cell.word));
}

fn celsius_in(cell: Cell) -> f32 {
    return celsius_of(bitcast<f32>(cell.word));
}

fn heat_word(celsius: f32, water: u32) -> u32 {
    return bitcast<u32>(select(min(celsius, 0.0), wet(water), water > 0u));
}

fn kilograms(quanta: u32) -> f32 {
    return f32(quanta) * MASS_QUANTUM;
}

// Quanta of an areal mass [kg/m2], to the nearest; none of a negative one.
fn quanta_of(mass: f32) -> u32 {
    return u32(max(round(mass * MASS_QUANTA), 0.0));
}

// A part of a number of quanta, to the nearest.
fn part_of(quanta: u32, part: f32) -> u32 {
    return u32(max(round(f32(quanta) * part), 0.0));
}

// Heat that warms ice and water by 1 K [J/(m2 K)].
fn capacity(ice: u32, water: u32) -> f32 {
    return ICE_HEAT * kilograms(ice) + WATER_HEAT * kilograms(water);
}

fn capacity_of(cell: Cell) -> f32 {
    let water = water_in(cell);
    return capacity(cell.mass - water, water);
}

// Two cells as one, with their mass and their heat: cold freezes water.
fn merge(lower: Cell, upper: Cell) -> Cell {
    let mass = lower.mass + upper.mass;
    let heat = capacity_of(lower) * celsius_in(lower) + capacity_of(upper) * celsius_in(upper);
    let wet = water_in(lower) + water_in(upper);
    let frozen = min(quanta_of(-heat / FUSION), wet);
    let water = wet - frozen;
    let left = heat + FUSION * kilograms(frozen);
    let celsius = left / capacity(mass - water, water);
    return Cell(mass, lower.thickness + upper.thickness, heat_word(celsius, water));
}

// Whether two cells fit one.
fn fit(one: Cell, other: Cell) -> bool {
    return one.thickness + other.thickness <= CELL;
}
