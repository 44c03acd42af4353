//! Objects that move by themselves, in steps short enough to leave no gap in their track.

use super::body::{Body, Position};
use super::footprint::Footprint;
use super::grid::Grid;

/// Most steps of a cycle.
pub const MOST_STEPS: u32 = 64;

/// How near to a point of its path an object has passed it \[m\]: sums of steps are rounded.
const ARRIVED: f64 = 1e-9;

/// Most sweeps that wait for a cycle.
const MOST_SWEEPS: usize = 16;

/// Points of a path that are told of an object.
const TOLD_POINTS: usize = 16;

/// Most points of a path.
pub const MOST_PATH_POINTS: usize = 4096;

/// How an object moves: along its path while it has one, then with its velocity.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default))]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Motion {
    /// Velocity along x and z \[m/s\]; absent where it is 0.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Position::is_zero"))]
    #[cfg_attr(feature = "schema", schema(required = false))]
    pub velocity: Position,
    /// How fast it turns \[°/s\], clockwise from above; absent where it is 0.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "is_zero"))]
    #[cfg_attr(feature = "schema", schema(required = false))]
    pub turn_rate: f64,
    /// Points \[x, z\] \[m\] that it still has to pass, in order, the next 16 at the most; absent where there are none.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Vec::is_empty"))]
    #[cfg_attr(feature = "schema", schema(required = false))]
    pub path: Vec<[f64; 2]>,
    /// Its speed along the path \[m/s\]; absent where it is swept to the end in the next cycle.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    #[cfg_attr(feature = "schema", schema(required = false, nullable = false))]
    pub speed: Option<f64>,
    /// Heading that it has at the end of the path \[°\], where it is swept to another.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    #[cfg_attr(feature = "schema", schema(required = false, nullable = false))]
    pub turn_to: Option<f64>,
}

impl Motion {
    /// Whether it stays where it is.
    pub fn is_still(&self) -> bool {
        self.velocity.is_zero() && self.turn_rate == 0.0 && self.path.is_empty()
    }

    /// Whether its heading changes.
    pub fn turns(&self) -> bool {
        self.turn_rate != 0.0 || self.turn_to.is_some()
    }

    /// Sweeps it from where it is to another position, heading, or both. Where it has not got to the end of another
    /// sweep, it goes there first; the last of very many takes the place of the one before.
    pub fn sweep_to(&mut self, from: Position, to: Option<Position>, heading: Option<f64>) {
        if self.speed.is_some() {
            self.leave_path();
        }
        let end = self.path.last().copied().unwrap_or([from.x, from.z]);
        self.path.truncate(MOST_SWEEPS - 1);
        self.path.push(to.map_or(end, |to| [to.x, to.z]));
        self.turn_to = heading.or(self.turn_to);
    }

    /// Forgets the path.
    pub fn leave_path(&mut self) {
        *self = Motion { velocity: self.velocity, turn_rate: self.turn_rate, ..Motion::default() };
    }
}

impl Position {
    /// Whether both coordinates are 0.
    pub fn is_zero(&self) -> bool {
        self.x == 0.0 && self.z == 0.0
    }
}

#[cfg(feature = "serde")]
fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

/// Steps for a way of so many columns.
///
/// What is in front presses a column for a whole number of steps. If that were 2 steps for one column and 3 for the
/// next, the deeper dents would remain, and tracks would be the deeper the less evenly steps fit into columns. So a
/// few more are taken where nearly a whole number of them fits into a column.
fn steps_of(columns: f64) -> u32 {
    const SLACK: f64 = 1e-9;
    let fewest = (2.0 * columns - SLACK).ceil().clamp(1.0, MOST_STEPS.into()) as u32;
    let unevenness = |steps: u32| {
        let in_a_column = f64::from(steps) / columns.max(SLACK);
        (in_a_column - SLACK).ceil() / in_a_column
    };
    let all = fewest..=(2 * fewest + 3).min(MOST_STEPS);
    let even = all.clone().find(|&steps| unevenness(steps) < 1.05);
    even.or_else(|| all.min_by(|&a, &b| unevenness(a).total_cmp(&unevenness(b)))).unwrap_or(fewest)
}

/// Length of a path that begins somewhere \[m\].
pub fn path_length(from: Position, path: &[[f64; 2]]) -> f64 {
    let ends = std::iter::once([from.x, from.z]).chain(path.iter().copied());
    ends.zip(path).map(|(from, to)| (to[0] - from[0]).hypot(to[1] - from[1])).sum()
}

