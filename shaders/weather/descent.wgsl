// What goes through a column from the skin down. The twin of firn-snow/alpine/descent.rs.

// Part of the pores that holds water against gravity.
const HELD: f32 = 0.05;

// A cell in the middle of a step, when it may be warmer than 0 degrees C, or cold and wet.
struct Layer {
    ice: u32,
    water: u32,
    thickness: u32,
    celsius: f32,
}

// What has come down from the cells above.
struct Descent {
    metres: f32,
    seconds: f32,
    // Mass that leaves as vapour, from water first where the skin melts.
    vapour: u32,
    from_water: bool,
    // Energy that melts [J/m2]; that of the skin, and of cells that are gone.
    energy: f32,
    water: u32,
    // Mass of the cells above.
    above: u32,
}

// Takes off ice, and thickness with it.
fn lose(layer: ptr<function, Layer>, ice: u32) {
    if ice == 0u {
        return;
    }
    let left = (*layer).ice - ice;
    let thickness = max(part_of((*layer).thickness, f32(left) / f32((*layer).ice)), 1u);
    (*layer).ice = left;
    (*layer).thickness = min(thickness, (*layer).thickness);
}

fn sublimate(descent: ptr<function, Descent>, layer: ptr<function, Layer>) {
    if (*descent).vapour == 0u {
        return;
    }
    if (*descent).from_water {
        let water = min((*descent).vapour, (*layer).water);
        (*layer).water -= water;
        (*descent).vapour -= water;
    }
    let ice = min((*descent).vapour, (*layer).ice);
    lose(layer, ice);
    (*descent).vapour -= ice;
}

fn melt(descent: ptr<function, Descent>, layer: ptr<function, Layer>) {
    if (*layer).ice == 0u {
        return;
    }
    if (*layer).celsius > 0.0 {
        (*descent).energy += capacity((*layer).ice, (*layer).water) * (*layer).celsius;
        (*layer).celsius = 0.0;
    }
    if (*descent).energy <= 0.0 {
        return;
    }
    if (*layer).celsius < 0.0 {
        let heat = capacity((*layer).ice, (*layer).water);
        let cold = -(*layer).celsius * heat;
        if (*descent).energy < cold {
            (*layer).celsius += (*descent).energy / heat;
            (*descent).energy = 0.0;
            return;
        }
        (*descent).energy -= cold;
        (*layer).celsius = 0.0;
    }
    let melted = min(quanta_of((*descent).energy / FUSION), (*layer).ice);
    let all_of_it = melted == (*layer).ice;
    lose(layer, melted);
    (*layer).water += melted;
    (*descent).energy = select(0.0, (*descent).energy - FUSION * kilograms(melted), all_of_it);
}

// Part of a cell that is not ice [m].
fn pores_of(descent: Descent, layer: Layer) -> f32 {
    return f32(layer.thickness) * descent.metres - kilograms(layer.ice) / ICE_DENSITY;
}

// Takes in the water from above, which freezes by the cell's cold as far as ice has room.
fn soak(descent: ptr<function, Descent>, layer: ptr<function, Layer>) {
    let heat = capacity((*layer).ice, (*layer).water) * (*layer).celsius;
    (*layer).water += (*descent).water;
    (*descent).water = 0u;
    if (*layer).water > 0u {
        let cold = quanta_of(-heat / FUSION);
        let room = quanta_of(pores_of(*descent, *layer) * ICE_DENSITY);
        let frozen = min(min(cold, (*layer).water), room);
        (*layer).ice += frozen;
        (*layer).water -= frozen;
        let left = heat + FUSION * kilograms(frozen);
        let celsius = left / capacity((*layer).ice, 0u);
        (*layer).celsius = select(celsius, 0.0, frozen == cold);
    }
}

// Lets go of the water that the pores don't hold. Cold snow with water left has no pores to speak of.
fn drain(descent: ptr<function, Descent>, layer: ptr<function, Layer>) {
    let pores = pores_of(*descent, *layer);
    let held = select(quanta_of(HELD * WATER_DENSITY * pores), 0u, (*layer).celsius < 0.0);
    if (*layer).water > held {
        (*descent).water = (*layer).water - held;
        (*layer).water = held;
    }
}

fn settle(descent: Descent, layer: ptr<function, Layer>) {
    let quanta = (*layer).ice + (*layer).water;
    let thickness = f32((*layer).thickness) * descent.metres;
    let density = kilograms(quanta) / thickness;
    let wetness = kilograms((*layer).water) / (WATER_DENSITY * thickness);
    let celsius = min((*layer).celsius, 0.0);
    let overburden = GRAVITY * (f32(descent.above) + 0.5 * f32(quanta)) * MASS_QUANTUM;
    let viscosity = 1.5 * 7.62237e6 * (density / 250.0) * exp(-0.1 * celsius + 0.023 * density)
        / (1.0 + 60.0 * wetness);
    let growth = 1e-6 * exp(celsius / 23.8 - max(density - 150.0, 0.0) / 21.7);
    let strain = min((overburden / viscosity + growth) * descent.seconds, 0.5);
    let settled = part_of((*layer).thickness, exp(-strain));
    let solid = kilograms((*layer).ice) / ICE_DENSITY + kilograms((*layer).water) / WATER_DENSITY;
    let least = u32(ceil(solid / descent.metres));
    (*layer).thickness = clamp(max(settled, least), 1u, CELL);
}

fn pass_through(descent: ptr<function, Descent>, layer: ptr<function, Layer>) {
    sublimate(descent, layer);
    melt(descent, layer);
    if (*layer).ice > 0u {
        soak(descent, layer);
    }
    if (*layer).ice == 0u {
        (*descent).energy += capacity(0u, (*layer).water) * (*layer).celsius;
        (*descent).water += (*layer).water;
        (*layer).water = 0u;
        return;
    }
    drain(descent, layer);
    settle(*descent, layer);
    (*descent).above += (*layer).ice + (*layer).water;
}
