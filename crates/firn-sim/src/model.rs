//! What clients know of a session: the states that it may be in after what they were told.

mod state;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use std::sync::Arc;

use firn::session::Applied;
use firn_protocol::SessionSpec;
use firn_snow::{Grid, MASS_QUANTA};

pub use state::{Found, State};

use crate::client::{Heard, Told};

/// What may be asked of a session.
#[derive(Clone, Debug, PartialEq)]
pub enum Operation {
    /// It is made: as its model says, or from the snapshot of a number above 0.
    Create(usize),
    /// It is deleted.
    Delete,
    /// Snow of so many 256th parts of a cell falls everywhere.
    Snowfall(u32),
    /// Snow is cleared to so many 256th parts of a cell, in so many columns along x.
    Clear(u32, u8),
    /// The air gets a temperature \[°C\].
    Air(i32),
    /// Its time stands still, or goes on.
    Pause(bool),
    /// An object of a mass \[kg\] is put.
    Put(u8, u32),
    /// An object is taken away.
    Remove(u8),
    /// A print is pressed somewhere, by so many kPa.
    Stamp(u8, u8),
    /// So many ticks are taken, where its time stands still.
    Step(u64),
    /// The step under way ends.
    EndStep,
    /// It gets other tokens.
    Reissue,
    /// Back to how it was made.
    Reset,
    /// It becomes what the snapshot of a number above 0 holds.
    Restore(usize),
    /// Its state is kept under a name.
    Keep(u8),
    /// What is kept under a name is forgotten.
    Forget(u8),
    /// Back to what is kept under a name.
    GoBack(u8),
}

impl Operation {
    /// Whether something else begins with it: counts of what came before say nothing any more.
    pub fn begins(&self) -> bool {
        matches!(self, Operation::Create(_) | Operation::Delete) || self.resets()
    }

    /// Whether it becomes another state of its own.
    fn resets(&self) -> bool {
        matches!(self, Operation::Reset | Operation::Restore(_) | Operation::GoBack(_))
    }

    /// Whether nobody could tell which of several requests at a time came before it.
    pub fn is_alone(&self) -> bool {
        self.begins() || matches!(self, Operation::Keep(_) | Operation::Forget(_))
    }
}

/// A number of 256th parts of a cell, as a depth \[m\].
pub fn metres(parts: u32, grid: &Grid) -> f64 {
    f64::from(parts) * grid.cell_size / 256.0
}

