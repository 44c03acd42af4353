//! What clients know of a session: the states that it may be in after what they were told.

use std::collections::{BTreeMap, BTreeSet};

use firn_protocol::SessionSpec;
use firn_snow::{Grid, MASS_QUANTA};

/// What may be asked of a session.
#[derive(Clone, Debug, PartialEq)]
pub enum Operation {
    /// It is made.
    Create,
    /// It is deleted.
    Delete,
    /// Snow of so many 256th parts of a cell falls everywhere.
    Snowfall(u32),
    /// The air gets a temperature \[°C\].
    Air(i32),
    /// Its time stands still, or goes on.
    Pause(bool),
    /// An object of a mass \[kg\] is put.
    Put(u8, u32),
    /// An object is taken away.
    Remove(u8),
    /// So many ticks are taken, where its time stands still.
    Step(u64),
    /// Back to how it was made.
    Reset,
}

/// A number of 256th parts of a cell, as a depth \[m\].
pub fn metres(parts: u32, grid: &Grid) -> f64 {
    f64::from(parts) * grid.cell_size / 256.0
}

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It was acknowledged.
    Done,
    /// It was refused: nothing has changed.
    Refused,
    /// Nobody knows.
    Unknown,
}

/// A session, as far as clients can know it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct State {
    /// Mass that has fallen, in quanta.
    pub fallen: u128,
    /// Temperature of the air \[°C\].
    pub air: i32,
    /// Whether its time stands still.
    pub paused: bool,
    /// Masses of its objects \[kg\].
    pub objects: BTreeMap<u8, u32>,
}

/// A session, and what was asked of it since it was last looked at.
#[derive(Debug)]
pub struct Model {
    /// What it is made with.
    pub spec: SessionSpec,
    /// As it was found; `None` where there was none.
    found: Option<State>,
    asked: Vec<(Operation, Fate)>,
    /// Newest tick that was told with a change.
    tick: u64,
}

impl Model {
    /// A session that is not there yet.
    pub fn new(spec: SessionSpec) -> Model {
        Model { spec, found: None, asked: Vec::new(), tick: 0 }
    }

    /// Notes that something was asked. Returns its place.
    pub fn ask(&mut self, operation: Operation) -> usize {
        self.asked.push((operation, Fate::Unknown));
        self.asked.len() - 1
    }

    /// Notes what became of it.
    pub fn learn(&mut self, place: usize, fate: Fate) {
        self.asked[place].1 = fate;
    }

    /// Notes at which tick a change was told to be.
    pub fn learn_tick(&mut self, tick: u64) {
        // A reset begins anew, and who knows when it was.
        let reset = |(operation, _): &(Operation, Fate)| *operation == Operation::Reset;
        if !self.asked.iter().any(reset) {
            self.tick = self.tick.max(tick);
        }
    }

    /// How many requests are in doubt.
    pub fn doubts(&self) -> usize {
        self.asked.iter().filter(|(_, fate)| *fate == Fate::Unknown).count()
    }

    /// Takes in how it was found, and at which tick.
    ///
    /// # Errors
    /// Where it can't be so after what was told.
    pub fn find(&mut self, found: Option<State>, tick: u64) -> Result<(), String> {
        let mut possible = BTreeSet::from([self.found.clone()]);
        for (operation, fate) in &self.asked {
            possible = match fate {
                Fate::Refused => continue,
                Fate::Done => possible.iter().map(|state| self.after(state, operation)).collect(),
                Fate::Unknown => (possible.iter())
                    .flat_map(|state| [state.clone(), self.after(state, operation)])
                    .collect(),
            };
        }
        if !possible.contains(&found) {
            let Model { found: before, asked, .. } = &*self;
            let parts = |state: &Option<State>| {
                let fallen = state.as_ref().map_or(0, |state| state.fallen);
                fallen / self.mass(metres(1, &self.spec.grid))
            };
            return Err(format!(
                "it is {found:?} ({} parts of snow); it was {before:?} ({}), then {asked:?}",
                parts(&found),
                parts(before)
            ));
        }
        let begins = |(operation, _): &(Operation, Fate)| {
            matches!(operation, Operation::Reset | Operation::Create | Operation::Delete)
        };
        if self.asked.iter().any(begins) {
            self.tick = 0;
        }
        if tick < self.tick {
            return Err(format!("it is at tick {tick}, and {} was told with a change", self.tick));
        }
        self.found = found;
        self.asked.clear();
        Ok(())
    }

    /// What it was found to be.
    pub fn found(&self) -> Option<&State> {
        self.found.as_ref()
    }

    fn after(&self, state: &Option<State>, operation: &Operation) -> Option<State> {
        let begin = || State {
            fallen: self.spec.initial_snow.iter().map(|layer| self.mass(layer.depth)).sum(),
            air: self.spec.air_temperature as i32,
            paused: self.spec.paused,
            objects: BTreeMap::new(),
        };
        let mut state = match (state, operation) {
            (_, Operation::Delete) => return None,
            (None, Operation::Create) => return Some(begin()),
            (state, _) => state.clone()?,
        };
        match *operation {
            // Acknowledged again, as it was before.
            Operation::Create | Operation::Delete | Operation::Step(_) => {}
            Operation::Snowfall(depth) => state.fallen += self.mass(metres(depth, &self.spec.grid)),
            Operation::Air(celsius) => state.air = celsius,
            Operation::Pause(paused) => state.paused = paused,
            Operation::Put(object, mass) => drop(state.objects.insert(object, mass)),
            Operation::Remove(object) => drop(state.objects.remove(&object)),
            Operation::Reset => state = begin(),
        }
        Some(state)
    }

    /// Mass of fresh snow of a depth \[m\] everywhere, in quanta.
    fn mass(&self, depth: f64) -> u128 {
        let Grid { width, depth: columns_z, .. } = self.spec.grid;
        let column = (depth * self.spec.material.fresh_density * MASS_QUANTA).round() as u128;
        column * u128::from(width) * u128::from(columns_z)
    }
}
