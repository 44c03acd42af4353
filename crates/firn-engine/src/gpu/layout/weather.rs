//! Rows for steps of weather.

use bytemuck::{Pod, Zeroable};
use firn_snow::Exchanged;
use firn_snow::alpine::{self, Surface};

use super::join;

/// `WeatherStep.flags`: heights of the instruments are above ground rather than above the snow.
pub const ABOVE_GROUND: u32 = 1;
/// `WeatherStep.flags`: snow falls, whether any of it is due or not.
pub const SNOWS: u32 = 2;
/// `ShadeJob.flags`: the grid is swept along x rather than z.
pub const ALONG_X: u32 = 1;
/// `ShadeJob.flags`: it is swept from its far end.
pub const SWEEPS_BACK: u32 = 2;

/// Rows behind the cells of a tile of alpine snow that hold what its columns have beside them.
pub const SURFACE_ROWS: u32 = 2;

/// The weather in one step, as [`alpine::WeatherStep`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct WeatherStep {
    /// Length of the step \[s\].
    pub seconds: f32,
    /// Temperature of the air \[°C\].
    pub air: f32,
    /// Its specific humidity.
    pub humidity: f32,
    /// Its density \[kg/m³\].
    pub air_density: f32,
    /// Its pressure \[Pa\].
    pub pressure: f32,
    /// Speed of the wind \[m/s\].
    pub wind: f32,
    /// Short wave on level ground \[W/m²\].
    pub shortwave: f32,
    /// Long wave from the sky \[W/m²\].
    pub longwave: f32,
    /// Albedo that cold snow and wet snow tend to.
    pub aged: [f32; 2],
    /// How much of the way there is left after the step.
    pub young: [f32; 2],
    /// Height at which temperature is measured \[m\].
    pub temperature_height: f32,
    /// Height at which wind is measured \[m\].
    pub wind_height: f32,
    /// Whether heights are above ground, and whether snow falls: `ABOVE_GROUND` and `SNOWS`.
    pub flags: u32,
    /// Mass quanta of the snow that is due.
    pub snow: u32,
    /// Its thickness in quanta.
    pub snow_thickness: u32,
    /// Its temperature \[°C\].
    pub snow_temperature: f32,
    /// Mass quanta of rain.
    pub rain: u32,
    /// Nothing.
    pub padding: u32,
}

/// Steps of weather of one snowpack, on some of its tiles that follow each other.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct WeatherJob {
    /// Workgroups of this job and of those before it.
    pub end: u32,
    /// End of its tiles.
    pub end_tile: u32,
    /// First of its steps.
    pub first_step: u32,
    /// How many.
    pub steps: u32,
    /// Its row in the table of exchanges.
    pub exchange: u32,
    /// First of its tiles with sheltered columns.
    pub first_shelter: u32,
    /// How many.
    pub shelters: u32,
    /// Where the parts of the short wave on its columns begin; `NONE` where all have the same.
    pub first_shine: u32,
    /// Temperature of the skin that a column begins with \[°C\].
    pub skin: f32,
    /// Those of the soil, from the top down \[°C\].
    pub soil_0: f32,
    /// The second layer.
    pub soil_1: f32,
    /// The third layer.
    pub soil_2: f32,
    /// The lowest layer.
    pub soil_3: f32,
    /// Nothing.
    pub padding: u32,
}

/// A tile with columns on which no snow falls because of objects.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Shelter {
    /// The tile.
    pub tile: u32,
    /// The columns, bit by bit, low word.
    pub low: u32,
    /// High word.
    pub high: u32,
    /// Nothing.
    pub padding: u32,
}

/// What a snowpack exchanges with the weather.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ExchangeResult {
    /// Mass quanta refused, deposited, sublimated and run off: low and high words.
    pub sums: [u32; 8],
}

/// Where light falls on a snowpack in a step.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ShadeJob {
    /// Workgroups that sweep for this job and those before it.
    pub sweep_end: u32,
    /// Workgroups that shade for them.
    pub shade_end: u32,
    /// Its row.
    pub session: u32,
    /// Where the parts of the short wave on its columns begin.
    pub first_shine: u32,
    /// [`ALONG_X`] and [`SWEEPS_BACK`].
    pub flags: u32,
    /// Sideways shift of the lines in a column, times 2¹⁶.
    pub shift: i32,
    /// The first line.
    pub first_line: i32,
    /// Cells by which shadow sinks in a column.
    pub sinks: f32,
    /// Direction to the sun.
    pub east: f32,
    /// Upwards.
    pub up: f32,
    /// Northwards.
    pub north: f32,
    /// Part of the light that comes from all over the sky.
    pub diffuse: f32,
    /// Whole cells of the lowest ground.
    pub lowest_cells: i32,
    /// Quanta above them.
    pub lowest_fraction: u32,
}

/// A column of alpine snow, summed up, and what it has beside its cells, as it is stored.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ColumnTotals {
    /// Mass quanta in all cells.
    pub mass: u32,
    /// Those of liquid water.
    pub water: u32,
    /// Words of the surface.
    pub surface: [u32; 8],
}

impl ColumnTotals {
    /// What the host makes of it, `beginning` being what a column has before its first step.
    pub fn told(&self, beginning: Surface) -> firn_snow::ColumnTotals {
        let surface = surface_of(self.surface).unwrap_or(beginning);
        firn_snow::ColumnTotals { mass: self.mass, water: self.water, surface }
    }
}

/// What a column has beside its cells, by its words; nothing where it has not begun.
pub fn surface_of(words: [u32; 8]) -> Option<Surface> {
    let [albedo, skin, soil_0, soil_1, soil_2, soil_3] =
        std::array::from_fn(|i| f32::from_bits(words[i]));
    let runoff = join(words[6], words[7]);
    let soil = [soil_0, soil_1, soil_2, soil_3];
    (albedo != 0.0).then_some(Surface { albedo, skin, soil, runoff })
}

/// The words of what a column has beside its cells: four of each of the rows behind its cells.
pub fn words_of(surface: &Surface) -> [u32; 8] {
    let Surface { albedo, skin, soil, runoff } = *surface;
    let [soil_0, soil_1, soil_2, soil_3] = soil.map(f32::to_bits);
    let [low, high] = [runoff as u32, (runoff >> 32) as u32];
    [albedo.to_bits(), skin.to_bits(), soil_0, soil_1, soil_2, soil_3, low, high]
}

impl From<&alpine::WeatherStep> for WeatherStep {
    fn from(step: &alpine::WeatherStep) -> Self {
        let flag = |set: bool, flag: u32| if set { flag } else { 0 };
        WeatherStep {
            seconds: step.seconds,
            air: step.air,
            humidity: step.humidity,
            air_density: step.air_density,
            pressure: step.pressure,
            wind: step.wind,
            shortwave: step.shortwave,
            longwave: step.longwave,
            aged: step.aged,
            young: step.young,
            temperature_height: step.temperature_height,
            wind_height: step.wind_height,
            flags: flag(step.above_ground, ABOVE_GROUND) | flag(step.snows, SNOWS),
            snow: step.snow,
            snow_thickness: step.snow_thickness,
            snow_temperature: step.snow_temperature,
            rain: step.rain,
            padding: 0,
        }
    }
}

impl From<&ExchangeResult> for Exchanged {
    fn from(row: &ExchangeResult) -> Self {
        let [refused, deposited, sublimated, runoff] =
            std::array::from_fn(|i| join(row.sums[2 * i], row.sums[2 * i + 1]));
        Exchanged { refused, deposited, sublimated, runoff }
    }
}
