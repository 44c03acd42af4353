//! Outlines of objects, seen from above.

#[cfg(feature = "serde")]
mod fields;
mod turn;

pub use turn::Turn;

/// Slack \[m\] with which a column's centre counts as inside an outline.
pub(super) const EDGE_SLACK: f64 = 1e-6;

/// Most corners of a polygon.
pub const MOST_CORNERS: usize = 16;

/// Outline of a rigid, level object seen from above, around its centre: x to its right, z forward.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(tag = "type", rename_all = "snake_case", try_from = "fields::ShapeFields")
)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub enum Shape {
    /// A rectangle.
    Box {
        /// Extent from left to right \[m\].
        #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
        width: f64,
        /// Extent from back to front \[m\].
        #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
        depth: f64,
    },
    /// A circle.
    Disk {
        /// Radius \[m\].
        #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
        radius: f64,
    },
    /// A rectangle with half circles at its back and its front.
    Capsule {
        /// Extent from back to front \[m\], the half circles included: at least twice the radius.
        #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
        length: f64,
        /// Radius of the half circles, half its extent from left to right \[m\].
        #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
        radius: f64,
    },
    /// A convex polygon.
    Polygon {
        /// Its corners \[x, z\] \[m\] in order, either way round.
        #[cfg_attr(feature = "schema", schema(min_items = 3, max_items = 16))]
        corners: Vec<[f64; 2]>,
    },
    /// A wheel that rolls forward: a cylinder on its side. It touches the snow with its lowest line, and with
    /// more of its rim the deeper it sinks.
    Wheel {
        /// Extent from left to right \[m\].
        #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
        width: f64,
        /// Radius \[m\].
        #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
        radius: f64,
    },
}

/// How far an outline reaches from its centre along the axes of the grid \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Lowest x.
    pub x0: f64,
    /// Lowest z.
    pub z0: f64,
    /// Highest x.
    pub x1: f64,
    /// Highest z.
    pub z1: f64,
}

impl Shape {
    /// Area A₀ \[m²\].
    pub fn area(&self) -> f64 {
        match self {
            Shape::Box { width, depth } => width * depth,
            Shape::Disk { radius } => std::f64::consts::PI * radius * radius,
            Shape::Capsule { length, radius } => {
                2.0 * radius * (length - 2.0 * radius) + std::f64::consts::PI * radius * radius
            }
            Shape::Polygon { corners } => signed_area(corners).abs(),
            Shape::Wheel { width, radius } => width * 2.0 * radius,
        }
    }

    /// Memory that it takes beside its own size \[bytes\].
    pub fn heap_bytes(&self) -> usize {
        match self {
            Shape::Polygon { corners } => size_of_val(&corners[..]),
            _ => 0,
        }
    }

    /// Half the extent of a shape with straight sides along its own axes: to its right, and forward.
    fn half_sides(&self) -> Option<(f64, f64)> {
        match *self {
            Shape::Box { width, depth } => Some((width / 2.0, depth / 2.0)),
            Shape::Wheel { width, radius } => Some((width / 2.0, radius)),
            Shape::Capsule { length, radius } => Some((radius, length / 2.0 - radius)),
            Shape::Disk { .. } | Shape::Polygon { .. } => None,
        }
    }

    /// Radius of its rounded ends and how far forward of its centre one is, the other being as far behind.
    fn rounded(&self) -> Option<(f64, f64)> {
        match *self {
            Shape::Disk { radius } => Some((radius, 0.0)),
            Shape::Capsule { length, radius } => Some((radius, length / 2.0 - radius)),
            _ => None,
        }
    }

    /// Corners of its straight sides, turned into the grid's axes, in order; none of a disk.
    pub fn corners(&self, turn: Turn) -> Vec<(f64, f64)> {
        let own = match (self, self.half_sides()) {
            (Shape::Polygon { corners }, _) => corners.clone(),
            (_, Some((right, front))) => {
                vec![[-right, -front], [right, -front], [right, front], [-right, front]]
            }
            _ => Vec::new(),
        };
        own.into_iter().map(|[x, z]| turn.to_world(x, z)).collect()
    }

    /// How far it reaches, turned into the grid's axes.
    pub fn reach(&self, turn: Turn) -> Extent {
        let mut reach = Extent {
            x0: f64::INFINITY,
            z0: f64::INFINITY,
            x1: f64::NEG_INFINITY,
            z1: f64::NEG_INFINITY,
        };
        let mut include = |x: f64, z: f64, radius: f64| {
            reach.x0 = reach.x0.min(x - radius);
            reach.z0 = reach.z0.min(z - radius);
            reach.x1 = reach.x1.max(x + radius);
            reach.z1 = reach.z1.max(z + radius);
        };
        if let Some((radius, front)) = self.rounded() {
            let (x, z) = turn.to_world(0.0, front);
            include(x, z, radius);
            include(-x, -z, radius);
        } else {
            self.corners(turn).into_iter().for_each(|(x, z)| include(x, z, 0.0));
        }
        reach
    }

