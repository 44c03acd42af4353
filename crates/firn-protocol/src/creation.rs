//! What a session is created with.

use std::sync::Arc;

use firn_snow::weather::{Site, Weather, WeatherInput};
use firn_snow::{Grid, HardnessLaw, LoadDistribution, Material, Preset, Pressing};
use serde::{Deserialize, Serialize};

use crate::physics::Physics;
use crate::session::{Settings, given};

/// What a session is created with, in full. `POST /v1/sessions` takes a [`SessionBody`], in which every field is
/// optional; reading one fills in the rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "SessionBody")]
pub struct SessionSpec {
    /// Name of the session, `[A-Za-z0-9_-]{1,64}`; the server makes a ULID where there is none.
    pub id: Option<String>,
    /// Which physics the snow follows.
    #[serde(skip_serializing_if = "Physics::is_thesis")]
    pub physics: Physics,
    /// Size of the grid.
    pub grid: Grid,
    /// Material constants.
    pub material: Material,
    /// Temperature of the air \[°C\] from −40 to 0, and of fresh snow. In alpine snow it is that of the weather, −60 to
    /// 50.
    pub air_temperature: f64,
    /// Simulated seconds per second, from 0 to 1000, in alpine snow to 100 000.
    pub time_scale: f64,
    /// Ticks per second \[Hz\], from 1 to 240.
    pub tick_rate: f64,
    /// Whether time stands still.
    pub paused: bool,
    /// Continuous snowfall \[m/h\], from 0 to 100.
    pub snowfall_rate: f64,
    /// How snow gives way under objects.
    pub pressing: Pressing,
    /// Seconds without request or stream after which the session hibernates.
    pub idle_timeout_s: Option<f64>,
    /// Seconds without request or stream after which the session is deleted.
    pub delete_after_s: Option<f64>,
    /// Layers of snow to begin with, from the ground up.
    pub initial_snow: Vec<SnowLayer>,
    /// Elevation of the ground; `None` is level ground.
    pub terrain: Option<Terrain>,
    /// Length of a weather step \[s\], in alpine snow only: there it is always some.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weather_step: Option<f64>,
    /// Where and when alpine snow is; some in alpine snow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub site: Option<Arc<Site>>,
    /// The weather that alpine snow begins in; some in alpine snow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weather: Option<Arc<WeatherInput>>,
}

/// Body of `POST /v1/sessions`; every field is optional.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[cfg_attr(feature = "schema", derive(Serialize, utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(as = SessionSpec))]
#[serde(default, deny_unknown_fields)]
pub struct SessionBody {
    /// Kind of snow: fills what `material`, `air_temperature` and `pressing` leave out.
    pub preset: Preset,
    /// Name of the session, `[A-Za-z0-9_-]{1,64}`; the server makes a ULID where there is none.
    pub id: Option<String>,
    /// Which physics the snow follows, for as long as the session lives.
    pub physics: Physics,
    /// Size of the grid.
    pub grid: Grid,
    /// Material constants.
    pub material: MaterialSpec,
    /// Temperature of the air \[°C\], and of fresh snow; the preset's where there is none. From −40 to 0; with the
    /// physics `alpine` from −60 to 50, and where `weather` is given that of the weather.
    #[cfg_attr(feature = "schema", schema(value_type = f64, required = false, minimum = -60, maximum = 50))]
    #[serde(deserialize_with = "given")]
    pub air_temperature: Option<f64>,
    /// Simulated seconds per second: up to 1000, with the physics `alpine` up to 100 000.
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 100_000))]
    pub time_scale: f64,
    /// Ticks per second \[Hz\].
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 240))]
    pub tick_rate: f64,
    /// Whether time stands still.
    pub paused: bool,
    /// Continuous snowfall \[m/h\].
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 100))]
    pub snowfall_rate: f64,
    /// How snow gives way under objects; by default the preset's way.
    #[cfg_attr(feature = "schema", schema(value_type = Pressing, required = false))]
    #[serde(deserialize_with = "given")]
    pub pressing: Option<Pressing>,
    /// Seconds without request or stream after which the session hibernates.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 1e9))]
    pub idle_timeout_s: Option<f64>,
    /// Seconds without request or stream after which the session is deleted.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 1e9))]
    pub delete_after_s: Option<f64>,
    /// Layers of snow to begin with, from the ground up.
    pub initial_snow: Vec<SnowLayer>,
    /// Elevation of the ground; `null` is level ground.
    pub terrain: Option<Terrain>,
    /// Length of a weather step \[s\]; with the physics `alpine` only.
    #[cfg_attr(feature = "schema", schema(value_type = f64, required = false, minimum = 60, maximum = 3600, default = 900))]
    #[serde(deserialize_with = "given", skip_serializing_if = "Option::is_none")]
    pub weather_step: Option<f64>,
    /// Where and when the snowpack is, and how its weather is measured; with the physics `alpine` only.
    #[cfg_attr(feature = "schema", schema(value_type = Site, required = false))]
    #[serde(deserialize_with = "given", skip_serializing_if = "Option::is_none")]
    pub site: Option<Arc<Site>>,
    /// The weather; with the physics `alpine` only. Where there is none it is steady: the air's temperature, 80 % of
    /// humidity, wind of 2 m/s, and no short wave where the site does not tell where the sun stands.
    #[cfg_attr(feature = "schema", schema(value_type = WeatherInput, required = false))]
    #[serde(deserialize_with = "given", skip_serializing_if = "Option::is_none")]
    pub weather: Option<Arc<WeatherInput>>,
}

