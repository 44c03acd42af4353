// Hardness of alpine snow, and how far loads press it. The twin of firn-snow/alpine/hardness.rs and column/alpine.rs.

// Of dry snow of 500 kg/m3 at -5 degrees C [Pa].
const ALPINE_HARDNESS: f32 = 100000.0;
const ALPINE_EXPONENT: f32 = 3.92;
// Water, as a part of the volume, above which snow gets no softer.
const SOAKED: f32 = 0.02;
// A cell that would lose less than this part of its thickness, as a power of 1/2, is at rest.
const REST: u32 = 14u;
const MOST_WET_TURNS: u32 = 16u;

// What hardness of a cell owes to its temperature and its water.
struct AlpineStrength {
    // Hardness of dry snow of 500 kg/m3 [Pa].
    warmth: f32,
    // Water in a unit of density, as a part of the volume [m3/kg].
    wet: f32,
}

fn alpine_strength(mass: f32, temperature: f32) -> AlpineStrength {
    let warmth = ALPINE_HARDNESS * exp(-0.063 * (celsius_of(temperature) + 5.0));
    return AlpineStrength(warmth, f32(water_of(temperature)) / mass / 1000.0);
}

// The factor of a power of density.
fn alpine_factor(strength: AlpineStrength, density: f32) -> f32 {
    return strength.warmth * (1.0 - 2.0 / 3.0 * min(strength.wet * density / SOAKED, 1.0));
}

fn alpine_hardness(strength: AlpineStrength, density: f32) -> f32 {
    return pow(density / 500.0, ALPINE_EXPONENT) * alpine_factor(strength, density);
}

// The thickness to which a load's stress presses a cell of some content and least thickness: the present one where it
// carries it.
fn alpine_pressed(strength: AlpineStrength, content: f32, stress: f32, least: u32, present: u32) -> u32 {
    var thickness = present;
    for (var turn = 0u; turn < MOST_WET_TURNS; turn++) {
        let density = content / f32(thickness);
        let carrying = 500.0 * pow(stress / alpine_factor(strength, density), 1.0 / ALPINE_EXPONENT);
        let next = max(u32(min(content / carrying, f32(thickness))), least);
        if next + (thickness >> REST) >= thickness {
            break;
        }
        thickness = next;
        if strength.wet == 0.0 {
            break;
        }
    }
    return thickness;
}
