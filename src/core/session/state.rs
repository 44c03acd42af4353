//! The host's half of a snowpack: all but its cells.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use firn_engine::frame::Placement;
use firn_protocol::{SessionSpec, Settings};
use firn_snow::{Body, Contact, Grid, Material};

use crate::core::session::{Alpine, Carried, Clock, Falling, Ground, Ledger, Reach, Snowing};

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
    /// Snow has come back to an object that does not weigh on it yet.
    pub returned: bool,
    pub ledger: Ledger,
    pub falling: Falling,
    /// The ground, where it is no longer the one that the session was created with.
    pub ground: Option<Ground>,
    /// The weather, where the snow is alpine.
    pub alpine: Option<Alpine>,
}

/// An object on the snow.
#[derive(Clone, Debug)]
pub(crate) struct Collider {
    pub body: Body,
    /// As the device has it.
    pub placement: Arc<Placement>,
    /// Snow on it.
    pub carried: Carried,
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
            returned: false,
            ledger: Ledger::default(),
            falling: Falling::default(),
            ground: None,
            alpine: Alpine::new(spec),
        }
    }

    /// What falls in a tick.
    pub fn snowing(&self) -> Snowing {
        let rate = self.settings.snowfall_rate;
        let density = match &self.alpine {
            Some(alpine) if rate > 0.0 => Alpine::new_snow(&alpine.weather_of_step()).0,
            _ => self.material.fresh_density,
        };
        Snowing::new(rate, density, self.clock.dt(), &self.grid)
    }

    /// Temperature of snow that falls by itself \[°C\].
    pub fn snowing_celsius(&self) -> f64 {
        let alpine = self.alpine.as_ref();
        alpine.map_or(self.settings.air_temperature, |it| Alpine::new_snow(&it.weather_of_step()).1)
    }

    /// Density \[kg/m³\] and temperature \[°C\] of snow that falls now, where nobody says.
    pub fn new_snow(&self) -> (f64, f64) {
        match &self.alpine {
            Some(alpine) => Alpine::new_snow(&alpine.weather.at(self.clock.sim_time())),
            None => (self.material.fresh_density, self.settings.air_temperature),
        }
    }

    /// The settings, with the temperature that the air has now.
    pub fn settings_now(&self) -> Settings {
        let Some(alpine) = &self.alpine else { return self.settings };
        let air_temperature = alpine.weather.at(self.clock.sim_time()).air_temperature;
        Settings { air_temperature, ..self.settings }
    }

    /// Ticks until snow that falls by itself is laid somewhere; none where it doesn't snow.
    pub fn ticks_until_snow(&self) -> Option<u64> {
        self.falling.ticks_until_due(self.clock.tick(), self.snowing(), &self.grid)
    }
}

impl Collider {
    /// An object without snow on it that has not touched any yet; nothing if none of its columns is in the grid.
    pub fn new(body: Body, grid: &Grid) -> Option<Collider> {
        let (mass, cover, footprints) = (body.load(), body.cover(), body.on(grid)?);
        let placement = Arc::new(Placement { mass, cover, footprints });
        let reach = Reach::new(&body, grid);
        let (carried, contact) = (Carried::default(), Contact::default());
        Some(Collider { body, placement, carried, contact, reach })
    }

    /// What an object weighs on the snow with what it carries \[kg\].
    pub fn weight(body: &Body, carried: &Carried, grid: &Grid) -> f64 {
        let burden = if body.airborne { 0.0 } else { grid.kilograms(carried.burden.mass) };
        body.load() + burden
    }
}
