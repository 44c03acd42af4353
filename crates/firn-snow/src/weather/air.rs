//! Moist air, and the snow that falls through it.

/// 0 °C \[K\].
pub const KELVIN: f64 = 273.15;

/// Precipitation is snow up to this temperature of the air \[°C\].
pub const SNOW_UP_TO: f64 = 1.2;

/// Gas constant of dry air \[J/(kg K)\].
const GAS: f64 = 287.0;

/// Mass of a molecule of water over the mean of dry air.
const WATER_OVER_AIR: f64 = 0.622;

/// Saturation vapour pressure over ice \[Pa\] at a temperature \[°C\]: 611.213 e^{22.4422 T/(272.186 + T)}.
///
/// Magnus's form with the coefficients of FSM (Essery 2015, Geoscientific Model Development 8, 3867–3876).
pub fn saturation_over_ice(temperature: f64) -> f64 {
    611.213 * (22.4422 * temperature / (272.186 + temperature)).exp()
}

/// Saturation vapour pressure over water \[Pa\] at a temperature \[°C\], supercooled water too:
/// 611.213 e^{17.5043 T/(241.3 + T)}.
///
/// Source as for [`saturation_over_ice`].
pub fn saturation_over_water(temperature: f64) -> f64 {
    611.213 * (17.5043 * temperature / (241.3 + temperature)).exp()
}

/// Vapour pressure \[Pa\] of air of a temperature \[°C\] and a relative humidity over water \[%\].
pub fn vapour_pressure(temperature: f64, relative_humidity: f64) -> f64 {
    relative_humidity / 100.0 * saturation_over_water(temperature)
}

/// Specific humidity q = 0.622 e/p \[kg/kg\] from vapour pressure and air pressure, both \[Pa\]. It takes the
/// air to weigh as much as if it were dry, which is less than 1 % of q up to 20 °C.
pub fn specific_humidity(vapour_pressure: f64, pressure: f64) -> f64 {
    WATER_OVER_AIR * vapour_pressure / pressure
}

/// Density of the air p/(R T) \[kg/m³\] at a pressure \[Pa\] and a temperature \[°C\], as if it were dry.
pub fn air_density(pressure: f64, temperature: f64) -> f64 {
    pressure / (GAS * (temperature + KELVIN))
}

/// Density of new snow max(50, 109 + 6 T_a + 26 √U) \[kg/m³\] that falls through air of a temperature \[°C\] in a wind
/// \[m/s\].
///
/// Pahaut (1976), as Crocus has it (Vionnet et al. 2012).
pub fn new_snow_density(air_temperature: f64, wind_speed: f64) -> f64 {
    (109.0 + 6.0 * air_temperature + 26.0 * wind_speed.max(0.0).sqrt()).max(50.0)
}

/// Parts snow and rain precipitation in air of a temperature \[°C\]; snow first.
pub fn split_precipitation(precipitation: f64, air_temperature: f64) -> (f64, f64) {
    if air_temperature <= SNOW_UP_TO { (precipitation, 0.0) } else { (0.0, precipitation) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f64, expected: f64, within: f64) -> bool {
        (value - expected).abs() <= within
    }

    #[test]
    fn saturation_is_that_of_the_tables() {
        // Smithsonian meteorological tables.
        assert!(near(saturation_over_water(0.0), 611.2, 0.5));
        assert!(near(saturation_over_water(20.0), 2337.0, 5.0));
        assert!(near(saturation_over_water(-20.0), 125.4, 1.0));
        assert!(near(saturation_over_ice(-10.0), 259.9, 0.5));
        assert!(near(saturation_over_ice(-20.0), 103.2, 0.5));
        assert!(near(saturation_over_ice(-40.0), 12.84, 0.1));
        assert_eq!(saturation_over_ice(0.0), saturation_over_water(0.0));
    }

    #[test]
    fn air_has_its_density_and_humidity() {
        assert!(near(air_density(101_325.0, 0.0), 1.2925, 1e-3));
        let vapour = vapour_pressure(20.0, 50.0);
        assert!(near(specific_humidity(vapour, 101_325.0), 0.00717, 5e-5));
    }

    #[test]
    fn new_snow_is_the_denser_the_warmer_and_windier() {
        assert_eq!(new_snow_density(0.0, 0.0), 109.0);
        assert_eq!(new_snow_density(-5.0, 4.0), 131.0);
        assert_eq!(new_snow_density(-40.0, 1.0), 50.0);
    }

    #[test]
    fn precipitation_is_snow_up_to_its_limit() {
        assert_eq!(split_precipitation(3.0, 1.2), (3.0, 0.0));
        assert_eq!(split_precipitation(3.0, 1.21), (0.0, 3.0));
    }
}