/// Material constants of a snowpack to be made; those of its preset where there are none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[cfg_attr(feature = "schema", derive(Serialize, utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct MaterialSpec {
    /// Density of fresh snow \[kg/m³\], up to `max_density`.
    #[cfg_attr(feature = "schema", schema(value_type = f64, required = false, minimum = 10))]
    #[serde(deserialize_with = "given")]
    pub fresh_density: Option<f64>,
    /// Density at which snow compacts no further \[kg/m³\].
    #[cfg_attr(feature = "schema", schema(value_type = f64, required = false, maximum = 917))]
    #[serde(deserialize_with = "given")]
    pub max_density: Option<f64>,
    /// Exponent n of the stiffness law k = ρⁿ.
    #[cfg_attr(feature = "schema", schema(value_type = f64, required = false, minimum = 3, maximum = 6))]
    #[serde(deserialize_with = "given")]
    pub stiffness_exponent: Option<f64>,
    /// The hardness law.
    #[cfg_attr(feature = "schema", schema(value_type = HardnessLaw, required = false))]
    #[serde(deserialize_with = "given")]
    pub hardness_law: Option<HardnessLaw>,
    /// Grain size δ \[mm\], read by the law `gold` only.
    #[cfg_attr(feature = "schema", schema(value_type = f64, required = false, minimum = 0.05, maximum = 10))]
    #[serde(deserialize_with = "given")]
    pub grain_size_mm: Option<f64>,
    /// How loads spread with depth.
    #[cfg_attr(feature = "schema", schema(value_type = LoadDistribution, required = false))]
    #[serde(deserialize_with = "given")]
    pub load_distribution: Option<LoadDistribution>,
}

/// One layer of the snow a session begins with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct SnowLayer {
    /// Depth \[m\].
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
    pub depth: f64,
    /// Temperature \[°C\]; the air's where there is none.
    #[cfg_attr(feature = "schema", schema(minimum = -40, maximum = 0))]
    pub temperature: Option<f64>,
    /// Density \[kg/m³\]; the material's `fresh_density` where there is none.
    #[cfg_attr(feature = "schema", schema(minimum = 10, maximum = 917))]
    pub density: Option<f64>,
}

/// Elevation of the ground under each column.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Terrain {
    /// Elevations \[m\] within ±20 000, row by row: index = z · width + x.
    #[cfg_attr(feature = "schema", schema(value_type = Vec<f64>))]
    pub heights: Arc<[f64]>,
}

