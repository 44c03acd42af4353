//! Radiation from the sky: worked out where it is not given, and how much of it comes straight from the sun.

use super::air::{KELVIN, vapour_pressure};
use super::sun::SunPosition;

/// Stefan and Boltzmann's constant \[W/(m² K⁴)\].
pub const STEFAN_BOLTZMANN: f64 = 5.67e-8;

/// Elevation of the sun \[°\] below which all short wave counts as diffuse.
pub const LOWEST_DIRECT: f64 = 1.0;

/// Short wave on a level surface under a clear sky \[W/m²\]: 1098 s e^{−0.057/s}, where s is the sine of the sun's
/// elevation; 0 by night.
///
/// Haurwitz (1945), Journal of Meteorology 2, 154–166.
pub fn clear_sky(sun: SunPosition) -> f64 {
    let height = sun.height();
    if height > 0.0 { 1098.0 * height * (-0.057 / height).exp() } else { 0.0 }
}

/// Short wave on a level surface \[W/m²\] where a part of the sky, 0 to 1, is covered: 1 − 0.75 N^3.4 of what comes
/// from a clear sky.
///
/// Kasten and Czeplak (1980), Solar Energy 24, 177–189.
pub fn shortwave(sun: SunPosition, cloud_cover: f64) -> f64 {
    clear_sky(sun) * (1.0 - 0.75 * cloud_cover.powf(3.4))
}

/// Emissivity of a clear sky over air of a temperature \[°C\] and a relative humidity over water \[%\]:
/// 1.24 (e/T)^{1/7}, with e in hPa and T in K; 1 at the most.
///
/// Brutsaert (1975), Water Resources Research 11, 742–744.
pub fn clear_sky_emissivity(air_temperature: f64, relative_humidity: f64) -> f64 {
    let vapour = vapour_pressure(air_temperature, relative_humidity) / 100.0;
    (1.24 * (vapour / (air_temperature + KELVIN)).powf(1.0 / 7.0)).min(1.0)
}

/// Long wave from the sky \[W/m²\] over air of a temperature \[°C\] and a relative humidity over water \[%\], where a
/// part of the sky, 0 to 1, is covered: (1 − 0.84 N) ε + 0.84 N of a black body's, ε as under a clear sky.
///
/// Unsworth and Monteith (1975), Quarterly Journal of the Royal Meteorological Society 101, 13–24. At Col de
/// Porte 2005/06 the sky is measured to be a black body while it snows or rains (emissivity 1.00). This gives 0.96; a
/// factor on ε, such as 1 + 0.22 N^2.75 (Maykut and Church 1973), gave 0.88.
pub fn longwave(air_temperature: f64, relative_humidity: f64, cloud_cover: f64) -> f64 {
    let clear = clear_sky_emissivity(air_temperature, relative_humidity);
    let emissivity = ((1.0 - 0.84 * cloud_cover) * clear + 0.84 * cloud_cover).min(1.0);
    emissivity * STEFAN_BOLTZMANN * (air_temperature + KELVIN).powi(4)
}

/// Diffuse part of short wave, 0 to 1, by the clearness index: short wave on a level surface over that above the air.
///
/// Erbs, Klein and Duffie (1982), Solar Energy 28, 293–302.
pub fn diffuse_fraction(clearness: f64) -> f64 {
    let k = clearness.max(0.0);
    if k <= 0.22 {
        1.0 - 0.09 * k
    } else if k <= 0.8 {
        0.9511 + k * (-0.1604 + k * (4.388 + k * (-16.638 + k * 12.336)))
    } else {
        0.165
    }
}

/// Diffuse part, 0 to 1, of a short wave on a level surface \[W/m²\] with the sun where it is; `irradiance` \[W/m²\] is
/// the sun's above the air on a surface that faces it. All is diffuse where the sun is below [`LOWEST_DIRECT`].
pub fn diffuse_part(shortwave: f64, sun: SunPosition, irradiance: f64) -> f64 {
    if sun.elevation < LOWEST_DIRECT {
        return 1.0;
    }
    diffuse_fraction(shortwave / (irradiance * sun.height()))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn sun(elevation: f64) -> SunPosition {
        SunPosition { azimuth: 180.0, elevation }
    }

    #[test]
    fn clear_skies_shine_as_haurwitz_found() {
        assert!((clear_sky(sun(90.0)) - 1037.2).abs() < 0.1);
        assert!((clear_sky(sun(30.0)) - 489.8).abs() < 0.1);
        assert_eq!((clear_sky(sun(0.0)), clear_sky(sun(-10.0))), (0.0, 0.0));
    }

    #[test]
    fn clouds_take_three_quarters() {
        assert_eq!(shortwave(sun(40.0), 0.0), clear_sky(sun(40.0)));
        assert!((shortwave(sun(40.0), 1.0) / clear_sky(sun(40.0)) - 0.25).abs() < 1e-12);
    }

    #[test]
    fn skies_emit_the_more_the_wetter_and_cloudier() {
        // 20 °C and 10 hPa: 1.24 (10/293.15)^(1/7).
        let humidity = 100.0 * 1000.0 / super::super::saturation_over_water(20.0);
        assert!((clear_sky_emissivity(20.0, humidity) - 0.7654).abs() < 1e-3);
        assert_eq!(clear_sky_emissivity(-20.0, 0.0), 0.0);
        let black = STEFAN_BOLTZMANN * 273.15_f64.powi(4);
        let (clear, overcast) = (longwave(0.0, 80.0, 0.0), longwave(0.0, 80.0, 1.0));
        assert!((0.68..0.72).contains(&(clear / black)), "{clear}");
        assert!((0.94..0.96).contains(&(overcast / black)), "{overcast}");
    }

    #[test]
    fn the_diffuse_part_has_no_steps() {
        assert_eq!(diffuse_fraction(0.0), 1.0);
        for (at, value) in [(0.22, 0.980), (0.5, 0.659), (0.8, 0.165)] {
            let (below, above) = (diffuse_fraction(at - 1e-9), diffuse_fraction(at + 1e-9));
            assert!(
                (below - value).abs() < 3e-3 && (above - value).abs() < 3e-3,
                "{below} {above}"
            );
        }
        assert_eq!(diffuse_part(800.0, sun(0.99), 1361.0), 1.0);
        assert!(diffuse_part(600.0, sun(40.0), 1361.0) < 0.4);
        assert_eq!(diffuse_part(0.0, sun(40.0), 1361.0), 1.0, "nothing shines");
    }

    proptest! {
        #[test]
        fn parts_stay_parts(
            elevation in -90.0..=90.0,
            shortwave_given in 0.0..=2000.0,
            temperature in -60.0..=50.0_f64,
            humidity in 0.0..=100.0,
            cloud in 0.0..=1.0,
        ) {
            let part = diffuse_part(shortwave_given, sun(elevation), 1361.0);
            prop_assert!((0.0..=1.0).contains(&part), "{part}");
            let short = shortwave(sun(elevation), cloud);
            prop_assert!(short >= 0.0 && short <= 1361.0 * sun(elevation).height());
            let black = STEFAN_BOLTZMANN * (temperature + KELVIN).powi(4);
            let long = longwave(temperature, humidity, cloud);
            prop_assert!((0.0..=black).contains(&long), "{long}");
            prop_assert!(long <= longwave(temperature, humidity, 1.0) + 1e-9);
        }
    }
}
