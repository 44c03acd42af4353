//! What the experiments set up: the snow, the objects on it, and how long they are left alone.

use firn_protocol::{ColliderSpec, SessionSpec, SnowLayer};
use firn_snow::{Grid, Position, Shape};

/// Columns along each side of the thesis's grid.
pub const SIDE: u32 = 50;

/// Ticks of 1/60 s in the 120 s that snow is left to settle after each snowfall.
const SETTLING: u64 = 7200;

/// One of the thesis's experiments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Experiment {
    /// 5.8 m of snow at −3 °C.
    OneA,
    /// 5.8 m of snow at −10 °C.
    OneB,
    /// 5.6 m of snow, 2 °C colder every 0.8 m.
    Two,
    /// Four snowfalls, the second of them at −15 °C.
    Three,
    /// Objects of 100 kg on the snow of 1.a and 1.b.
    Colliders,
    /// A single column of 8 m at −3 and at −10 °C.
    Prototype,
}

/// One snowpack and what happens to it.
#[derive(Clone, Debug)]
pub(super) struct Setup {
    /// Name of the session.
    pub name: &'static str,
    pub grid: Grid,
    /// Snow there is from the beginning, from the ground up.
    pub initial: Vec<SnowLayer>,
    /// Snow that falls in the course of it, each left to settle; just that where `None`.
    pub phases: Vec<Option<SnowLayer>>,
    /// Objects on the snow, from the beginning.
    pub plates: Vec<Plate>,
    /// A column without an object.
    pub free: (u32, u32),
}

/// A square plate of 100 kg.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plate {
    pub id: &'static str,
    /// Its area, to be shown.
    pub label: &'static str,
    /// Side \[m\].
    pub side: f64,
    /// Where its centre is \[m\].
    pub position: Position,
}

/// The thesis's colliders 1 to 3, on 16, 1 and 0.1 m², apart from each other.
pub(super) const PLATES: [Plate; 3] = [
    Plate { id: "wide", label: "16 m²", side: 4.0, position: Position { x: 3.0, z: 3.0 } },
    Plate { id: "middle", label: "1 m²", side: 1.0, position: Position { x: 7.5, z: 3.0 } },
    Plate {
        id: "narrow",
        label: "0.1 m²",
        side: 0.316_227_766,
        position: Position { x: 7.5, z: 7.5 },
    },
];

impl Plate {
    /// Mass \[kg\].
    const MASS: f64 = 100.0;

    pub fn spec(&self) -> ColliderSpec {
        ColliderSpec {
            id: Some(self.id.to_owned()),
            mass: Plate::MASS,
            shape: Some(Shape::Box { width: self.side, depth: self.side }),
            position: self.position,
            ..ColliderSpec::default()
        }
    }
}

impl Setup {
    fn new(name: &'static str, side: u32, initial: Vec<SnowLayer>) -> Setup {
        Setup {
            name,
            grid: Grid { width: side, depth: side, ..Grid::default() },
            initial,
            phases: vec![None],
            plates: Vec::new(),
            free: (side / 2, side / 2),
        }
    }

    /// What the session is created with.
    pub fn spec(&self) -> SessionSpec {
        SessionSpec {
            id: Some(self.name.to_owned()),
            grid: self.grid,
            paused: true,
            initial_snow: self.initial.clone(),
            ..SessionSpec::default()
        }
    }

    /// Ticks of one phase.
    pub fn phase_ticks(&self) -> u64 {
        SETTLING
    }

    fn with_plates(mut self) -> Setup {
        self.plates = PLATES.to_vec();
        self.free = (self.grid.width - 1, self.grid.depth - 1);
        self
    }
}

impl Experiment {
    /// Every experiment, in the order of the thesis.
    pub const ALL: [Experiment; 6] = [
        Experiment::Prototype,
        Experiment::OneA,
        Experiment::OneB,
        Experiment::Colliders,
        Experiment::Two,
        Experiment::Three,
    ];

    /// Ticks it takes.
    pub fn ticks(self) -> u64 {
        self.setups(SIDE).iter().map(|s| s.phases.len() as u64 * s.phase_ticks()).sum()
    }

    /// What it needs simulated.
    pub(super) fn setups(self, side: u32) -> Vec<Setup> {
        let even = |name, side, depth, celsius| Setup::new(name, side, vec![fresh(depth, celsius)]);
        match self {
            Experiment::OneA => vec![even("1a", side, 5.8, -3.0)],
            Experiment::OneB => vec![even("1b", side, 5.8, -10.0)],
            Experiment::Two => {
                let layers = (0..7).map(|i| fresh(0.8, -3.0 - 2.0 * f64::from(i))).collect();
                vec![Setup::new("2", side, layers)]
            }
            Experiment::Three => {
                let falls = [(3.6, -3.0), (1.2, -15.0), (3.6, -3.0), (3.2, -3.0)];
                let phases = falls.iter().map(|&(depth, celsius)| Some(fresh(depth, celsius)));
                vec![Setup { phases: phases.collect(), ..Setup::new("3", side, Vec::new()) }]
            }
            Experiment::Colliders => vec![
                even("colliders-1a", side, 5.8, -3.0).with_plates(),
                even("colliders-1b", side, 5.8, -10.0).with_plates(),
            ],
            Experiment::Prototype => {
                vec![even("prototype-warm", 1, 8.0, -3.0), even("prototype-cold", 1, 8.0, -10.0)]
            }
        }
    }
}

/// Snow of the thesis's 20 kg/m³.
fn fresh(depth: f64, celsius: f64) -> SnowLayer {
    SnowLayer { depth, temperature: Some(celsius), density: Some(20.0) }
}
