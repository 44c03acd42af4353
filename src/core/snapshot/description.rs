//! Everything of a snapshot but its cells, and what it may say.

use std::sync::Arc;

use firn_engine::frame::TileCells;
use firn_protocol::{Physics, SessionSpec, Settings, Site, WeatherInput};
use firn_snow::alpine::Gathering;
use firn_snow::{Body, Contact, Elevation, Grid, Material};
use serde::{Deserialize, Serialize};

use crate::core::session::{
    Alpine, Carried, Check, Clock, Collider, Falling, Ground, Ledger, Limits, SessionError,
    SessionState,
};
use crate::core::snapshot::refused;

/// Everything but the cells.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    pub spec: SessionSpec,
    /// The terrain of `spec` stands behind the description.
    #[serde(default)]
    pub terrain: bool,
    /// So does the ground as it is now, which is another.
    #[serde(default)]
    pub ground: bool,
    pub settings: Settings,
    pub material: Material,
    pub clock: Clock,
    pub falling: Falling,
    pub ledger: Ledger,
    pub settled: bool,
    pub last_cycle: Option<f64>,
    /// The weather, where the snow is alpine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alpine: Option<SavedAlpine>,
    pub colliders: Vec<SavedCollider>,
}

/// The weather of alpine snow, and how far the snow had come in it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedAlpine {
    /// Where it is no longer that of the specification.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weather: Option<Arc<WeatherInput>>,
    pub site: Arc<Site>,
    pub step: f64,
    pub steps: u64,
    pub gathering: Gathering,
}

impl SavedAlpine {
    pub(crate) fn new(alpine: &Alpine, spec: &SessionSpec) -> SavedAlpine {
        let Alpine { weather, site, step, steps, gathering } = alpine.clone();
        let weather = Some(weather).filter(|weather| spec.weather.as_ref() != Some(weather));
        SavedAlpine { weather, site, step, steps, gathering }
    }

    fn alpine(&self, spec: &SessionSpec) -> Option<Alpine> {
        let weather = self.weather.clone().or_else(|| spec.weather.clone())?;
        let SavedAlpine { site, step, steps, gathering, .. } = self.clone();
        Some(Alpine { weather, site, step, steps, gathering })
    }
}

/// An object and how it touched the snow.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SavedCollider {
    pub id: String,
    #[serde(flatten)]
    pub body: Body,
    pub contact: Contact,
    /// Snow on it.
    #[serde(default, skip_serializing_if = "Carried::is_none")]
    pub carried: Carried,
}

impl SavedCollider {
    /// The object; `None` where it does not stand in the grid.
    pub fn collider(&self, grid: &Grid) -> Option<Collider> {
        let mut collider = Collider::new(self.body.clone(), grid)?;
        (collider.contact, collider.carried) = (self.contact, self.carried.clone());
        collider.weigh(grid);
        Some(collider)
    }
}

impl Description {
    /// The host's half of what was saved.
    pub fn state(&self, ground: Option<Ground>) -> SessionState {
        let grid = self.spec.grid;
        let collider =
            |saved: &SavedCollider| Some((Arc::from(saved.id.as_str()), saved.collider(&grid)?));
        let returned = |saved: &SavedCollider| !saved.carried.returned.is_empty();
        let moves = |saved: &&SavedCollider| !saved.body.motion.is_still();
        SessionState {
            returned: self.colliders.iter().any(returned),
            movers: self.colliders.iter().filter(moves).map(|it| Arc::from(&*it.id)).collect(),
            grid,
            clock: self.clock,
            settings: self.settings,
            material: self.material,
            colliders: self.colliders.iter().filter_map(collider).collect(),
            ledger: self.ledger,
            falling: self.falling,
            ground,
            alpine: self.alpine(),
        }
    }

    /// The weather, where the snow is alpine.
    fn alpine(&self) -> Option<Alpine> {
        self.alpine.as_ref()?.alpine(&self.spec)
    }

