//! Snow that lies on objects: it falls on them, weighs them down, and is laid on the columns they leave.
//!
//! All of it is known here, but for what finds no room where it is laid. The device tells that after a frame. It goes
//! back to the object, and weighs on it from the tick after next on. However ticks are cut into frames, it is known by
//! then, because no more than one of them is taken meanwhile.

use std::sync::Arc;

use firn_engine::frame::{Deposit, Edit, Placement};
use firn_snow::{Burden, CELL, Cell, ColumnRect, ColumnSet, Grid};
use serde::{Deserialize, Serialize};

use crate::core::session::{Collider, Counted, Kept, Ledger, Orders, SessionState};

/// Snow that lies on an object.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Carried {
    /// What weighs on it.
    pub burden: Burden,
    /// What has found no room where it was laid down at a tick, and does not weigh on it yet.
    pub returned: Vec<(u64, Burden)>,
}

impl Carried {
    /// Whether there is none.
    pub fn is_none(&self) -> bool {
        self.mass() == 0
    }

    /// Whether it is not impossible at a tick.
    pub fn is_sound(&self, tick: u64) -> bool {
        let returned = |(at, snow): &(u64, Burden)| *at <= tick && snow.is_sound();
        self.burden.is_sound() && self.returned.iter().all(returned)
    }

    /// Mass of all of it, in quanta.
    pub fn mass(&self) -> u128 {
        self.burden.mass + self.returned.iter().map(|(_, snow)| snow.mass).sum::<u128>()
    }

    /// Notes what has found no room where it was laid down at a tick.
    fn give_back(&mut self, snow: Burden, tick: u64) {
        match self.returned.last_mut() {
            Some((at, all)) if *at == tick => all.add(snow),
            _ => self.returned.push((tick, snow)),
        }
    }

    /// Has what was laid down before a tick weigh on the object again. Returns whether there was any.
    fn take_back(&mut self, tick: u64) -> bool {
        let before = self.returned.len();
        let burden = &mut self.burden;
        self.returned.retain(|(at, snow)| {
            if *at < tick {
                burden.add(*snow);
            }
            *at >= tick
        });
        self.returned.len() < before
    }
}

/// Snow that an object lays down: the columns, and what each of them gets.
pub(crate) struct Laid {
    columns: Vec<ColumnRect>,
    snow: Cell,
}

impl Laid {
    /// Edits that lay it, numbered from one on, and how what finds no room is counted: it goes back to the object of
    /// an id, if that is there still.
    pub fn edits(
        self,
        back_to: Option<&Arc<str>>,
        first: usize,
    ) -> impl Iterator<Item = (Edit, Counted)> {
        let Laid { columns, snow } = self;
        let Cell { mass, thickness: depth, temperature, .. } = snow;
        (first..).zip(columns).map(move |(edit, columns)| {
            let counted = match back_to {
                Some(id) => Counted::Returned { edit, id: id.clone(), snow },
                None => Counted::Refused(edit),
            };
            (Edit::Lay(Deposit { columns, depth, mass, temperature }), counted)
        })
    }
}

impl Collider {
    /// Takes off what lies on it over the columns that are under it no more. Nothing comes off where a column would
    /// get less than a quantum.
    pub fn unload(&mut self, after: &ColumnSet, ledger: &mut Ledger) -> Option<Laid> {
        if self.carried.burden.is_none() {
            return None;
        }
        let before = ColumnSet::under(&self.placement.footprints);
        let left = before.without(after);
        let snow = self.carried.burden.take(left.count(), before.count())?;
        ledger.carried -= u128::from(left.count()) * u128::from(snow.mass);
        Some(Laid { columns: left.rects(), snow })
    }

    /// Has it weigh what it does with the snow on it.
    pub fn weigh(&mut self, grid: &Grid) {
        let mass = Collider::weight(&self.body, &self.carried, grid);
        Arc::make_mut(&mut self.placement).mass = mass;
    }

