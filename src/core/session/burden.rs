//! Snow that lies on objects: it falls on them, weighs them down, and is laid on the columns they leave.
//!
//! All of it is known here, but for what finds no room where it is laid. The device tells that after a frame; it
//! goes back to the object, and weighs on it from the tick after next on. However ticks are cut into frames, it is
//! known by then, because no more than one of them is taken meanwhile.

use std::sync::Arc;

use firn_engine::frame::{Deposit, Edit, Placement};
use firn_snow::{Burden, Cell, ColumnRect, ColumnSet, Grid};
use serde::{Deserialize, Serialize};

use crate::core::session::{Collider, Counted, Kept, Orders, SessionState};

/// Snow that lies on an object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Carried {
    /// What weighs on it.
    pub burden: Burden,
    /// What has found no room where it was laid down, and does not weigh on it yet.
    pub returned: Burden,
    /// Tick at which that was laid down.
    pub returned_at: u64,
}

impl Carried {
    /// Whether there is none.
    pub fn is_none(&self) -> bool {
        self.mass() == 0
    }

    /// Whether it is not impossible at a tick.
    pub fn is_sound(&self, tick: u64) -> bool {
        self.burden.is_sound() && self.returned.is_sound() && self.returned_at <= tick
    }

    /// Mass of all of it, in quanta.
    pub fn mass(&self) -> u128 {
        self.burden.mass + self.returned.mass
    }
}

/// Snow that objects lay down: the columns, and what each of them gets.
pub(crate) struct Laid {
    columns: Vec<ColumnRect>,
    snow: Cell,
}

impl Laid {
    /// Edits that lay it, and how they are counted where the first has a number.
    pub fn edits(self, id: &Arc<str>, first: usize) -> impl Iterator<Item = (Edit, Counted)> {
        let Laid { columns, snow } = self;
        let Cell { mass, thickness: depth, temperature, .. } = snow;
        (first..).zip(columns).map(move |(edit, columns)| {
            let deposit = Deposit { columns, depth, mass, temperature };
            (Edit::Lay(deposit), Counted::Returned { edit, id: id.clone(), snow })
        })
    }
}

impl Collider {
    /// Takes off what lies on it over the columns that are under it no more. Nothing comes off where a column would
    /// get less than a quantum.
    pub fn unload(&mut self, after: &ColumnSet) -> Option<Laid> {
        if self.carried.burden.is_none() {
            return None;
        }
        let before = ColumnSet::under(&self.placement.footprints);
        let left = before.without(after);
        let snow = self.carried.burden.take(left.count(), before.count())?;
        Some(Laid { columns: left.rects(), snow })
    }
}

impl SessionState {
    /// Has objects keep what falls on them in a rectangle; returns the columns that they shelter there. Where several
    /// are above a column, the one with the lowest id does.
    pub fn shelter(
        &mut self,
        rect: &ColumnRect,
        kept: &Kept,
        celsius: f32,
        orders: &mut Orders,
    ) -> u64 {
        let mut sheltered = ColumnSet::default();
        let mut columns = 0;
        for (id, collider) in &mut self.colliders {
            if !collider.body.shelters || !collider.is_above(rect) {
                continue;
            }
            let under = ColumnSet::under(&collider.placement.footprints).within(rect);
            let own = under.without(&sheltered);
            sheltered.join(&own);
            let count = own.count();
            columns += count;
            let snow = Burden::of(count, kept.mass.into(), kept.depth.into(), celsius);
            if !snow.is_none() {
                collider.carried.burden.add(snow);
                self.ledger.carried += snow.mass;
                orders.edits.push(collider.weighed(id, &self.grid));
            }
        }
        columns
    }

    /// Lays what an object is left with on the columns that it leaves.
    pub fn lay_down(
        &mut self,
        id: &Arc<str>,
        collider: &mut Collider,
        after: &ColumnSet,
        orders: &mut Orders,
    ) {
        let before = collider.carried.mass();
        let Some(laid) = collider.unload(after) else { return };
        self.ledger.carried -= before - collider.carried.mass();
        for (edit, counted) in laid.edits(id, orders.edits.len()) {
            orders.edits.push(edit);
            orders.counted.push(counted);
        }
    }

    /// Gives back to an object what has found no room where it was laid down at a tick.
    pub fn give_back(&mut self, id: &str, snow: &Cell, mass: u128, tick: u64) {
        if mass == 0 {
            return;
        }
        let Some(collider) = self.colliders.get_mut(id) else {
            self.ledger.refused += mass;
            return;
        };
        collider.carried.returned.add(Burden::part(mass, snow));
        collider.carried.returned_at = tick;
        self.ledger.carried += mass;
        self.returned = true;
    }

    /// Lets what was given back weigh on objects, at the beginning of a tick.
    pub fn weigh_returned(&mut self, tick: u64, orders: &mut Orders) {
        if !self.returned {
            return;
        }
        self.returned = false;
        for (id, collider) in &mut self.colliders {
            let carried = &mut collider.carried;
            if carried.returned.is_none() {
                continue;
            }
            if carried.returned_at < tick {
                carried.burden.add(std::mem::take(&mut carried.returned));
                orders.edits.push(collider.weighed(id, &self.grid));
            } else {
                self.returned = true;
            }
        }
    }

    /// Whether what is laid down in a tick may find no room, so that the next one has to wait for it.
    pub fn may_return(&self, orders: &Orders) -> bool {
        let loaded = |id| self.colliders.get(id).is_some_and(|it| it.carried.mass() > 0);
        self.returned
            || orders.counted.iter().any(|counted| matches!(counted, Counted::Returned { .. }))
            || self.movers.iter().any(loaded)
    }
}

impl Collider {
    /// Has snow lie on it.
    pub fn carry(&mut self, carried: Carried, grid: &Grid) {
        self.carried = carried;
        let placement = Arc::make_mut(&mut self.placement);
        placement.mass = Collider::weight(&self.body, &carried, grid);
    }

    /// Puts it where it stands, with what lies on it now.
    fn weighed(&mut self, id: &Arc<str>, grid: &Grid) -> Edit {
        self.carry(self.carried, grid);
        Edit::PutCollider { id: id.clone(), collider: self.placement.clone(), placed: false }
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
