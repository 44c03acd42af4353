//! Snow that falls or is cleared, and the air above it.

use firn_protocol::{AirTemperature, Clearing, Region, Settings, Snowfall};
use firn_snow::{ColumnRect, Grid, MASS_QUANTA};

use crate::core::session::{Check, Command, Decision, Kept, SessionError, SessionState, Told};

impl SessionState {
    pub(crate) fn decide_snowfall(&self, snowfall: &Snowfall) -> Result<Decision, SessionError> {
        let grid = &self.grid;
        let mut check = Check::default();
        check.snow_depth("/depth", snowfall.depth, grid);
        let density = snowfall.density.unwrap_or(self.material.fresh_density);
        check.snow_density("/density", density, &self.material);
        let celsius = snowfall.temperature.unwrap_or(self.settings.air_temperature);
        check.temperature("/temperature", celsius);
        let columns = columns_in(snowfall.region.as_ref(), grid, &mut check);
        check.finish()?;
        let (depth, mass) = self.quanta(snowfall.depth, density);
        let command = Command::Deposit { columns, depth, mass, celsius: celsius as f32 };
        let in_all = |mass: u64| u128::from(mass) * u128::from(columns.columns());
        let refused = in_all(Kept::of(depth, mass, grid).refused);
        let told = Told::Snowfall { fallen: in_all(mass), refused, columns };
        Ok(Decision { command, told })
    }

    /// Depth and mass of snow of a depth \[m\] and a density \[kg/m³\], in quanta of one column.
    pub fn quanta(&self, depth: f64, density: f64) -> (u64, u64) {
        let mass = (depth * density * MASS_QUANTA).round() as u64;
        (self.grid.thickness_quanta(depth), mass)
    }

    pub(crate) fn decide_clearing(&self, clearing: &Clearing) -> Result<Decision, SessionError> {
        let grid = &self.grid;
        let mut check = Check::default();
        let highest = f64::from(grid.height) * grid.cell_size;
        check.range("/depth", clearing.depth, 0.0, highest, "m");
        let columns = columns_in(clearing.region.as_ref(), grid, &mut check);
        check.finish()?;
        let depth = grid.thickness_quanta(clearing.depth) as u32;
        Ok(Decision {
            command: Command::Clear { columns, depth },
            told: Told::Clearing { columns },
        })
    }

    pub(crate) fn decide_air_temperature(
        &self,
        air: &AirTemperature,
    ) -> Result<Decision, SessionError> {
        let mut check = Check::default();
        check.temperature("/celsius", air.celsius);
        check.finish()?;
        let settings = Settings { air_temperature: air.celsius, ..self.settings };
        let stiffness_exponent = self.material.stiffness_exponent;
        let command = Command::Settings { settings, stiffness_exponent };
        Ok(Decision { command, told: Told::AirTemperature })
    }
}

/// Columns of a region, clipped to the grid; every column where there is none.
fn columns_in(region: Option<&Region>, grid: &Grid, check: &mut Check) -> ColumnRect {
    let Some(region) = region else { return grid.all() };
    let columns = |low: f64, extent: f64, cells: u32| {
        let first = |edge: f64| (edge / grid.cell_size - 0.5).ceil().clamp(0.0, f64::from(cells));
        (first(low) as u32, first(low + extent) as u32)
    };
    let (x0, x1) = columns(region.x, region.width, grid.width);
    let (z0, z1) = columns(region.z, region.depth, grid.depth);
    for (field, extent) in [("width", region.width), ("depth", region.depth)] {
        if extent <= 0.0 {
            check.reject(format!("/region/{field}"), format!("{extent} is not above 0 m"));
        }
    }
    if x0 >= x1 || z0 >= z1 {
        check.reject("/region", "holds no centre of a column of the grid");
    }
    ColumnRect { x0, z0, x1: x1.max(x0), z1: z1.max(z0) }
}