    /// Whether one of its columns may be in a rectangle.
    fn is_above(&self, rect: &ColumnRect) -> bool {
        let Placement { footprints, .. } = &*self.placement;
        footprints.iter().any(|footprint| {
            let (x0, x1) = footprint.extent();
            let z1 = footprint.z0 + footprint.spans.len() as u32;
            let all = ColumnRect { x0, z0: footprint.z0, x1, z1 };
            all.overlap(rect).is_some()
        })
    }
}

impl SessionState {
    /// Has objects keep what falls on them in a rectangle, as high as a column at the most. Where several are above a
    /// column, the one with the lowest id does.
    pub fn shelter(&mut self, rect: &ColumnRect, kept: &Kept, celsius: f32, orders: &mut Orders) {
        let highest = u128::from(self.grid.height) * u128::from(CELL);
        let mut sheltered = ColumnSet::default();
        for (id, collider) in &mut self.colliders {
            if !collider.body.shelters || !collider.is_above(rect) {
                continue;
            }
            let under = ColumnSet::under(&collider.placement.footprints);
            let own = under.within(rect).without(&sheltered);
            sheltered.join(&own);
            let snow = Burden::of(own.count(), kept.mass.into(), kept.depth.into(), celsius);
            if !snow.is_none() {
                let burden = &mut collider.carried.burden;
                burden.add(snow);
                let refused = burden.cut(highest * u128::from(under.count()));
                self.ledger.carried += snow.mass;
                self.ledger.carried -= refused;
                self.ledger.refused += refused;
                orders.weighed.insert(id.clone());
            }
        }
    }

    /// Lays what lies on an object on the columns that it leaves. What finds no room there goes back to it, if it is
    /// there still.
    pub fn lay_down(
        &mut self,
        collider: &mut Collider,
        after: &ColumnSet,
        back_to: Option<&Arc<str>>,
        orders: &mut Orders,
    ) {
        let Some(laid) = collider.unload(after, &mut self.ledger) else { return };
        for (edit, counted) in laid.edits(back_to, orders.edits.len()) {
            orders.edits.push(edit);
            orders.counted.push(counted);
        }
    }

    /// Gives back to an object what has found no room where it was laid down at a tick.
    pub fn give_back(&mut self, id: &str, snow: &Cell, mass: u128, tick: u64) {
        if mass == 0 {
            return;
        }
        match self.colliders.get_mut(id) {
            Some(collider) => {
                collider.carried.give_back(Burden::part(mass, snow), tick);
                self.ledger.carried += mass;
                self.returned = true;
            }
            None => self.ledger.refused += mass,
        }
    }

    /// Lets what was given back weigh on objects, at the beginning of a tick. Returns on how many tiles they stand.
    pub fn take_back(&mut self, tick: u64, orders: &mut Orders) -> u64 {
        let mut tiles = 0;
        if std::mem::take(&mut self.returned) {
            for (id, collider) in &mut self.colliders {
                if collider.carried.take_back(tick) {
                    orders.weighed.insert(id.clone());
                    tiles += collider.reach.tiles;
                }
                self.returned |= !collider.carried.returned.is_empty();
            }
        }
        tiles
    }

    /// Tells the device what objects weigh on which more lies, or less.
    pub fn weigh(&mut self, orders: &mut Orders) {
        for id in std::mem::take(&mut orders.weighed) {
            let Some(collider) = self.colliders.get_mut(&id) else { continue };
            collider.weigh(&self.grid);
            let collider = collider.placement.clone();
            orders.edits.push(Edit::PutCollider { id, collider, placed: false });
        }
    }

    /// Whether what is laid down in a tick may find no room, so that the next one has to wait for it.
    pub fn may_return(&self, orders: &Orders) -> bool {
        let loaded = |id| self.colliders.get(id).is_some_and(|it| !it.carried.is_none());
        self.returned
            || orders.counted.iter().any(|counted| matches!(counted, Counted::Returned { .. }))
            || self.movers.iter().any(loaded)
    }
}