    /// The part of a line along x, so far from the centre along z, that is inside \[m\]; both ends are counted
    /// from the centre. Convex as it is, there is one such part at the most.
    pub fn chord(&self, turn: Turn, distance: f64) -> Option<(f64, f64)> {
        let straight = match (self, self.half_sides()) {
            // Exact along the axes, whatever its turn is computed with.
            (Shape::Box { .. } | Shape::Wheel { .. }, Some((right, front))) => {
                rectangle_chord(turn, right, front, distance)
            }
            _ => polygon_chord(&self.corners(turn), distance),
        };
        let Some((radius, front)) = self.rounded() else { return straight };
        let (x, z) = turn.to_world(0.0, front);
        let ends = [disk_chord(x, z, radius, distance), disk_chord(-x, -z, radius, distance)];
        ends.into_iter().chain([straight]).flatten().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// The same of a line along z, so far from the centre along x.
    pub fn chord_along_z(&self, turn: Turn, distance: f64) -> Option<(f64, f64)> {
        // With its axes swapped a shape is its own mirror image, turned.
        let swapped = Turn { sin: turn.cos, cos: turn.sin };
        match self {
            Shape::Polygon { corners } => {
                let mirrored = corners.iter().map(|&[x, z]| [-x, z]).collect();
                Shape::Polygon { corners: mirrored }.chord(swapped, distance)
            }
            _ => self.chord(swapped, distance),
        }
    }

    /// How high its underside is above its lowest line \[m\] at a place seen from its centre; none where it is
    /// flat.
    pub fn lift(&self, turn: Turn, x: f64, z: f64) -> Option<f64> {
        let Shape::Wheel { radius, .. } = *self else { return None };
        let forward = turn.forward_of(x, z).abs().min(radius);
        Some(radius - (radius * radius - forward * forward).sqrt())
    }

    /// What is wrong with it, if anything.
    pub fn flaw(&self) -> Option<(&'static str, &'static str)> {
        match self {
            Shape::Capsule { length, radius } if *length < 2.0 * radius => {
                Some(("length", "must be at least twice the radius"))
            }
            Shape::Polygon { corners } if !(3..=MOST_CORNERS).contains(&corners.len()) => {
                Some(("corners", "must be 3 to 16"))
            }
            Shape::Polygon { corners } if signed_area(corners).abs() < 1e-6 => {
                Some(("corners", "must have an area of at least 1e-6 m²"))
            }
            Shape::Polygon { corners } if !is_convex(corners) => {
                Some(("corners", "must be those of a convex polygon, in order"))
            }
            _ => None,
        }
    }
}

fn rectangle_chord(turn: Turn, right: f64, front: f64, distance: f64) -> Option<(f64, f64)> {
    // x·cos − z·sin is how far to its right a place is, x·sin + z·cos how far forward.
    let across = band(turn.cos, -turn.sin * distance, right + EDGE_SLACK)?;
    let along = band(turn.sin, turn.cos * distance, front + EDGE_SLACK)?;
    let (low, high) = (across.0.max(along.0), across.1.min(along.1));
    (low <= high).then_some((low, high))
}

/// Where |slope · x + offset| is at most `half`.
fn band(slope: f64, offset: f64, half: f64) -> Option<(f64, f64)> {
    if slope == 0.0 {
        return (offset.abs() <= half).then_some((f64::NEG_INFINITY, f64::INFINITY));
    }
    let ends = ((-half - offset) / slope, (half - offset) / slope);
    Some((ends.0.min(ends.1), ends.0.max(ends.1)))
}

fn disk_chord(x: f64, z: f64, radius: f64, distance: f64) -> Option<(f64, f64)> {
    let reach = radius + EDGE_SLACK;
    let square = reach * reach - (distance - z) * (distance - z);
    (square >= 0.0).then(|| (x - square.sqrt(), x + square.sqrt()))
}

fn polygon_chord(corners: &[(f64, f64)], distance: f64) -> Option<(f64, f64)> {
    let points: Vec<[f64; 2]> = corners.iter().map(|&(x, z)| [x, z]).collect();
    let way = signed_area(&points).signum();
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for (from, to) in sides(&points) {
        let (dx, dz) = (to[0] - from[0], to[1] - from[1]);
        let length = dx.hypot(dz);
        if length == 0.0 {
            continue;
        }
        // Outward, whichever way round the corners are told.
        let (outward_x, outward_z) = (way * dz / length, -way * dx / length);
        let offset = outward_x * from[0] + outward_z * from[1] + EDGE_SLACK - outward_z * distance;
        if outward_x > 0.0 {
            high = high.min(offset / outward_x);
        } else if outward_x < 0.0 {
            low = low.max(offset / outward_x);
        } else if offset < 0.0 {
            return None;
        }
    }
    (low <= high && low.is_finite() && high.is_finite()).then_some((low, high))
}

/// Each corner with the one after it.
fn sides(corners: &[[f64; 2]]) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
    let next = corners.iter().cycle().skip(1);
    corners.iter().copied().zip(next.copied())
}

fn signed_area(corners: &[[f64; 2]]) -> f64 {
    sides(corners).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>() / 2.0
}

/// Whether a walk around the corners turns one way only, and around once.
fn is_convex(corners: &[[f64; 2]]) -> bool {
    let steps: Vec<[f64; 2]> = sides(corners)
        .map(|(a, b)| [b[0] - a[0], b[1] - a[1]])
        .filter(|s| *s != [0.0; 2])
        .collect();
    let turns = sides(&steps).map(|(a, b)| {
        let (cross, dot) = (a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
        cross.atan2(dot)
    });
    let turns: Vec<f64> = turns.collect();
    let one_way = turns.iter().all(|turn| *turn >= -1e-9) || turns.iter().all(|turn| *turn <= 1e-9);
    one_way && (turns.iter().sum::<f64>().abs() - std::f64::consts::TAU).abs() < 1e-6
}

#[cfg(test)]
mod tests;
