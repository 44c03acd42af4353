// Hardness of snow and how far it gives way; the twin of src/snow/material.rs and of Compaction in
// src/snow/column.rs.

const CALIBRATED: u32 = 0u;
const REGRESSION: u32 = 1u;
// Part of its thickness by which a cell is compacted in one cycle at the most.
const LARGEST_INDENT: f32 = 0.99;

// The regression polynomial of Barakhtanov et al. with its two disputed cubic coefficients.
fn polynomial(r: f32, t: f32, a: f32, b: f32) -> f32 {
    let value = -0.16599 + 0.542153 * r - 0.08925 * t
        + 0.447667 * r * r
        + 0.159256 * r * t
        - 0.01336 * t * t
        + a * r * r * r
        - 0.15863 * r * r * t
        + 0.022601 * r * t * t
        + b * t * t * t;
    return max(value, 0.0);
}

// The temperature [degrees C] below which the calibrated polynomial would soften again.
fn coldest_stiffening(r: f32) -> f32 {
    let a = 3.0 * 0.260723;
    let b = 2.0 * (0.022601 * r - 0.01336);
    let c = -0.08925 + 0.159256 * r - 0.15863 * r * r;
    return (-b - sqrt(b * b - 4.0 * a * c)) / (2.0 * a);
}

// Hardness [Pa] at a density [kg/m3] and a temperature [degrees C].
fn hardness(session: Session, density: f32, temperature: f32) -> f32 {
    if session.hardness_law == CALIBRATED {
        let held = max(temperature, coldest_stiffening(density));
        return polynomial(density, held, 0.0, 0.260723);
    }
    if session.hardness_law == REGRESSION {
        return polynomial(density, temperature, 0.261043, -0.00032);
    }
    return session.gold * pow(density / 20.0, 3.92) * exp(-0.063 * (temperature + 3.0));
}

// Indent of one cycle in thickness quanta, rounded down.
fn indent_of(
    session: Session,
    rate: f32,
    cell_mass: f32,
    d: f32,
    cell_temperature: f32,
    sigma: f32,
) -> u32 {
    let density = cell_mass / d * session.density;
    let excess = sigma - hardness(session, density, cell_temperature);
    if !(excess > 0.0) {
        return 0u;
    }
    let x = excess / pow(density, session.stiffness_exponent) * rate * d;
    return u32(min(x, LARGEST_INDENT * d));
}
