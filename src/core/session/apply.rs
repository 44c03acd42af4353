//! Commands, carried out: live ones, and those of the journal.

use firn_engine::frame::{Deposit, Edit, Stamp};
use firn_protocol::WeatherInput;
use firn_snow::{Body, ColumnRect, ColumnSet, Material, columns_along};
use std::sync::Arc;

use crate::core::session::{Collider, Command, Counted, Kept, Orders, SessionState, prints};

/// What may move again after a command.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Disturbed {
    /// Tiles in which something may, where there are any.
    pub tiles: Option<u64>,
    /// Every tile has to be looked at again.
    pub all: bool,
}

impl SessionState {
    /// Carries out a command in the frame of some orders. It can't fail.
    pub fn apply(&mut self, command: &Command, orders: &mut Orders) -> Disturbed {
        match command {
            Command::Deposit { columns, depth, mass, celsius } => {
                let kept = Kept::of(*depth, *mass, &self.grid);
                let all = u128::from(columns.columns());
                orders.counted.push(Counted::Refused(orders.edits.len()));
                self.ledger.fallen += u128::from(*mass) * all;
                self.ledger.refused += u128::from(kept.refused) * all;
                orders.edits.push(Edit::Deposit(Deposit {
                    columns: *columns,
                    depth: kept.depth,
                    mass: kept.mass,
                    temperature: *celsius,
                }));
                self.shelter(columns, &kept, *celsius, orders);
                Disturbed { tiles: Some(columns.tiles().columns()), all: false }
            }
            Command::Clear { columns, depth, spares } => {
                clear(&[*columns], *depth, *spares, orders)
            }
            Command::ClearPath { path, width, depth } => {
                clear(&columns_along(&self.grid, path, *width), *depth, true, orders)
            }
            // They were in the grid when this was decided.
            Command::Stamps(stamps) => {
                press(prints(stamps, &self.grid).into_iter().flatten(), orders)
            }
            Command::Weather(weather) => {
                self.hold(weather);
                orders.changed = true;
                Disturbed::default()
            }
            Command::Settings { settings, stiffness_exponent, weather } => {
                let (old, new) = (self.settings, *settings);
                let snows = (new.time_scale, new.tick_rate, new.snowfall_rate);
                if snows != (old.time_scale, old.tick_rate, old.snowfall_rate) {
                    self.falling.mark(self.clock.tick(), self.snowing());
                }
                if let Some(weather) = weather {
                    self.hold(weather);
                }
                let rate = (new.time_scale, new.tick_rate) != (old.time_scale, old.tick_rate);
                if rate {
                    self.clock.set_rate(new.tick_rate, new.time_scale);
                }
                let stiffness = *stiffness_exponent != self.material.stiffness_exponent;
                if stiffness {
                    self.material =
                        Material { stiffness_exponent: *stiffness_exponent, ..self.material };
                    orders.edits.push(Edit::SetMaterial(self.material));
                }
                let pressing = new.pressing != old.pressing;
                orders.changed |= new != old || stiffness;
                self.settings = new;
                // What has fallen doesn't hang in the air for ever.
                let stops = new.snowfall_rate == 0.0;
                let rest = stops.then(|| self.falling.lay_rest(&self.grid)).flatten();
                let tiles = rest.and_then(|rest| self.apply(&rest, orders).tiles);
                Disturbed { tiles, all: rate || stiffness || pressing }
            }
            Command::Ground(ground) => {
                orders.edits.push(Edit::SetGround(ground.heights().clone()));
                orders.changed = true;
                self.ground = Some(ground.clone());
                let tiles = self.colliders.values().map(|collider| collider.reach.tiles).sum();
                Disturbed { tiles: Some(tiles).filter(|tiles| *tiles > 0), all: false }
            }
            // It brings another state along.
            Command::Reset => Disturbed::default(),
            Command::Objects { removed, put } => {
                let removed = removed.iter().map(|id| self.remove(id, orders)).sum::<u64>();
                let put = put.iter().map(|(id, object)| self.put(id, object, orders)).sum::<u64>();
                orders.changed |= removed + put > 0;
                Disturbed { tiles: Some(removed + put).filter(|tiles| *tiles > 0), all: false }
            }
        }
    }

    /// Has some weather hold from now on.
    fn hold(&mut self, weather: &Arc<WeatherInput>) {
        self.falling.mark(self.clock.tick(), self.snowing());
        if let Some(alpine) = &mut self.alpine {
            alpine.weather = weather.clone();
        }
    }

    /// Puts an object. Returns on how many tiles it stands.
    fn put(&mut self, id: &Arc<str>, object: &Body, orders: &mut Orders) -> u64 {
        let before = self.colliders.remove(id);
        // It was in the grid when this was decided.
        let Some(mut collider) = Collider::new(object.clone(), &self.grid) else { return 0 };
        // What leaves an object where it is doesn't move it: the depth it has sunk goes on counting.
        let placed = before.as_ref().is_none_or(|old| !old.body.stands_as(object));
        if let Some(mut old) = before {
            let after = ColumnSet::under(&collider.placement.footprints);
            self.lay_down(&mut old, &after, Some(id), orders);
            collider.carried = old.carried;
            collider.weigh(&self.grid);
        }
        if object.motion.is_still() {
            self.movers.remove(id);
        } else {
            self.movers.insert(id.clone());
        }
        let placement = collider.placement.clone();
        orders.edits.push(Edit::PutCollider { id: id.clone(), collider: placement, placed });
        let tiles = collider.reach.tiles;
        self.colliders.insert(id.clone(), collider);
        tiles
    }

    /// Takes an object away. Snow that lies on it is laid down; what finds no room is refused. Returns on how many
    /// tiles it stood.
    fn remove(&mut self, id: &Arc<str>, orders: &mut Orders) -> u64 {
        let Some((id, mut collider)) = self.colliders.remove_entry(id) else { return 0 };
        self.movers.remove(&id);
        self.lay_down(&mut collider, &ColumnSet::default(), None, orders);
        let rest = collider.carried.mass();
        self.ledger.carried -= rest;
        self.ledger.refused += rest;
        orders.edits.push(Edit::RemoveCollider { id });
        collider.reach.tiles
    }
}

/// Has prints pressed in the frame of some orders.
pub(crate) fn press(prints: impl Iterator<Item = Arc<Stamp>>, orders: &mut Orders) -> Disturbed {
    let mut tiles = 0;
    for print in prints {
        tiles += print.coverage.columns.tiles().columns();
        orders.edits.push(Edit::Stamp(print));
    }
    Disturbed { tiles: Some(tiles), all: false }
}

/// Clears rectangles of columns to a depth in quanta, under objects too or but for those.
fn clear(rects: &[ColumnRect], depth: u32, spares: bool, orders: &mut Orders) -> Disturbed {
    for &columns in rects {
        orders.counted.push(Counted::Cleared(orders.edits.len()));
        orders.edits.push(match spares {
            true => Edit::Clear { columns, depth },
            false => Edit::Strip { columns, depth },
        });
    }
    let tiles = rects.iter().map(|columns| columns.tiles().columns()).sum();
    Disturbed { tiles: Some(tiles), all: false }
}
