//! What a session may be created with.

use firn_protocol::{Physics, SessionSpec, Settings, is_valid_id};
use firn_snow::alpine::{ICE_DENSITY, WATER_DENSITY};
use firn_snow::weather::Problem as WeatherProblem;
use firn_snow::{Grid, MAX_COLUMN_MASS, Material, Pressing};

use crate::core::session::{Check, Ground, SessionError};

/// Most layers of initial snow.
const MOST_LAYERS: usize = 1024;

/// Limits of what one server holds.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Sessions at a time.
    pub sessions: usize,
    /// Columns of one session, in whole tiles.
    pub columns_per_session: u64,
    /// Columns of all sessions together, in whole tiles.
    pub columns: u64,
    /// Cells of one session, in whole tiles.
    pub cells_per_session: u64,
    /// Cells of all sessions together, in whole tiles.
    pub cells: u64,
    /// Colliders in one session.
    pub colliders_per_session: usize,
}

impl Limits {
    /// For what was within the limits when it was made.
    pub(crate) const NONE: Limits = Limits {
        sessions: usize::MAX,
        columns_per_session: u64::MAX,
        columns: u64::MAX,
        cells_per_session: u64::MAX,
        cells: u64::MAX,
        colliders_per_session: usize::MAX,
    };

    /// Checks every field of what a session is to be created with.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] names each field that is out of its range.
    pub fn check(&self, spec: &SessionSpec) -> Result<(), SessionError> {
        let mut check = Check::default();
        if let Some(id) = &spec.id {
            check.id("/id", id);
        }
        self.check_grid(&mut check, &spec.grid);
        check_material(&mut check, spec);
        check.settings(&spec.settings(), spec.physics);
        check_alpine(&mut check, spec);
        if spec.initial_snow.len() > MOST_LAYERS {
            let count = spec.initial_snow.len();
            check
                .reject("/initial_snow", format!("{count} layers; at most {MOST_LAYERS} are laid"));
        }
        for (i, layer) in spec.initial_snow.iter().enumerate() {
            let at = |field| format!("/initial_snow/{i}/{field}");
            check.snow_depth(at("depth"), layer.depth, &spec.grid);
            if let Some(celsius) = layer.temperature {
                check.snow_temperature(at("temperature"), celsius, spec.physics);
            }
            if let Some(density) = layer.density {
                check.snow_density(at("density"), density, &spec.material, spec.physics);
            }
        }
        if let Some(terrain) = &spec.terrain {
            Ground::check(&mut check, "/terrain/heights", &terrain.heights, &spec.grid);
        }
        check.finish()
    }

    fn check_grid(&self, check: &mut Check, grid: &Grid) {
        let highest = f64::from(u32::MAX);
        check.range("/grid/width", f64::from(grid.width), 1.0, highest, "columns");
        check.range("/grid/depth", f64::from(grid.depth), 1.0, highest, "columns");
        check.range("/grid/height", f64::from(grid.height), 1.0, 255.0, "cells");
        check.range("/grid/cell_size", grid.cell_size, 0.02, 2.0, "m");
        let sizes = [
            ("columns", grid.padded_columns(), self.columns_per_session),
            ("cells", grid.padded_cells(), self.cells_per_session),
        ];
        for (what, size, most) in sizes.into_iter().filter(|(_, size, most)| size > most) {
            let Grid { width, depth, height, .. } = grid;
            let detail = format!(
                "{width} × {depth} × {height} takes {size} {what} in whole tiles of 8 × 8 columns; \
                 a session may have at most {most}"
            );
            check.reject("/grid", detail);
        }
    }
}

impl Check {
    /// Notes a name that does not match `[A-Za-z0-9_-]{1,64}`.
    pub fn id(&mut self, pointer: impl Into<String>, id: &str) {
        if !is_valid_id(id) {
            self.reject(pointer, "must match [A-Za-z0-9_-]{1,64}");
        }
    }

    /// Notes a temperature of the air that its snow can't be under.
    pub fn air_temperature(&mut self, pointer: &str, celsius: f64, physics: Physics) {
        let (coldest, warmest) = physics.air_temperatures();
        self.range(pointer, celsius, coldest, warmest, "°C");
    }

    /// Notes a temperature of fresh snow that there is not.
    pub fn snow_temperature(&mut self, pointer: impl Into<String>, celsius: f64, physics: Physics) {
        let (coldest, _) = physics.air_temperatures();
        self.range(pointer, celsius, coldest, 0.0, "°C");
    }