impl Body {
    /// Steps of at most half a column in which it moves through a cycle of `dt` seconds, [`MOST_STEPS`] at the most.
    pub fn steps(&self, grid: &Grid, dt: f64) -> u32 {
        let Motion { velocity, turn_rate, path, speed, .. } = &self.motion;
        let way = match speed {
            _ if path.is_empty() => velocity.x.hypot(velocity.z) * dt,
            Some(speed) => speed * dt,
            None => path_length(self.position, path),
        };
        let turn = turn_rate.abs() * dt + self.turn_left().abs();
        let travel = way + turn.to_radians() * self.radius();
        steps_of(travel / grid.cell_size)
    }

    /// Moves it by the first of so many equal steps that are left of a cycle, each of `step_dt` seconds. Returns what it
    /// stands on then; nothing where it has not moved. At the edge of the grid it stops, with the last of its columns
    /// in there.
    pub fn step(&mut self, grid: &Grid, step_dt: f64, left: u32) -> Option<Vec<Footprint>> {
        if self.motion.is_still() {
            return None;
        }
        let before = (self.position, self.heading);
        self.turn(self.motion.turn_rate * step_dt);
        if self.motion.path.is_empty() {
            self.position.x += self.motion.velocity.x * step_dt;
            self.position.z += self.motion.velocity.z * step_dt;
        } else if let Some(speed) = self.motion.speed {
            self.follow_path(speed * step_dt);
        } else {
            self.sweep(grid, left);
        }
        let footprints = self.on(grid);
        if footprints.is_none() {
            (self.position, self.heading) = before;
            self.motion = Motion::default();
        }
        footprints
    }

    /// Goes its part of what is left of a sweep, by half a column at the most.
    fn sweep(&mut self, grid: &Grid, left: u32) {
        let length = path_length(self.position, &self.motion.path);
        let turn = self.turn_left();
        let travel = length + turn.to_radians().abs() * self.radius();
        let (even, longest) = (1.0 / f64::from(left), 0.5 * grid.cell_size / travel);
        let part = if even <= longest * (1.0 + 1e-9) { even } else { longest };
        if part < 1.0 {
            self.turn(turn * part);
            self.follow_path(length * part);
        } else {
            self.follow_path(f64::INFINITY);
        }
    }

    /// Degrees by which it still turns on its path, the shorter way round.
    fn turn_left(&self) -> f64 {
        let left = self.motion.turn_to.map_or(0.0, |to| to - self.heading);
        (left + 180.0).rem_euclid(360.0) - 180.0
    }

    fn turn(&mut self, degrees: f64) {
        if degrees != 0.0 {
            self.heading = (self.heading + degrees) % 360.0;
        }
    }

    /// Goes on along its path, so far \[m\].
    fn follow_path(&mut self, mut way: f64) {
        let mut passed = 0;
        for &[x, z] in &self.motion.path {
            let (dx, dz) = (x - self.position.x, z - self.position.z);
            let length = dx.hypot(dz);
            if length > way + ARRIVED {
                let part = way / length;
                self.position.x += dx * part;
                self.position.z += dz * part;
                break;
            }
            way -= length;
            self.position = Position { x, z };
            passed += 1;
        }
        self.motion.path.drain(..passed);
        if self.motion.path.is_empty() {
            self.heading = self.motion.turn_to.unwrap_or(self.heading);
            self.motion.leave_path();
        }
    }

    /// The object as it is told: with the next points of its path alone, because it is told with every step.
    pub fn told(&self) -> Body {
        let Motion { velocity, turn_rate, ref path, speed, turn_to } = self.motion;
        let path = path[..path.len().min(TOLD_POINTS)].to_vec();
        Body {
            shape: self.shape.clone(),
            footprints: self.footprints.clone(),
            motion: Motion { velocity, turn_rate, path, speed, turn_to },
            ..*self
        }
    }

    /// How far it reaches from its centre, at the most \[m\].
    pub fn radius(&self) -> f64 {
        let (low, high) = self.bounds();
        let along = |low: f64, high: f64, centre: f64| (centre - low).max(high - centre);
        along(low.x, high.x, self.position.x).hypot(along(low.z, high.z, self.position.z))
    }
}

#[cfg(test)]
mod tests;
