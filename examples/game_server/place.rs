//! Compass bearings: 0° is north (+z), 90° is east (+x).

use firn_snow::Position;

/// The unit vector of a bearing \[°\].
pub fn forward(heading: f64) -> Position {
    let (x, z) = heading.to_radians().sin_cos();
    Position { x, z }
}

/// The unit vector to the right of a bearing \[°\].
pub fn right(heading: f64) -> Position {
    forward(heading + 90.0)
}

/// A place, and so many metres from it along a vector.
pub fn along(from: Position, vector: Position, metres: f64) -> Position {
    Position { x: from.x + vector.x * metres, z: from.z + vector.z * metres }
}

/// The bearing from one place to another \[°\].
pub fn bearing(from: Position, to: Position) -> f64 {
    (to.x - from.x).atan2(to.z - from.z).to_degrees()
}

pub fn distance(from: Position, to: Position) -> f64 {
    (to.x - from.x).hypot(to.z - from.z)
}

/// The turn from one bearing to another \[°\], the shorter way round.
pub fn turn(from: f64, to: f64) -> f64 {
    (to - from + 180.0).rem_euclid(360.0) - 180.0
}
