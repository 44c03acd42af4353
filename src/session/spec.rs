//! What a session is created with.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::error::{Check, SessionError};
use super::view::Settings;
use crate::snow::{Grid, MAX_COLUMN_MASS, MAX_TERRAIN_CELLS, Material};

/// Most layers of initial snow.
const MOST_LAYERS: usize = 1024;

/// Limits of what one server holds.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Sessions at a time.
    pub sessions: usize,
    /// Cells of one session.
    pub cells_per_session: u64,
    /// Cells of all sessions together.
    pub cells: u64,
    /// Colliders in one session.
    pub colliders_per_session: usize,
}

/// Body of `POST /v1/sessions`; every field is optional.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SessionSpec {
    /// Name of the session, `[A-Za-z0-9_-]{1,64}`; the server makes a ULID where there is none.
    pub id: Option<String>,
    /// Size of the grid.
    pub grid: Grid,
    /// Material constants.
    pub material: Material,
    /// Temperature of the air \[°C\], and of fresh snow.
    #[schema(minimum = -40, maximum = 0)]
    pub air_temperature: f64,
    /// Simulated seconds per second.
    #[schema(minimum = 0, maximum = 1000)]
    pub time_scale: f64,
    /// Ticks per second \[Hz\].
    #[schema(minimum = 1, maximum = 240)]
    pub tick_rate: f64,
    /// Whether time stands still.
    pub paused: bool,
    /// Continuous snowfall \[m/h\].
    #[schema(minimum = 0, maximum = 100)]
    pub snowfall_rate: f64,
    /// Seconds without request or stream after which the session may hibernate; this version
    /// keeps it awake.
    #[schema(minimum = 1, maximum = 1e9)]
    pub idle_timeout_s: Option<f64>,
    /// Seconds without request or stream after which the session is deleted.
    #[schema(minimum = 1, maximum = 1e9)]
    pub delete_after_s: Option<f64>,
    /// Layers of snow to begin with, from the ground up.
    pub initial_snow: Vec<SnowLayer>,
    /// Elevation of the ground; `null` is level ground.
    pub terrain: Option<Terrain>,
}

/// One layer of the snow a session begins with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SnowLayer {
    /// Depth \[m\].
    #[schema(exclusive_minimum = 0)]
    pub depth: f64,
    /// Temperature \[°C\]; the air's where there is none.
    #[schema(minimum = -40, maximum = 0)]
    pub temperature: Option<f64>,
    /// Density \[kg/m³\]; the material's `fresh_density` where there is none.
    #[schema(minimum = 10, maximum = 917)]
    pub density: Option<f64>,
}

/// Elevation of the ground under each column.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Terrain {
    /// Elevations \[m\], row by row: index = z · width + x.
    pub heights: Vec<f64>,
}

impl Limits {
    /// For what was within the limits when it was made.
    pub(super) const NONE: Limits = Limits {
        sessions: usize::MAX,
        cells_per_session: u64::MAX,
        cells: u64::MAX,
        colliders_per_session: usize::MAX,
    };
}

impl Default for SessionSpec {
    fn default() -> Self {
        SessionSpec {
            id: None,
            grid: Grid::default(),
            material: Material::default(),
            air_temperature: -3.0,
            time_scale: 1.0,
            tick_rate: 60.0,
            paused: false,
            snowfall_rate: 0.0,
            idle_timeout_s: None,
            delete_after_s: None,
            initial_snow: Vec::new(),
            terrain: None,
        }
    }
}

