//! Walkers who put one foot before the other, and steer around deep snow.

use firn_protocol::{ColliderSpec, Probe};
use firn_snow::{Part, Position, Shape};

use crate::RATE;
use crate::place::{along, bearing, distance, forward, right, turn};

const WALKERS: usize = 20;
/// Mass of a walker with what it carries \[kg\], size of a boot \[m\].
const MASS: f64 = 90.0;
const BOOT: Shape = Shape::Capsule { length: 0.34, radius: 0.07 };
/// Length of a step, and distance between the feet's tracks \[m\].
const STEP: f64 = 0.7;
const GAUGE: f64 = 0.24;
/// Turns of the game from one step to the next.
const TURNS_PER_STEP: u64 = (RATE / 2.0) as u64;
/// How far ahead a walker looks \[m\], and the turns it thinks of \[°\].
const AHEAD: f64 = 1.6;
const TURNS: [f64; 7] = [0.0, 25.0, -25.0, 50.0, -50.0, 80.0, -80.0];
/// Depth that a walker would rather sink than turn by one degree \[m\].
const PATIENCE: f64 = 0.002;

pub struct Walkers(Vec<Walker>, f64);

/// Somebody who walks to and fro across the scene.
struct Walker {
    goal: Position,
    heading: f64,
    /// The left and the right foot.
    feet: [Foot; 2],
    /// Which of them goes next.
    next: usize,
}

#[derive(Clone, Copy)]
struct Foot {
    place: Position,
    heading: f64,
}

/// A way that a walker could go.
pub struct Way {
    walker: usize,
    end: Position,
    heading: f64,
    /// How far it leads away from the goal \[°\].
    turn: f64,
}

impl Way {
    /// The load of a foot at its end, for as long as a step takes.
    pub fn probe(&self) -> Probe {
        let duration = Some(TURNS_PER_STEP as f64 / RATE);
        Probe { x: self.end.x, z: self.end.z, mass: MASS, area: BOOT.area(), duration }
    }
}

impl Walkers {
    pub fn new(size: f64) -> Walkers {
        Walkers((0..WALKERS).map(|number| Walker::at_the_edge(number, size)).collect(), size)
    }

    /// The ways of those whose step it is: in each turn a few, so that all go at the same pace.
    pub fn look_ahead(&mut self, turns: u64) -> Vec<Way> {
        let size = self.1;
        let on_their_turn = |(number, _): &(usize, &mut Walker)| {
            (turns + *number as u64).is_multiple_of(TURNS_PER_STEP)
        };
        let walkers = self.0.iter_mut().enumerate().filter(on_their_turn);
        walkers.flat_map(|(number, walker)| walker.ways(number, size)).collect()
    }

    /// Each takes a step on the way that costs it least.
    pub fn step(&mut self, ways: &[Way], sinks: &[f64]) -> Vec<ColliderSpec> {
        let choices = ways.chunks(TURNS.len()).zip(sinks.chunks(TURNS.len()));
        let steps = choices.filter_map(|(ways, sinks)| {
            let number = ways.first()?.walker;
            let walker = self.0.get_mut(number)?;
            walker.step(walker.choose(ways, sinks)?);
            Some(walker.body(number))
        });
        steps.collect()
    }
}

impl Walker {
    fn at_the_edge(number: usize, size: f64) -> Walker {
        let z = size * (0.06 + 0.88 * (number as f64 + 0.5) / WALKERS as f64);
        // One in two begins in the east.
        let (from, to) = if number.is_multiple_of(2) { (0.08, 0.92) } else { (0.92, 0.08) };
        let (start, goal) = (Position { x: from * size, z }, Position { x: to * size, z });
        let heading = bearing(start, goal);
        let foot = |side: f64| Foot { place: along(start, right(heading), side * GAUGE), heading };
        Walker { goal, heading, feet: [foot(-0.5), foot(0.5)], next: 1 }
    }

    fn middle(&self) -> Position {
        let [left, right] = self.feet;
        along(
            left.place,
            Position { x: right.place.x - left.place.x, z: right.place.z - left.place.z },
            0.5,
        )
    }

    /// The ways that it could go; the first is straight to its goal.
    fn ways(&mut self, walker: usize, size: f64) -> Vec<Way> {
        let place = self.middle();
        if distance(place, self.goal) < AHEAD {
            self.goal.x = size - self.goal.x;
        }
        let straight = bearing(place, self.goal);
        let inside = |place: Position| Position {
            x: place.x.clamp(0.5, size - 0.5),
            z: place.z.clamp(0.5, size - 0.5),
        };
        let way = |turn: &f64| {
            let heading = straight + turn;
            Way {
                walker,
                end: inside(along(place, forward(heading), AHEAD)),
                heading,
                turn: turn.abs(),
            }
        };
        TURNS.iter().map(way).collect()
    }

    /// The bearing of the cheapest way. Who has begun to turn goes on that way: otherwise it would
    /// waver before a drift.
    fn choose(&self, ways: &[Way], sinks: &[f64]) -> Option<f64> {
        let cost = |(way, sink): &(&Way, &f64)| {
            *sink + PATIENCE * (way.turn + 0.3 * turn(self.heading, way.heading).abs())
        };
        let cheapest = ways.iter().zip(sinks).min_by(|a, b| cost(a).total_cmp(&cost(b)));
        cheapest.map(|(way, _)| way.heading)
    }

    /// Puts the next foot a step before the other.
    fn step(&mut self, heading: f64) {
        let side = if self.next == 0 { -GAUGE } else { GAUGE };
        let standing = self.feet[1 - self.next].place;
        let place = along(along(standing, forward(heading), STEP), right(heading), side);
        self.feet[self.next] = Foot { place, heading };
        self.next = 1 - self.next;
        self.heading = heading;
    }

    /// Its feet as the server sees them: footprints of one body, whose place is between them.
    fn body(&self, number: usize) -> ColliderSpec {
        let (place, forward, right) = (self.middle(), forward(self.heading), right(self.heading));
        let footprint = |foot: &Foot| {
            let (x, z) = (foot.place.x - place.x, foot.place.z - place.z);
            let offset =
                Position { x: x * right.x + z * right.z, z: x * forward.x + z * forward.z };
            Part { shape: BOOT, offset, heading: foot.heading - self.heading }
        };
        ColliderSpec {
            id: Some(format!("walker-{number}")),
            mass: MASS,
            footprints: Some(self.feet.iter().map(footprint).collect()),
            position: place,
            heading: self.heading,
            ..ColliderSpec::default()
        }
    }
}
