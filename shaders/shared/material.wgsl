// Hardness of snow and how far it gives way, of four cells at a time; the twin of
// firn-snow/material.rs and of Compaction in firn-snow/column.rs.

const CALIBRATED: u32 = 0u;
const REGRESSION: u32 = 1u;
// The coefficient of the temperature's cube in the calibrated law.
const CALIBRATED_CUBE: f32 = 0.260723;
// Part of its thickness by which a cell is compacted in one cycle at the most.
const LARGEST_INDENT: f32 = 0.99;

// The regression polynomial of Barakhtanov et al. as one of density alone, at four temperatures.
struct Strength {
    constant: vec4<f32>,
    linear: vec4<f32>,
    square: vec4<f32>,
    cube: f32,
}

// The polynomial with its two disputed cubic coefficients, a of density and b of temperature.
fn polynomial(t: vec4<f32>, a: f32, b: f32) -> Strength {
    return Strength(
        -0.16599 + t * (-0.08925 + t * (-0.01336 + t * b)),
        0.542153 + t * (0.159256 + t * 0.022601),
        0.447667 + t * -0.15863,
        a,
    );
}

fn evaluate(strength: Strength, r: vec4<f32>) -> vec4<f32> {
    let higher = strength.square + r * strength.cube;
    return max(strength.constant + r * (strength.linear + r * higher), vec4(0.0));
}

// What hardness owes to temperature, for the laws that are polynomials.
fn strength_at(session: Session, temperature: vec4<f32>) -> Strength {
    if session.hardness_law == CALIBRATED {
        return polynomial(temperature, 0.0, CALIBRATED_CUBE);
    }
    return polynomial(temperature, 0.261043, -0.00032);
}

// Whether some of the snow is so cold that it would soften with more cold, by the calibrated
// polynomial: where that rises with temperature. Denser snow does not where lighter snow doesn't.
fn softens_with_cold(r: vec4<f32>, t: vec4<f32>) -> bool {
    let constant = -0.08925 + t * (2.0 * -0.01336 + t * (3.0 * CALIBRATED_CUBE));
    let linear = 0.159256 + t * (2.0 * 0.022601);
    return any(constant + r * (linear - r * 0.15863) > vec4(0.0));
}

// The temperature [degrees C] below which it does.
fn coldest_stiffening(r: vec4<f32>) -> vec4<f32> {
    let a = 3.0 * CALIBRATED_CUBE;
    let b = 2.0 * (0.022601 * r - 0.01336);
    let c = -0.08925 + 0.159256 * r - 0.15863 * r * r;
    return (-b - sqrt(b * b - 4.0 * a * c)) / (2.0 * a);
}

// Whether the strength tells all about hardness, at these densities and at all higher ones.
fn is_plain(session: Session, density: vec4<f32>, temperature: vec4<f32>) -> bool {
    if session.hardness_law == CALIBRATED {
        return !softens_with_cold(density, temperature);
    }
    return session.hardness_law == REGRESSION;
}

// Hardness [Pa] at densities [kg/m3] and temperatures [degrees C].
fn hardness(session: Session, density: vec4<f32>, temperature: vec4<f32>) -> vec4<f32> {
    if session.hardness_law == CALIBRATED {
        let held = max(temperature, coldest_stiffening(density));
        return evaluate(polynomial(held, 0.0, CALIBRATED_CUBE), density);
    }
    if session.hardness_law == REGRESSION {
        return evaluate(strength_at(session, temperature), density);
    }
    return session.gold * pow(density / 20.0, vec4(3.92)) * exp(-0.063 * (temperature + 3.0));
}

// Indents of one cycle in whole thickness quanta, where stress exceeds hardness by some [Pa].
// Thickness `d` is in quanta too: no cell has more than 2^24 of them, so that a float holds every
// number of them exactly.
fn indent_of(
    session: Session,
    rate: f32,
    excess: vec4<f32>,
    density: vec4<f32>,
    d: vec4<f32>,
) -> vec4<f32> {
    let compliance = exp2(-session.stiffness_exponent * log2(density));
    let x = min(excess * compliance * (rate * d), LARGEST_INDENT * d);
    return select(vec4(0.0), floor(x), excess > vec4(0.0));
}
