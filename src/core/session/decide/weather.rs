//! Snow that falls or is cleared, and the air above it.

use std::sync::Arc;

use firn_protocol::{AirTemperature, Clearing, Region, Settings, Snowfall, Weather, WeatherInput};
use firn_snow::{ColumnRect, Grid, MASS_QUANTA, columns_along, rows_along};

use crate::core::session::{
    Check, Command, Decision, Invalid, Kept, SessionError, SessionState, Told,
};

/// Most points of a path.
const LONGEST_PATH: usize = 4096;

/// Rows of columns that the legs of a path may cross together.
const MOST_ROWS: u64 = 1 << 22;

/// Rectangles of columns that a path may take.
const MOST_RECTANGLES: usize = 1 << 16;

impl SessionState {
    pub(crate) fn decide_snowfall(&self, snowfall: &Snowfall) -> Result<Decision, SessionError> {
        let grid = &self.grid;
        let mut check = Check::default();
        check.snow_depth("/depth", snowfall.depth, grid);
        let (density, celsius) = self.new_snow();
        let density = snowfall.density.unwrap_or(density);
        check.snow_density("/density", density, &self.material, self.physics());
        let celsius = snowfall.temperature.unwrap_or(celsius);
        check.snow_temperature("/temperature", celsius, self.physics());
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
        let depth = grid.thickness_quanta(clearing.depth) as u32;
        if let Some(path) = &clearing.path {
            return decide_path(clearing, path, depth, grid, check);
        }
        if clearing.width.is_some() {
            check.reject("/width", "is there without a path");
        }
        let columns = columns_in(clearing.region.as_ref(), grid, &mut check);
        check.finish()?;
        let command = Command::Clear { columns, depth, spares: true };
        Ok(Decision { command, told: Told::Clearing { columns, edits: 1 } })
    }

    pub(crate) fn decide_air_temperature(
        &self,
        air: &AirTemperature,
    ) -> Result<Decision, SessionError> {
        let mut check = Check::default();
        check.air_temperature("/celsius", air.celsius, self.physics());
        check.finish()?;
        let settings = Settings { air_temperature: air.celsius, ..self.settings };
        let stiffness_exponent = self.material.stiffness_exponent;
        let weather = self.weather_with(air.celsius);
        let command = Command::Settings { settings, stiffness_exponent, weather };
        Ok(Decision { command, told: Told::AirTemperature })
    }

    pub(crate) fn decide_weather(
        &self,
        weather: &Arc<WeatherInput>,
    ) -> Result<Decision, SessionError> {
        let Some(alpine) = &self.alpine else {
            return Err(SessionError::feels_no_weather());
        };
        let mut check = Check::default();
        check.weather("", weather.check(&alpine.site));
        check.finish()?;
        Ok(Decision { command: Command::Weather(weather.clone()), told: Told::Weather })
    }

    /// Steady weather, as it is now but for the temperature of the air \[°C\]; none where the snow feels none.
    pub(crate) fn weather_with(&self, celsius: f64) -> Option<Arc<WeatherInput>> {
        let now = self.alpine.as_ref()?.weather.at(self.clock.sim_time());
        let weather = Weather { air_temperature: celsius, ..now };
        Some(Arc::new(weather.into()))
    }
}

fn decide_path(
    clearing: &Clearing,
    path: &[[f64; 2]],
    depth: u32,
    grid: &Grid,
    mut check: Check,
) -> Result<Decision, SessionError> {
    if clearing.region.is_some() {
        check.reject("/region", "is there beside a path; a clearing has one or the other");
    }
    if !(2..=LONGEST_PATH).contains(&path.len()) {
        let detail = format!("{} points; a path has 2 to {LONGEST_PATH}", path.len());
        check.reject("/path", detail);
    }
    for (i, point) in path.iter().take(LONGEST_PATH).enumerate() {
        for (axis, along) in point.iter().enumerate() {
            check.range(format!("/path/{i}/{axis}"), *along, -1e6, 1e6, "m");
        }
    }
    match clearing.width {
        Some(width) => check.range("/width", width, 1e-3, 1000.0, "m"),
        None => check.reject("/width", "is missing; a path has a width"),
    }
    check.finish()?;
    let width = clearing.width.unwrap_or_default();
    let refuse = |detail| Err(SessionError::Invalid(vec![Invalid::new("/path", detail)]));
    let rows = rows_along(grid, path, width);
    if rows > MOST_ROWS {
        return refuse(format!("its legs cross {rows} rows of columns; {MOST_ROWS} are allowed"));
    }
    let rects = columns_along(grid, path, width);
    if rects.len() > MOST_RECTANGLES {
        let count = rects.len();
        return refuse(format!(
            "it takes {count} rectangles of columns; {MOST_RECTANGLES} are allowed"
        ));
    }
    let Some(columns) = rects.iter().copied().reduce(|all, rect| all.hull(&rect)) else {
        return refuse("holds no column of the grid".to_owned());
    };
    let command = Command::ClearPath { path: path.to_vec(), width, depth };
    Ok(Decision { command, told: Told::Clearing { columns, edits: rects.len() } })
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