    /// Notes what is wrong with a weather or a site that stands at some place.
    pub fn weather(&mut self, at: &str, checked: Result<(), WeatherProblem>) {
        if let Err(problem) = checked {
            self.reject(format!("{at}{}", problem.pointer()), problem.message);
        }
    }

    /// Notes a depth of fresh snow that is too thin to be kept, or absurd.
    pub fn snow_depth(&mut self, pointer: impl Into<String>, depth: f64, grid: &Grid) {
        self.range(pointer, depth, grid.cell_size / 256.0, 1000.0, "m");
    }

    /// Notes a density of fresh snow that the material does not allow; alpine snow may be as dense as ice.
    pub fn snow_density(
        &mut self,
        pointer: impl Into<String>,
        density: f64,
        material: &Material,
        physics: Physics,
    ) {
        self.range(pointer, density, 10.0, densest(material, physics), "kg/m³");
    }

    /// Notes settings outside their ranges.
    pub fn settings(&mut self, settings: &Settings, physics: Physics) {
        self.air_temperature("/air_temperature", settings.air_temperature, physics);
        self.range("/time_scale", settings.time_scale, 0.0, physics.highest_time_scale(), "");
        if physics == Physics::Alpine && settings.pressing == Pressing::Creep {
            let detail = "is 'creep', which alpine snow does by itself; give seconds from 0 to 10";
            self.reject("/pressing", detail);
        }
        self.range("/tick_rate", settings.tick_rate, 1.0, 240.0, "Hz");
        self.range("/snowfall_rate", settings.snowfall_rate, 0.0, 100.0, "m/h");
        if let Pressing::Within(seconds) = settings.pressing {
            self.range("/pressing", seconds, 0.0, Pressing::LONGEST, "s");
        }
        for (pointer, seconds) in [
            ("/idle_timeout_s", settings.idle_timeout_s),
            ("/delete_after_s", settings.delete_after_s),
        ] {
            if let Some(seconds) = seconds {
                self.range(pointer, seconds, 1.0, 1e9, "s");
            }
        }
    }
}

/// How dense snow can be that falls or lies \[kg/m³\].
pub(crate) fn densest(material: &Material, physics: Physics) -> f64 {
    match physics {
        Physics::Thesis => material.max_density,
        Physics::Alpine => f64::from(ICE_DENSITY),
    }
}

/// Notes what only alpine snow may have, or may not.
fn check_alpine(check: &mut Check, spec: &SessionSpec) {
    let SessionSpec { physics, weather_step, site, weather, .. } = spec;
    if *physics == Physics::Thesis {
        for (pointer, given) in [
            ("/weather_step", weather_step.is_some()),
            ("/site", site.is_some()),
            ("/weather", weather.is_some()),
        ] {
            if given {
                check
                    .reject(pointer, "needs \"physics\": \"alpine\"; leave it out, or choose that");
            }
        }
        return;
    }
    if let Some(seconds) = weather_step {
        check.range("/weather_step", *seconds, 60.0, 3600.0, "s");
    }
    let Some(site) = site else { return };
    check.weather("/site", site.check());
    if let Some(weather) = weather {
        check.weather("/weather", weather.check(site));
    }
}

fn check_material(check: &mut Check, spec: &SessionSpec) {
    let m = &spec.material;
    check.range("/material/max_density", m.max_density, 10.0, 917.0, "kg/m³");
    check.range("/material/fresh_density", m.fresh_density, 10.0, m.max_density, "kg/m³");
    check.range("/material/stiffness_exponent", m.stiffness_exponent, 3.0, 6.0, "");
    check.range("/material/grain_size_mm", m.grain_size_mm, 0.05, 10.0, "mm");
    let (heaviest, name) = match spec.physics {
        Physics::Thesis => (m.max_density.max(m.fresh_density), "max_density"),
        Physics::Alpine => (f64::from(WATER_DENSITY), "1000 kg/m³"),
    };
    let mass = f64::from(spec.grid.height) * spec.grid.cell_size * heaviest;
    if mass > MAX_COLUMN_MASS {
        check.reject(
            "/grid/height",
            format!(
                "height · cell_size · {name} is {mass} kg/m²; \
                 a column may hold at most {MAX_COLUMN_MASS} kg/m²"
            ),
        );
    }
}
