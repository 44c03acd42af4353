//! What a session may be created with.

use firn_protocol::{SessionSpec, Settings, is_valid_id};
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
        check.settings(&spec.settings());
        if spec.initial_snow.len() > MOST_LAYERS {
            let count = spec.initial_snow.len();
            check
                .reject("/initial_snow", format!("{count} layers; at most {MOST_LAYERS} are laid"));
        }
        for (i, layer) in spec.initial_snow.iter().enumerate() {
            let at = |field| format!("/initial_snow/{i}/{field}");
            check.snow_depth(at("depth"), layer.depth, &spec.grid);
            if let Some(celsius) = layer.temperature {
                check.temperature(at("temperature"), celsius);
            }
            if let Some(density) = layer.density {
                check.snow_density(at("density"), density, &spec.material);
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

    /// Notes an air or snow temperature outside the range of the hardness laws.
    pub fn temperature(&mut self, pointer: impl Into<String>, celsius: f64) {
        self.range(pointer, celsius, -40.0, 0.0, "°C");
    }

    /// Notes a depth of fresh snow that is too thin to be kept, or absurd.
    pub fn snow_depth(&mut self, pointer: impl Into<String>, depth: f64, grid: &Grid) {
        self.range(pointer, depth, grid.cell_size / 256.0, 1000.0, "m");
    }

    /// Notes a density of fresh snow that the material does not allow.
    pub fn snow_density(&mut self, pointer: impl Into<String>, density: f64, material: &Material) {
        self.range(pointer, density, 10.0, material.max_density, "kg/m³");
    }

    /// Notes settings outside their ranges.
    pub fn settings(&mut self, settings: &Settings) {
        self.temperature("/air_temperature", settings.air_temperature);
        self.range("/time_scale", settings.time_scale, 0.0, 1000.0, "");
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

fn check_material(check: &mut Check, spec: &SessionSpec) {
    let m = &spec.material;
    check.range("/material/max_density", m.max_density, 10.0, 917.0, "kg/m³");
    check.range("/material/fresh_density", m.fresh_density, 10.0, m.max_density, "kg/m³");
    check.range("/material/stiffness_exponent", m.stiffness_exponent, 3.0, 6.0, "");
    check.range("/material/grain_size_mm", m.grain_size_mm, 0.05, 10.0, "mm");
    let heaviest = m.max_density.max(m.fresh_density);
    let mass = f64::from(spec.grid.height) * spec.grid.cell_size * heaviest;
    if mass > MAX_COLUMN_MASS {
        check.reject(
            "/grid/height",
            format!(
                "height · cell_size · max_density is {mass} kg/m²; \
                 a column may hold at most {MAX_COLUMN_MASS} kg/m²"
            ),
        );
    }
}
