//! A plough that clears a winding road through the scene, to and fro.

use firn_protocol::{Clearing, ColliderSpec};
use firn_snow::{Position, Shape};

use crate::RATE;
use crate::place::{along, bearing, distance, forward};
use crate::sweep::Sweep;

/// Speed \[m/s\] and mass \[kg\].
const SPEED: f64 = 5.0;
const MASS: f64 = 900.0;
/// Size of the blade \[m\].
const WIDTH: f64 = 3.0;
const DEPTH: f64 = 0.4;
/// Depth of snow that it leaves on the road \[m\].
const LEFT: f64 = 0.04;
/// How far behind the blade the road is clear \[m\]. Clearings spare what an object stands on.
const BEHIND: f64 = WIDTH / 2.0 + DEPTH;

pub struct Plough {
    road: Vec<Position>,
    /// How far it has come along the road and back \[m\].
    way: f64,
    /// End of what is clear.
    clear: Position,
    sweep: Sweep,
}

impl Plough {
    pub fn new(size: f64) -> Plough {
        let road = road(size);
        let body = ColliderSpec {
            id: Some("plough".to_owned()),
            mass: MASS,
            shape: Some(Shape::Box { width: WIDTH, depth: DEPTH }),
            position: road[0],
            heading: 90.0,
            ..ColliderSpec::default()
        };
        Plough { clear: road[0], road, way: 0.0, sweep: Sweep::new(body) }
    }

    /// Pushes on for one turn of the game.
    pub fn drive(&mut self, moved: bool) -> ColliderSpec {
        self.way += SPEED / RATE;
        let (place, heading) = self.at(self.way);
        self.sweep.to(place, heading, moved)
    }

    /// Clears the road up to a little behind the blade.
    pub fn clearing(&mut self) -> Clearing {
        let (from, (to, _)) = (self.clear, self.at((self.way - BEHIND).max(0.0)));
        self.clear = to;
        let path = Some(vec![[from.x, from.z], [to.x, to.z]]);
        Clearing { depth: LEFT, path, width: Some(WIDTH), region: None }
    }

    pub fn stop(&self) -> ColliderSpec {
        self.sweep.stop()
    }

    /// The place and the bearing after so many metres.
    fn at(&self, way: f64) -> (Position, f64) {
        let length: f64 = self.road.windows(2).map(|ends| distance(ends[0], ends[1])).sum();
        let back = way.rem_euclid(2.0 * length) > length;
        let mut left = way.rem_euclid(2.0 * length);
        if back {
            left = 2.0 * length - left;
        }
        let mut at = (self.road[0], 0.0);
        for ends in self.road.windows(2) {
            let heading = bearing(ends[0], ends[1]);
            let part = distance(ends[0], ends[1]);
            at = (along(ends[0], forward(heading), left.min(part)), heading);
            if left <= part {
                break;
            }
            left -= part;
        }
        if back { (at.0, at.1 + 180.0) } else { at }
    }
}

/// Three lanes from west to east and back, one behind the other, between the ways of walkers.
fn road(size: f64) -> Vec<Position> {
    let corners =
        [(0.06, 0.28), (0.94, 0.28), (0.94, 0.5), (0.06, 0.5), (0.06, 0.764), (0.94, 0.764)];
    corners.iter().map(|(x, z)| Position { x: x * size, z: z * size }).collect()
}