/// A mass \[kg\] in quanta.
pub fn quanta(mass: f64, grid: &Grid) -> u128 {
    (mass / grid.kilograms(1)).round() as u128
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

/// Something that was asked.
#[derive(Debug)]
struct Asked {
    operation: Operation,
    fate: Fate,
    /// The token that was told with it.
    token: Option<String>,
}

/// A session, and what was asked of it since it was last looked at.
#[derive(Debug)]
pub struct Model {
    /// What it is made with.
    pub spec: SessionSpec,
    /// Snapshots of it, oldest first. A request that restores one gives its number in this list, from 1.
    snapshots: Vec<Arc<[u8]>>,
    /// As it is when it has just been made: as the spec says, and from each snapshot.
    beginnings: Vec<State>,
    /// As it may have been found; `None` where there was none.
    found: BTreeSet<Option<State>>,
    asked: Vec<Asked>,
    /// Hashes of all tokens that it was known to have.
    tokens: BTreeSet<String>,
    /// Newest tick that was told with a change.
    tick: u64,
    /// Mass that was cleared when it was last looked at, and since then as far as that was told, in quanta.
    cleared: (u128, u128),
}

impl Model {
    /// A session that is not there yet.
    pub fn new(spec: SessionSpec) -> Model {
        let mut model = Model {
            spec,
            snapshots: Vec::new(),
            beginnings: Vec::new(),
            found: BTreeSet::from([None]),
            asked: Vec::new(),
            tokens: BTreeSet::new(),
            tick: 0,
            cleared: (0, 0),
        };
        let fallen = model.spec.initial_snow.iter().map(|layer| model.mass(layer.depth)).sum();
        model.beginnings.push(State::new(&model.spec, fallen));
        model
    }

    /// Keeps a snapshot of the session that was just found, whose time stood still.
    pub fn keep(&mut self, snapshot: Arc<[u8]>) {
        if let Some(state) = self.found().cloned() {
            self.snapshots.push(snapshot);
            self.beginnings.push(State { paused: true, kept: BTreeMap::new(), ..state });
        }
    }

    /// How many snapshots of it are kept.
    pub fn snapshots(&self) -> usize {
        self.snapshots.len()
    }

    /// The snapshot that it is made from, where it is one.
    pub fn snapshot(&self, beginning: usize) -> Option<Arc<[u8]>> {
        self.snapshots.get(beginning.checked_sub(1)?).cloned()
    }

    /// Notes that something was asked. Returns its place.
    pub fn ask(&mut self, operation: Operation) -> usize {
        self.asked.push(Asked { operation, fate: Fate::Unknown, token: None });
        self.asked.len() - 1
    }

    /// Notes what became of it, and what was told of that.
    pub fn learn(&mut self, place: usize, fate: Fate, told: &Told) {
        self.asked[place].fate = fate;
        match told {
            Ok(Heard::Applied(applied)) => {
                // A reset begins anew, and who knows when it was.
                if !self.asked.iter().any(|asked| asked.operation.resets()) {
                    self.tick = self.tick.max(applied.stamp().tick);
                }
                if let Applied::Clearing(reply) = &**applied {
                    self.cleared.1 += quanta(reply.cleared_mass, &self.spec.grid);
                }
            }
            Ok(Heard::Token(token)) => self.asked[place].token = Some(token.clone()),
            Ok(Heard::Nothing) | Err(_) => {}
        }
    }

    /// Whether nobody knows what is kept under some name.
    pub fn doubts_what_is_kept(&self) -> bool {
        let kept =
            |operation: &Operation| matches!(operation, Operation::Keep(_) | Operation::Forget(_));
        self.asked.iter().any(|asked| asked.fate == Fate::Unknown && kept(&asked.operation))
    }

    /// How many requests are in doubt.
    pub fn doubts(&self) -> usize {
        self.asked.iter().filter(|asked| asked.fate == Fate::Unknown).count()
    }

    /// Takes in how it was found.
    ///
    /// # Errors
    /// Where it can't be so after what was told.
    pub fn find(&mut self, found: Option<Found>) -> Result<(), String> {
        let mut possible = self.found.clone();
        for Asked { operation, fate, token } in &self.asked {
            let after = |state: &Option<State>| self.after(state.as_ref(), operation, token);
            possible = match fate {
                Fate::Refused => continue,
                Fate::Done => possible.iter().map(after).collect(),
                Fate::Unknown => {
                    possible.iter().flat_map(|state| [state.clone(), after(state)]).collect()
                }
            };
        }
        let is_it = |state: &Option<State>| match (state, &found) {
            (Some(state), Some(found)) => state.is(found, !self.tokens.contains(&found.token)),
            (state, found) => state.is_none() && found.is_none(),
        };
        possible.retain(is_it);
        if possible.is_empty() {
            let Model { found: before, asked, .. } = &*self;
            let parts = |fallen| fallen / self.mass(metres(1, &self.spec.grid));
            let parts_of = |state: &Option<State>| state.as_ref().map(|state| parts(state.fallen));
            return Err(format!(
                "it is {found:?} ({:?} parts of snow); it was {before:?} ({:?}), then {asked:?}",
                found.as_ref().map(|found| parts(*found.fallen.start())),
                before.iter().map(parts_of).collect::<Vec<_>>(),
            ));
        }
        if let Some(found) = &found {
            self.check_counts(found)?;
            let token = Some(found.token.clone());
            let known = |state: State| State { token: token.clone(), ..state };
            possible = possible.into_iter().map(|state| state.map(known)).collect();
        }
        self.tokens.extend(found.map(|found| found.token));
        self.tokens.extend(self.asked.drain(..).filter_map(|asked| asked.token));
        self.found = possible;
        Ok(())
    }

    /// Compares what is counted with what was told.
    fn check_counts(&mut self, found: &Found) -> Result<(), String> {
        let (before, told) = std::mem::take(&mut self.cleared);
        let begins = self.asked.iter().any(|asked| asked.operation.begins());
        if begins {
            self.tick = 0;
        } else {
            let clears = |asked: &&Asked| matches!(asked.operation, Operation::Clear(..));
            let in_doubt = |asked: &Asked| asked.fate == Fate::Unknown;
            let more_may_be = self.asked.iter().filter(clears).any(in_doubt);
            let (least, cleared) = (before + told, found.cleared);
            if cleared < least || (cleared > least && !more_may_be) {
                return Err(format!("{cleared} quanta were cleared: {before}, and then {told}"));
            }
        }
        self.cleared = (found.cleared, 0);
        if found.tick < self.tick {
            let Found { tick, .. } = found;
            return Err(format!("it is at tick {tick}, and {} was told with a change", self.tick));
        }
        Ok(())
    }

    /// What it was found to be.
    pub fn found(&self) -> Option<&State> {
        self.found.first()?.as_ref()
    }

    fn after(
        &self,
        state: Option<&State>,
        operation: &Operation,
        token: &Option<String>,
    ) -> Option<State> {
        let begin = |origin: usize| State { origin, ..self.beginnings[origin].clone() };
        let mut state = match (state, operation) {
            (_, Operation::Delete) => return None,
            (None, Operation::Create(beginning)) => {
                return Some(State { token: token.clone(), ..begin(*beginning) });
            }
            (state, _) => state?.clone(),
        };
        match *operation {
            // Acknowledged again, as it was before.
            Operation::Create(_) | Operation::Delete => {}
            // Counted elsewhere.
            Operation::Clear(..) | Operation::Step(_) | Operation::EndStep => {}
            // It takes no mass along.
            Operation::Stamp(..) => {}
            Operation::Snowfall(depth) => state.fallen += self.mass(metres(depth, &self.spec.grid)),
            Operation::Air(celsius) => state.air = celsius,
            Operation::Pause(paused) => state.paused = paused,
            Operation::Put(object, mass) => drop(state.objects.insert(object, mass)),
            Operation::Remove(object) => drop(state.objects.remove(&object)),
            Operation::Reissue => state.token = token.clone(),
            Operation::Reset => {
                let origin = begin(state.origin);
                state = state.becomes(origin);
            }
            Operation::Restore(snapshot) => state = state.becomes(begin(snapshot)),
            Operation::Keep(name) => {
                let kept = State { kept: BTreeMap::new(), ..state.clone() };
                state.kept.insert(name, kept);
            }
            Operation::Forget(name) => drop(state.kept.remove(&name)),
            Operation::GoBack(name) => {
                if let Some(kept) = state.kept.get(&name).cloned() {
                    state = state.becomes(kept);
                }
            }
        }
        Some(state)
    }

    /// What clients may have let fall of a mass that has fallen up to a tick, in quanta. What falls by itself is
    /// deposited when a 256th part of a cell has fallen, on the average column no later than that and two ticks.
    pub fn let_fall(&self, fallen: u128, tick: u64) -> RangeInclusive<u128> {
        let SessionSpec { snowfall_rate, tick_rate, time_scale, grid, .. } = &self.spec;
        if *snowfall_rate == 0.0 {
            return fallen..=fallen;
        }
        let hours = |ticks: u64| ticks as f64 * time_scale / tick_rate / 3600.0;
        // Less than a quantum of each column stays in the air, and sums are rounded.
        let rounding = u128::from(grid.columns()) * 2;
        let by_itself = self.mass(snowfall_rate * hours(tick));
        let late = self.mass(metres(1, grid) + snowfall_rate * hours(2)) + rounding;
        fallen.saturating_sub(by_itself + rounding)..=fallen.saturating_sub(by_itself) + late
    }

    /// Mass of fresh snow of a depth \[m\] everywhere, in quanta.
    fn mass(&self, depth: f64) -> u128 {
        let Grid { width, depth: columns_z, .. } = self.spec.grid;
        let column = (depth * self.spec.material.fresh_density * MASS_QUANTA).round() as u128;
        column * u128::from(width) * u128::from(columns_z)
    }
}
