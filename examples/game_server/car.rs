//! A car on four wheels that drives from place to place.

use firn_protocol::ColliderSpec;
use firn_snow::{Part, Position, Shape};

use crate::RATE;
use crate::place::{along, bearing, distance, forward, turn};
use crate::sweep::Sweep;

/// Speed \[m/s\], the most that it turns \[°/s\], and its mass \[kg\].
const SPEED: f64 = 4.0;
const TURN_RATE: f64 = 60.0;
const MASS: f64 = 1400.0;
/// Distance between the axles, and between the wheels of one \[m\].
const WHEELBASE: f64 = 2.6;
const TRACK: f64 = 1.6;
/// Twice the radius of its tightest bend: a goal that is nearer may lie inside of it \[m\].
const NEAR: f64 = 2.0 * SPEED / (TURN_RATE * std::f64::consts::PI / 180.0);

pub struct Car {
    size: f64,
    place: Position,
    heading: f64,
    /// Goals so far.
    goals: u32,
    sweep: Sweep,
}

impl Car {
    pub fn new(size: f64) -> Car {
        let place = Position { x: 0.5 * size, z: 0.4 * size };
        let body = ColliderSpec {
            id: Some("car".to_owned()),
            mass: MASS,
            footprints: Some(wheels()),
            position: place,
            ..ColliderSpec::default()
        };
        Car { size, place, heading: 0.0, goals: 1, sweep: Sweep::new(body) }
    }

    /// Drives on for one turn of the game.
    pub fn drive(&mut self, moved: bool) -> ColliderSpec {
        if distance(self.place, self.goal()) < NEAR {
            self.goals += 1;
        }
        let most = TURN_RATE / RATE;
        let wish = turn(self.heading, bearing(self.place, self.goal()));
        self.heading += wish.clamp(-most, most);
        self.place = along(self.place, forward(self.heading), SPEED / RATE);
        self.sweep.to(self.place, self.heading, moved)
    }

    pub fn stop(&self) -> ColliderSpec {
        self.sweep.stop()
    }

    /// Where it is going. The powers of one number spread the goals evenly over the scene.
    fn goal(&self) -> Position {
        const X: f64 = 0.754_877_666;
        const Z: f64 = X * X;
        let inside =
            |power: f64| self.size * (0.25 + 0.5 * (f64::from(self.goals) * power).fract());
        Position { x: inside(X), z: inside(Z) }
    }
}

fn wheels() -> Vec<Part> {
    let wheel = |x, z| Part {
        shape: Shape::Wheel { width: 0.25, radius: 0.35 },
        offset: Position { x, z },
        heading: 0.0,
    };
    let (x, z) = (TRACK / 2.0, WHEELBASE / 2.0);
    vec![wheel(-x, z), wheel(x, z), wheel(-x, -z), wheel(x, -z)]
}
