//! Bodies that leave tracks without gaps.
//!
//! Each turn of the game has a new place for a car. If the server were told just that place, it
//! would lift the car there, and wheels would leave a row of dents. So the car gets a path to the
//! place, which takes it one tick.

use firn_protocol::ColliderSpec;
use firn_snow::Position;

use crate::RATE;
use crate::place::turn;

/// The most that the server turns a body \[°/s\].
const TURN_RATE: f64 = 720.0;

/// Where the server has a body, and where it takes it in its next tick.
pub struct Sweep {
    /// The body, at the place and with the heading that it has certainly reached.
    body: ColliderSpec,
    /// Where it goes from there, and the heading that it has then \[°\].
    path: Vec<[f64; 2]>,
    heading: f64,
}

impl Sweep {
    pub fn new(body: ColliderSpec) -> Sweep {
        Sweep { heading: body.heading, body, path: Vec::new() }
    }

    /// Takes the body to a place; `moved`: it has reached the place before.
    ///
    /// Two batches may fall between the same two ticks. Then the second replaces the first before
    /// it was carried out, so that it has to tell that part of the way too.
    pub fn to(&mut self, place: Position, heading: f64, moved: bool) -> ColliderSpec {
        if moved {
            if let Some(&[x, z]) = self.path.last() {
                self.body.position = Position { x, z };
            }
            self.body.heading = self.heading;
            self.path.clear();
        }
        self.path.push([place.x, place.z]);
        let turned = turn(self.body.heading, heading) * RATE;
        let turn_rate = turned.clamp(-TURN_RATE, TURN_RATE);
        self.heading = (self.body.heading + turn_rate / RATE).rem_euclid(360.0);
        ColliderSpec {
            path: Some(self.path.clone()),
            over: Some(1.0 / RATE),
            turn_rate,
            ..self.body.clone()
        }
    }

    /// Leaves the body where it is going.
    pub fn stop(&self) -> ColliderSpec {
        let place = self.path.last().map(|&[x, z]| Position { x, z });
        let position = place.unwrap_or(self.body.position);
        ColliderSpec { position, heading: self.heading, ..self.body.clone() }
    }
}
