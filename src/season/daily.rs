//! What the model says of a day.

use std::fmt::Write;

use time::Date;

/// What the model says of a day: means over all columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Day {
    /// The day.
    pub date: Date,
    /// Full hours of it that the forcing has: 24 but for the first and the last day.
    pub hours: u32,
    /// Depth of snow \[m\], mean of the full hours.
    pub depth: f64,
    /// Snow water equivalent \[kg/m²\], with snow too thin for a cell, mean of the full hours.
    pub water: f64,
    /// Liquid water in the snow \[kg/m²\], mean of the full hours.
    pub liquid: f64,
    /// Temperature of the skin \[°C\], mean of all steps.
    pub skin: f64,
    /// Albedo that is seen, mean of the full hours.
    pub albedo: f64,
    /// Water that has run off \[kg/m²\].
    pub runoff: f64,
    /// Cells of a column, mean of the full hours.
    pub cells: f64,
}

impl Day {
    /// Whether the forcing has all of it.
    pub fn is_whole(&self) -> bool {
        self.hours == 24
    }
}

/// Days as comma-separated values, of five digits each.
pub(super) fn csv(days: &[Day]) -> String {
    let mut csv =
        "date,depth_m,swe_kgm2,lwc_kgm2,tsurf_c,albedo_eff,runoff_kgm2d,cells\n".to_owned();
    for day in days {
        let values =
            [day.depth, day.water, day.liquid, day.skin, day.albedo, day.runoff, day.cells];
        // Writing to a string can't fail.
        let _ = write!(csv, "{}", day.date);
        for value in values {
            let _ = write!(csv, ",{}", five_digits(value));
        }
        csv.push('\n');
    }
    csv
}

/// A number, rounded to five digits; the shortest way to write it.
fn five_digits(value: f64) -> f64 {
    if value == 0.0 {
        return 0.0;
    }
    // Small numbers get no more than ten places.
    let places = (4 - value.abs().log10().floor() as i32).clamp(0, 10);
    let scale = 10f64.powi(places);
    (value * scale).round() / scale + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_five_digits() {
        let written = |value| five_digits(value).to_string();
        assert_eq!(written(0.002_886_94), "0.0028869");
        assert_eq!(written(20.782_4), "20.782");
        assert_eq!(written(-9.993_91), "-9.9939");
        assert_eq!(written(271.116_4), "271.12");
        assert_eq!(written(5.0), "5");
        assert_eq!(written(-1e-13), "0");
        assert_eq!(written(0.0), "0");
    }
}