/// Whether a client may use a name for a session or a collider.
pub fn is_valid_id(id: &str) -> bool {
    (1..=64).contains(&id.len())
        && id.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-')
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

impl SessionSpec {
    /// The settings it asks for.
    pub fn settings(&self) -> Settings {
        Settings {
            air_temperature: self.air_temperature,
            time_scale: self.time_scale,
            tick_rate: self.tick_rate,
            paused: self.paused,
            snowfall_rate: self.snowfall_rate,
            idle_timeout_s: self.idle_timeout_s,
            delete_after_s: self.delete_after_s,
        }
    }

    /// Lowest and highest elevation of the ground \[m\].
    pub fn ground_range(&self) -> (f64, f64) {
        let Some(terrain) = &self.terrain else { return (0.0, 0.0) };
        let start = (f64::INFINITY, f64::NEG_INFINITY);
        terrain.heights.iter().fold(start, |(low, high), &h| (low.min(h), high.max(h)))
    }

    /// Checks every field.
    ///
    /// # Errors
    /// [`SessionError::Invalid`] names each field that is out of its range.
    pub fn check(&self, limits: &Limits) -> Result<(), SessionError> {
        let mut check = Check::default();
        if let Some(id) = &self.id {
            check.id("/id", id);
        }
        self.check_grid(&mut check, limits);
        self.check_material(&mut check);
        check.settings(&self.settings());
        if self.initial_snow.len() > MOST_LAYERS {
            let count = self.initial_snow.len();
            check
                .reject("/initial_snow", format!("{count} layers; at most {MOST_LAYERS} are laid"));
        }
        for (i, layer) in self.initial_snow.iter().enumerate() {
            let at = |field| format!("/initial_snow/{i}/{field}");
            check.snow_depth(at("depth"), layer.depth, &self.grid);
            if let Some(celsius) = layer.temperature {
                check.temperature(at("temperature"), celsius);
            }
            if let Some(density) = layer.density {
                check.snow_density(at("density"), density, &self.material);
            }
        }
        self.check_terrain(&mut check);
        check.finish()
    }

    fn check_grid(&self, check: &mut Check, limits: &Limits) {
        let grid = &self.grid;
        let highest = f64::from(u32::MAX);
        check.range("/grid/width", f64::from(grid.width), 1.0, highest, "columns");
        check.range("/grid/depth", f64::from(grid.depth), 1.0, highest, "columns");
        check.range("/grid/height", f64::from(grid.height), 1.0, 255.0, "cells");
        check.range("/grid/cell_size", grid.cell_size, 0.02, 2.0, "m");
        let cells = grid.columns().saturating_mul(u64::from(grid.height));
        if cells > limits.cells_per_session {
            check.reject(
                "/grid",
                format!(
                    "{} × {} × {} makes {cells} cells; a session may have at most {}",
                    grid.width, grid.depth, grid.height, limits.cells_per_session
                ),
            );
        }
    }

    fn check_material(&self, check: &mut Check) {
        let m = &self.material;
        check.range("/material/max_density", m.max_density, 10.0, 917.0, "kg/m³");
        check.range("/material/fresh_density", m.fresh_density, 10.0, m.max_density, "kg/m³");
        check.range("/material/stiffness_exponent", m.stiffness_exponent, 3.0, 6.0, "");
        check.range("/material/grain_size_mm", m.grain_size_mm, 0.05, 10.0, "mm");
        let heaviest = m.max_density.max(m.fresh_density);
        let mass = f64::from(self.grid.height) * self.grid.cell_size * heaviest;
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

    fn check_terrain(&self, check: &mut Check) {
        let Some(terrain) = &self.terrain else { return };
        if terrain.heights.len() as u64 != self.grid.columns() {
            check.reject(
                "/terrain/heights",
                format!(
                    "{} elevations for {} × {} columns",
                    terrain.heights.len(),
                    self.grid.width,
                    self.grid.depth
                ),
            );
            return;
        }
        let (lowest, highest) = self.ground_range();
        let range = MAX_TERRAIN_CELLS * self.grid.cell_size;
        if highest - lowest > range {
            check.reject(
                "/terrain/heights",
                format!(
                    "elevations range over {} m; at most {range} m are allowed",
                    highest - lowest
                ),
            );
        }
    }
}
