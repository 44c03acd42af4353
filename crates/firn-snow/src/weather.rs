//! Weather: moist air, the sun, and radiation from the sky.

mod air;
mod radiation;
mod start;
mod sun;

pub use air::{
    KELVIN, SNOW_UP_TO, air_density, new_snow_density, saturation_over_ice, saturation_over_water,
    specific_humidity, split_precipitation, vapour_pressure,
};
pub use radiation::{
    LOWEST_DIRECT, STEFAN_BOLTZMANN, clear_sky, clear_sky_emissivity, diffuse_fraction,
    diffuse_part, longwave, shortwave,
};
pub use start::Start;
pub use sun::{SOLAR_CONSTANT, SunPosition, solar_irradiance, sun_position};
