// Liquid water in a cell of alpine snow. A temperature of 2 or more is none: its bits are those of 2.0 and the water in
// quanta. The twin of firn-snow/alpine/wet.rs.

// The bits of 2.0.
const WET: u32 = 0x40000000u;

fn water_of(temperature: f32) -> u32 {
    return select(0u, bitcast<u32>(temperature) - WET, temperature >= 2.0);
}

// What stands for so much water; nothing where there is none.
fn wet(water: u32) -> f32 {
    return select(0.0, bitcast<f32>(WET + water), water > 0u);
}

fn celsius_of(temperature: f32) -> f32 {
    return select(temperature, 0.0, temperature >= 2.0);
}
