//! The host's half of a snowpack: all but its cells.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use firn_protocol::{SessionSpec, Settings};
use firn_snow::{Body, Contact, Grid, Material};

use crate::core::session::{Clock, Falling, Ground, Ledger, Reach, Snowing};

/// The host's half of a snowpack: all but its cells. Changes are decided and applied here, without a device.
#[derive(Clone, Debug)]
pub(crate) struct SessionState {
    pub grid: Grid,
    pub clock: Clock,
    pub settings: Settings,
    pub material: Material,
    pub colliders: BTreeMap<Arc<str>, Collider>,
    /// Those of them that move by themselves.
    pub movers: BTreeSet<Arc<str>>,
    pub ledger: Ledger,
    pub falling: Falling,
    /// The ground, where it is no longer the one that the session was created with.
    pub ground: Option<Ground>,
}

/// An object on the snow.
#[derive(Clone, Debug)]
pub(crate) struct Collider {
    pub body: Body,
    /// As last published.
    pub contact: Contact,
    /// How far it reaches.
    pub reach: Reach,
}

impl SessionState {
    /// As a session begins, without snow.
    pub fn new(spec: &SessionSpec) -> SessionState {
        SessionState {
            grid: spec.grid,
            clock: Clock::new(spec.tick_rate, spec.time_scale),
            settings: spec.settings(),
            material: spec.material,
            colliders: BTreeMap::new(),
            movers: BTreeSet::new(),
            ledger: Ledger::default(),
            falling: Falling::default(),
            ground: None,
        }
    }

    /// What falls in a tick.
    pub fn snowing(&self) -> Snowing {
        let rate = self.settings.snowfall_rate;
        Snowing::new(rate, self.material.fresh_density, self.clock.dt(), &self.grid)
    }

    /// Ticks until snow that falls by itself is laid somewhere; none where it doesn't snow.
    pub fn ticks_until_snow(&self) -> Option<u64> {
        self.falling.ticks_until_due(self.clock.tick(), self.snowing(), &self.grid)
    }
}

impl Collider {
    /// An object that has not touched the snow yet.
    pub fn new(body: Body, grid: &Grid) -> Collider {
        let reach = Reach::new(&body, grid);
        Collider { body, contact: Contact::default(), reach }
    }
}
