//! The simulations of the world, and which of them want to be in the coming frames.

use std::collections::{BTreeMap, BTreeSet};

use crate::core::session::Simulation;

/// Simulations by their keys. What is done for the active ones costs nothing for all others.
#[derive(Debug, Default)]
pub(crate) struct Simulations {
    /// Place of each one.
    places: BTreeMap<u64, usize>,
    /// Boxed, so that a place costs little.
    all: Vec<Option<Box<Simulation>>>,
    free: BTreeSet<usize>,
    active: BTreeSet<usize>,
    /// Those whose anchors say that their time goes on.
    ticking: BTreeSet<usize>,
}

impl Simulations {
    pub fn contains_key(&self, key: &u64) -> bool {
        self.places.contains_key(key)
    }

    pub fn get(&self, key: &u64) -> Option<&Simulation> {
        self.all[*self.places.get(key)?].as_deref()
    }

    pub fn get_mut(&mut self, key: &u64) -> Option<&mut Simulation> {
        self.all[*self.places.get(key)?].as_deref_mut()
    }

    /// Adds a simulation, at rest.
    pub fn insert(&mut self, key: u64, mut simulation: Simulation) {
        let place = self.free.pop_first().unwrap_or_else(|| {
            self.all.push(None);
            self.all.len() - 1
        });
        simulation.place = place;
        self.all[place] = Some(Box::new(simulation));
        self.places.insert(key, place);
    }

    pub fn remove(&mut self, key: &u64) -> Option<Box<Simulation>> {
        let place = self.places.remove(key)?;
        self.active.remove(&place);
        self.ticking.remove(&place);
        self.free.insert(place);
        self.all[place].take()
    }

    /// Says whether a simulation wants to be in the coming frames.
    pub fn set_active(&mut self, key: u64, active: bool) {
        let Some(&place) = self.places.get(&key) else { return };
        set(&mut self.active, place, active);
    }

    /// Says whether a simulation's anchor says that its time goes on.
    pub fn set_ticking(&mut self, key: u64, ticking: bool) {
        let Some(&place) = self.places.get(&key) else { return };
        set(&mut self.ticking, place, ticking);
    }

    /// Whether any anchor says so.
    pub fn is_any_ticking(&self) -> bool {
        !self.ticking.is_empty()
    }

    /// Key of the one at a place.
    pub fn key(&self, place: usize) -> Option<u64> {
        Some(self.all[place].as_ref()?.session.key)
    }

    /// Keys of those that want to be in the coming frames and whose turn it is in this one: each is
    /// once in a round of so many frames.
    pub fn active_in_turn(&self, frame: u64, round: u64) -> Vec<u64> {
        let turn = |place: &&usize| **place as u64 % round == frame % round;
        let key = |&place: &usize| self.key(place);
        self.active.iter().filter(turn).filter_map(key).collect()
    }

    /// All that want to be in the coming frames, in the order of their places.
    pub fn active_mut(&mut self) -> Vec<&mut Simulation> {
        some_of(&mut self.all, self.active.iter().copied())
    }

    /// Those at some places, in ascending order.
    pub fn at_mut(&mut self, places: &[usize]) -> Vec<&mut Simulation> {
        some_of(&mut self.all, places.iter().copied())
    }

    /// Has none of them in the coming frames.
    pub fn clear_active(&mut self) {
        self.active.clear();
    }

    /// Keys of all of them.
    pub fn keys(&self) -> Vec<u64> {
        self.places.keys().copied().collect()
    }

    /// All of them, with their keys.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = (u64, &mut Simulation)> {
        self.all.iter_mut().flatten().map(|simulation| (simulation.session.key, &mut **simulation))
    }

    /// All of them, with their keys.
    pub fn into_iter(self) -> impl Iterator<Item = (u64, Box<Simulation>)> {
        self.all.into_iter().flatten().map(|simulation| (simulation.session.key, simulation))
    }
}

/// Those at some places, in ascending order.
fn some_of(
    mut rest: &mut [Option<Box<Simulation>>],
    places: impl ExactSizeIterator<Item = usize>,
) -> Vec<&mut Simulation> {
    let (mut found, mut first) = (Vec::with_capacity(places.len()), 0);
    for place in places {
        let (head, tail) = rest.split_at_mut(place - first + 1);
        found.extend(head.last_mut().and_then(|simulation| simulation.as_deref_mut()));
        (rest, first) = (tail, place + 1);
    }
    found
}

fn set(places: &mut BTreeSet<usize>, place: usize, there: bool) {
    if there {
        places.insert(place);
    } else {
        places.remove(&place);
    }
}
