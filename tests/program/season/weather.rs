//! Weather that the tests make, as the program reads it.

use std::fmt::Write;

/// Columns of a forcing.
pub const NAMES: &str = "time,sw_in,lw_in,ta_c,rh,wind,ps_pa,snow_kgm2s,rain_kgm2s";

/// Snowfall of two hours of the first day, a power of 2 so that its sum over an hour is exact \[kg/m²/s\].
pub const SNOWFALL: f64 = 1.0 / 512.0;

/// Weather of an hour: it snows on the first day and melts on the fourth.
pub struct Hour {
    pub time: String,
    pub shortwave: f64,
    pub celsius: f64,
    pub snowfall: f64,
}

pub fn hours(days: u32) -> Vec<Hour> {
    let hour = |index: u32| {
        let (day, hour) = (index / 24, index % 24);
        let light = f64::from(hour.abs_diff(12));
        Hour {
            time: format!("2024-02-{:02}T{hour:02}:00", 27 + day),
            shortwave: if light < 6.0 { 400.0 - 60.0 * light } else { 0.0 },
            celsius: if day < 2 { -6.5 } else { 8.5 },
            snowfall: if day == 0 && (6..8).contains(&hour) { SNOWFALL } else { 0.0 },
        }
    };
    let february = |index: &u32| index / 24 < 3;
    let all = (0..days * 24).map(|index| {
        let mut made = hour(index);
        if !february(&index) {
            made.time = format!("2024-03-{:02}T{:02}:00", index / 24 - 2, index % 24);
        }
        made
    });
    all.collect()
}

pub fn csv(hours: &[Hour]) -> String {
    let mut text = format!("{NAMES}\n");
    for Hour { time, shortwave, celsius, snowfall } in hours {
        let _ = writeln!(text, "{time},{shortwave},280,{celsius},75,2,87000,{snowfall},0");
    }
    text
}

/// The same weather as SMET, with offsets, factors and comments.
pub fn smet(hours: &[Hour], shift: usize) -> String {
    let mut text =
        "SMET 1.1 ASCII\n[HEADER]\nstation_id = TEST # a comment\naltitude = 1500\nnodata = -999\n\
                    fields = timestamp P TA RH VW ISWR ILWR PSUM PSUM_PH TSG\n\
                    units_offset = 0 0 273.15 0 0 0 0 0 0 273.15\n\
                    units_multiplier = 1 100 1 0.01 1 1 1 1 1 1\n[DATA]\n"
            .to_owned();
    let later = self::hours(7);
    for (index, Hour { shortwave, celsius, snowfall, .. }) in hours.iter().enumerate() {
        let (time, sum) = (&later[index + shift].time, snowfall * 3600.0);
        let phase = if sum > 0.0 { "0" } else { "-999" };
        let _ = writeln!(text, "{time}:00 870 {celsius} 75 2 {shortwave}\t280 {sum} {phase} -999");
    }
    text
}
