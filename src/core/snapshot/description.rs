//! Everything of a snapshot but its cells, and what it may say.

use std::sync::Arc;

use firn_engine::frame::{Placement, TileCells};
use firn_protocol::{SessionSpec, Settings};
use firn_snow::{Contact, Footprint, Grid, Material, Position, Shape};
use serde::{Deserialize, Serialize};

use crate::core::session::{
    Check, Clock, Collider, Falling, Ledger, Limits, ObjectSpec, SessionError, SessionState,
};
use crate::core::snapshot::refused;

/// Everything but the cells.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    pub spec: SessionSpec,
    pub settings: Settings,
    pub material: Material,
    pub clock: Clock,
    pub falling: Falling,
    pub ledger: Ledger,
    pub settled: bool,
    pub last_cycle: Option<f64>,
    pub colliders: Vec<SavedCollider>,
}

/// An object and how it touched the snow.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedCollider {
    pub id: String,
    pub mass: f64,
    pub shape: Shape,
    pub position: Position,
    pub contact: Contact,
}

impl SavedCollider {
    /// Where it stands; `None` where that is not in the grid.
    pub fn placement(&self, grid: &Grid) -> Option<Arc<Placement>> {
        let footprint = Footprint::new(grid, &self.shape, self.position)?;
        Some(Arc::new(Placement { mass: self.mass, footprint }))
    }
}

impl Description {
    /// The host's half of what was saved.
    pub fn state(&self) -> SessionState {
        let grid = self.spec.grid;
        let collider = |saved: &SavedCollider| {
            let SavedCollider { mass, shape, position, contact, .. } = *saved;
            let collider = Collider { contact, ..Collider::new(mass, shape, position, &grid) };
            (Arc::from(saved.id.as_str()), collider)
        };
        SessionState {
            grid,
            clock: self.clock,
            settings: self.settings,
            material: self.material,
            colliders: self.colliders.iter().map(collider).collect(),
            ledger: self.ledger,
            falling: self.falling,
        }
    }

    /// Notes what no server would have saved.
    pub fn check(&self, limits: &Limits) -> Result<(), SessionError> {
        limits.check(&self.spec)?;
        let mut check = Check::default();
        check.settings(&self.settings);
        check.range("/material/stiffness_exponent", self.material.stiffness_exponent, 3.0, 6.0, "");
        let fixed =
            Material { stiffness_exponent: self.spec.material.stiffness_exponent, ..self.material };
        let clock_fits = self.clock.is_sound(self.settings.tick_rate, self.settings.time_scale);
        let snows = self.settings.snowfall_rate > 0.0;
        let ledger = &self.ledger;
        let out = ledger.refused.checked_add(ledger.cleared);
        for (pointer, sound) in [
            ("/spec/id", self.spec.id.is_none()),
            ("/material", fixed == self.spec.material),
            ("/clock", clock_fits),
            ("/falling", self.falling.is_sound(self.clock.tick(), snows, &self.spec)),
            // Not more than falls in a million years of the heaviest snowfalls.
            ("/ledger", out.is_some_and(|out| out <= ledger.fallen) && ledger.fallen < 1 << 120),
            ("/last_cycle", self.last_cycle.is_none_or(|dt| (0.0..=1.0).contains(&dt))),
            ("/colliders", self.colliders.len() <= limits.colliders_per_session),
        ] {
            if !sound {
                check.reject(pointer, "is not what a server would have saved");
            }
        }
        for (i, saved) in self.colliders.iter().enumerate() {
            let at = format!("/colliders/{i}");
            let SavedCollider { mass, shape, position, contact, .. } = *saved;
            let object = ObjectSpec { mass, shape, position };
            object.check(&mut check, &at, &saved.id, &self.spec.grid);
            let ordered = i == 0 || self.colliders[i - 1].id < saved.id;
            let positive = |number: f32| number > 0.0 && number.is_finite();
            // No elevation is as high as the number by which the device knows that there was none.
            let real = contact.last_cycle.is_none_or(|footing| footing.bottom < u32::MAX);
            if !(ordered && real && positive(contact.area) && positive(contact.pressure)) {
                check.reject(at, "is not what a server would have saved");
            }
        }
        check.finish()
    }

    /// Compares the mass of the cells with the ledger.
    pub fn check_mass(&self, tiles: &[TileCells]) -> Result<(), SessionError> {
        let mass: u64 = tiles.iter().flat_map(|tile| &tile.mass).map(|&mass| u64::from(mass)).sum();
        if u128::from(mass) == self.ledger.present() {
            return Ok(());
        }
        Err(refused("the mass of its cells is not that of its ledger"))
    }
}
