//! What may be wrong with an object: its outlines, where it stands, and how it moves.

use firn_snow::{Body, Grid, MOST_CORNERS, MOST_FOOTPRINTS, MOST_PATH_POINTS, Motion, Shape};

use crate::core::session::Check;

/// Largest radius and width of a wheel \[m\].
const LARGEST_WHEEL: f64 = 5.0;

/// Fastest that an object moves \[m/s\] and turns \[°/s\].
const FASTEST: f64 = 100.0;
const FASTEST_TURN: f64 = 720.0;

/// Longest time for a path \[s\], and how far from 0 its points are at the most \[m\].
const LONGEST_WAY: f64 = 86_400.0;
const FARTHEST: f64 = 1e6;

impl Check {
    /// Notes what is wrong with an object.
    pub fn object(&mut self, at: &str, id: &str, object: &Body, grid: &Grid) {
        let before = self.errors().len();
        self.id(format!("{at}/id"), id);
        self.range(format!("{at}/mass"), object.mass, f64::MIN_POSITIVE, 1e9, "kg");
        self.range(format!("{at}/heading"), object.heading, -36_000.0, 36_000.0, "°");
        self.motion(at, &object.motion);
        match (&object.shape, &object.footprints[..]) {
            (Some(shape), []) => self.shape(&format!("{at}/shape"), shape),
            (None, parts) if (1..=MOST_FOOTPRINTS).contains(&parts.len()) => {
                for (i, part) in parts.iter().enumerate() {
                    let at = format!("{at}/footprints/{i}");
                    self.shape(&format!("{at}/shape"), &part.shape);
                    self.range(format!("{at}/heading"), part.heading, -36_000.0, 36_000.0, "°");
                    for (axis, offset) in [("x", part.offset.x), ("z", part.offset.z)] {
                        self.range(format!("{at}/offset/{axis}"), offset, -1000.0, 1000.0, "m");
                    }
                }
            }
            (Some(_), _) => self.reject(
                format!("{at}/footprints"),
                "is there beside a shape; an object has one or the other",
            ),
            (None, []) => self.reject(
                format!("{at}/shape"),
                format!("is missing; an object has a shape or 1 to {MOST_FOOTPRINTS} footprints"),
            ),
            (None, parts) => self.reject(
                format!("{at}/footprints"),
                format!("{} of them; an object has at most {MOST_FOOTPRINTS}", parts.len()),
            ),
        }
        if self.errors().len() == before && object.on(grid).is_none() {
            let (width, depth) = (f64::from(grid.width), f64::from(grid.depth));
            self.reject(
                format!("{at}/position"),
                format!(
                    "none of its columns is in the grid, which is 0 to {} m along x and 0 to {} m \
                     along z",
                    width * grid.cell_size,
                    depth * grid.cell_size
                ),
            );
        }
    }

    /// Notes what is wrong with a path and its time, as they are told.
    pub(super) fn path(&mut self, at: &str, path: Option<&[[f64; 2]]>, over: Option<f64>) {
        if path.is_some_and(<[_]>::is_empty) {
            self.reject(format!("{at}/path"), "has no points; it has 1 to 4096");
        }
        if path.is_some() != over.is_some() {
            let field = if path.is_some() { "over" } else { "path" };
            self.reject(format!("{at}/{field}"), "is missing; 'path' and 'over' come together");
        }
        if let Some(over) = over {
            self.range(format!("{at}/over"), over, 1e-3, LONGEST_WAY, "s");
        }
    }

    /// Notes what is wrong with how an object moves.
    fn motion(&mut self, at: &str, motion: &Motion) {
        let Motion { velocity, turn_rate, path, speed, turn_to } = motion;
        let fastest = velocity.x.hypot(velocity.z);
        self.range(format!("{at}/velocity"), fastest, 0.0, FASTEST, "m/s");
        self.range(format!("{at}/turn_rate"), *turn_rate, -FASTEST_TURN, FASTEST_TURN, "°/s");
        if path.len() > MOST_PATH_POINTS {
            let detail = format!("{} points; a path has at most {MOST_PATH_POINTS}", path.len());
            self.reject(format!("{at}/path"), detail);
        }
        let far = |[x, z]: &[f64; 2]| !(x.abs() <= FARTHEST && z.abs() <= FARTHEST);
        if let Some(i) = path.iter().position(far) {
            self.reject(format!("{at}/path/{i}"), format!("is not within {FARTHEST} m of 0"));
        } else if let Some(speed) = speed.filter(|speed| !(0.0..=FASTEST).contains(speed))
            && !self.errors().any(|error| error.pointer == format!("{at}/over"))
        {
            let detail = format!("makes it {speed:.1} m/s along the path; at most {FASTEST} m/s");
            self.reject(format!("{at}/over"), detail);
        }
        if let Some(heading) = turn_to {
            self.range(format!("{at}/heading"), *heading, -36_000.0, 36_000.0, "°");
        }
    }

    /// Notes what is wrong with an outline.
    pub(super) fn shape(&mut self, at: &str, shape: &Shape) {
        let (sides, longest): (&[(&str, f64)], f64) = match shape {
            Shape::Box { width, depth } => (&[("width", *width), ("depth", *depth)], 1e6),
            Shape::Disk { radius } => (&[("radius", *radius)], 1e6),
            Shape::Capsule { length, radius } => (&[("length", *length), ("radius", *radius)], 1e6),
            Shape::Wheel { width, radius } => {
                (&[("width", *width), ("radius", *radius)], LARGEST_WHEEL)
            }
            Shape::Polygon { .. } => (&[], 0.0),
        };
        for (side, length) in sides {
            self.range(format!("{at}/{side}"), *length, 1e-3, longest, "m");
        }
        if let Shape::Polygon { corners } = shape {
            for (i, corner) in corners.iter().take(MOST_CORNERS).enumerate() {
                for (axis, along) in corner.iter().enumerate() {
                    self.range(format!("{at}/corners/{i}/{axis}"), *along, -1000.0, 1000.0, "m");
                }
            }
        }
        if let Some((field, flaw)) = shape.flaw() {
            self.reject(format!("{at}/{field}"), flaw);
        }
    }
}