impl SnowLayer {
    /// A depth \[m\] of fresh snow as the session's material and air make it.
    pub fn new(depth: f64) -> SnowLayer {
        SnowLayer { depth, temperature: None, density: None }
    }
}

impl Default for SessionSpec {
    fn default() -> Self {
        SessionBody::default().into()
    }
}

impl From<Preset> for SessionSpec {
    fn from(preset: Preset) -> Self {
        SessionBody { preset, ..SessionBody::default() }.into()
    }
}

impl Default for SessionBody {
    fn default() -> Self {
        SessionBody {
            preset: Preset::default(),
            id: None,
            physics: Physics::default(),
            grid: Grid::default(),
            material: MaterialSpec::default(),
            air_temperature: None,
            time_scale: 1.0,
            tick_rate: 60.0,
            paused: false,
            snowfall_rate: 0.0,
            pressing: None,
            idle_timeout_s: None,
            delete_after_s: None,
            initial_snow: Vec::new(),
            terrain: None,
            weather_step: None,
            site: None,
            weather: None,
        }
    }
}

impl From<SessionBody> for SessionSpec {
    fn from(body: SessionBody) -> Self {
        let (physics, preset) = (body.physics, body.preset);
        let material = preset.material();
        let hardness_law = physics.hardness_law(material.hardness_law);
        let mut spec = SessionSpec {
            id: body.id,
            physics,
            grid: body.grid,
            material: body.material.or(Material { hardness_law, ..material }),
            air_temperature: body.air_temperature.unwrap_or(preset.air_temperature()),
            time_scale: body.time_scale,
            tick_rate: body.tick_rate,
            paused: body.paused,
            snowfall_rate: body.snowfall_rate,
            pressing: body.pressing.unwrap_or(physics.pressing(preset.pressing())),
            idle_timeout_s: body.idle_timeout_s,
            delete_after_s: body.delete_after_s,
            initial_snow: body.initial_snow,
            terrain: body.terrain,
            weather_step: body.weather_step,
            site: body.site,
            weather: body.weather,
        };
        spec.complete_weather();
        spec
    }
}

impl MaterialSpec {
    /// The constants that are given, and others for those that are not.
    fn or(self, other: Material) -> Material {
        Material {
            fresh_density: self.fresh_density.unwrap_or(other.fresh_density),
            max_density: self.max_density.unwrap_or(other.max_density),
            stiffness_exponent: self.stiffness_exponent.unwrap_or(other.stiffness_exponent),
            hardness_law: self.hardness_law.unwrap_or(other.hardness_law),
            grain_size_mm: self.grain_size_mm.unwrap_or(other.grain_size_mm),
            load_distribution: self.load_distribution.unwrap_or(other.load_distribution),
        }
    }
}

impl SessionSpec {
    /// Fills in what alpine snow needs and nobody has said.
    fn complete_weather(&mut self) {
        if self.physics.is_thesis() {
            return;
        }
        self.weather_step.get_or_insert(Physics::WEATHER_STEP);
        let site = self.site.get_or_insert_default();
        // What can't be is refused once: as that which was given, not as what is made of it here.
        let (coldest, warmest) = self.physics.air_temperatures();
        match &self.weather {
            Some(weather) => {
                let air_temperature = weather.at(0.0).air_temperature;
                self.air_temperature = air_temperature.clamp(coldest, warmest);
            }
            None => {
                let dark = site.sun(0.0).is_none().then_some(0.0);
                let air_temperature = self.air_temperature.clamp(coldest, warmest);
                let weather = Weather { air_temperature, shortwave: dark, ..Weather::default() };
                self.weather = Some(Arc::new(weather.into()));
            }
        }
    }

    /// The settings it asks for.
    pub fn settings(&self) -> Settings {
        Settings {
            air_temperature: self.air_temperature,
            time_scale: self.time_scale,
            tick_rate: self.tick_rate,
            paused: self.paused,
            snowfall_rate: self.snowfall_rate,
            pressing: self.pressing,
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
}