    /// Notes what is wrong with the weather of alpine snow.
    fn check_alpine(&self, check: &mut Check) {
        let alpine = self.alpine();
        let sound = match &alpine {
            None => self.spec.physics == Physics::Thesis && self.alpine.is_none(),
            Some(alpine) => {
                check.range("/alpine/step", alpine.step, 60.0, 3600.0, "s");
                check.weather("/alpine/site", alpine.site.check());
                check.weather("/alpine/weather", alpine.weather.check(&alpine.site));
                self.spec.physics == Physics::Alpine && alpine.is_sound(&self.clock)
            }
        };
        if !sound {
            check.reject("/alpine", "is not what a server would have saved");
        }
    }

    /// Makes what version 1 of the format says what the present one does: its contacts are in half the quanta,
    /// above the lowest ground.
    pub fn bring_up_to_date(&mut self) {
        let lowest = Elevation::new(&self.spec.grid, self.spec.ground_range().0);
        let above_lowest =
            |halved: Elevation| Elevation(lowest.0.saturating_add(halved.0.saturating_mul(2)));
        for SavedCollider { contact, .. } in &mut self.colliders {
            contact.bottom = above_lowest(contact.bottom);
            contact.reference = above_lowest(contact.reference);
            contact.support = contact.support.saturating_mul(2);
            // The last cycle is only compared with a present one, to the quantum. None is equal to that.
            contact.last_cycle = None;
        }
    }

    /// Notes what no server would have saved.
    pub fn check(&self, limits: &Limits) -> Result<(), SessionError> {
        limits.check(&self.spec)?;
        let mut check = Check::default();
        check.settings(&self.settings, self.spec.physics);
        self.check_alpine(&mut check);
        check.range("/material/stiffness_exponent", self.material.stiffness_exponent, 3.0, 6.0, "");
        let fixed =
            Material { stiffness_exponent: self.spec.material.stiffness_exponent, ..self.material };
        let clock_fits = self.clock.is_sound(self.settings.tick_rate, self.settings.time_scale);
        let snows = self.settings.snowfall_rate > 0.0;
        let ledger = &self.ledger;
        let carried = self.colliders.iter().map(|saved| saved.carried.mass()).sum::<u128>();
        for (pointer, sound) in [
            ("/spec/id", self.spec.id.is_none()),
            ("/material", fixed == self.spec.material),
            ("/clock", clock_fits),
            ("/falling", self.falling.is_sound(self.clock.tick(), snows, &self.spec)),
            ("/ledger", ledger.is_sound()),
            ("/ledger/carried", ledger.carried == carried),
            ("/last_cycle", self.last_cycle.is_none_or(|dt| (0.0..=1.0).contains(&dt))),
            ("/colliders", self.colliders.len() <= limits.colliders_per_session),
        ] {
            if !sound {
                check.reject(pointer, "is not what a server would have saved");
            }
        }
        for (i, saved) in self.colliders.iter().enumerate() {
            let at = format!("/colliders/{i}");
            let SavedCollider { body, contact, .. } = saved;
            check.object(&at, &saved.id, body, &self.spec.grid);
            let ordered = i == 0 || self.colliders[i - 1].id < saved.id;
            let positive = |number: f32| number > 0.0 && number.is_finite();
            let presses =
                if body.airborne { contact.pressure == 0.0 } else { positive(contact.pressure) };
            let footing = contact.last_cycle.unwrap_or(contact.footing());
            let held = [contact.bottom, contact.reference, footing.bottom]
                .iter()
                .all(|elevation| (Elevation::LOWEST..=Elevation::HIGHEST).contains(elevation));
            let carries = saved.carried.is_sound(self.clock.tick());
            if !(ordered && held && positive(contact.area) && presses && carries) {
                check.reject(at, "is not what a server would have saved");
            }
        }
        check.finish()
    }

    /// Compares the mass of the cells with the ledger.
    pub fn check_mass(&self, tiles: &[TileCells]) -> Result<(), SessionError> {
        let mass: u64 = tiles.iter().flat_map(|tile| &tile.mass).map(|&mass| u64::from(mass)).sum();
        let gathered = self.alpine.as_ref().map_or(0, |alpine| alpine.gathering.mass);
        let gathered = u128::from(gathered) * u128::from(self.spec.grid.columns());
        if u128::from(mass) + gathered == self.ledger.present() {
            return Ok(());
        }
        Err(refused("the mass of its cells is not that of its ledger"))
    }
}
