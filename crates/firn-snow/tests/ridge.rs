//! A ridge in the sun of April: its south side melts out days before its north side.

use firn_snow::alpine::{Gathering, Surface, WeatherStep};
use firn_snow::weather::{Site, Start, Weather};
use firn_snow::{CELL, Grid, HardnessLaw, MASS_QUANTA, Material, Snowpack};

const STEP: f64 = 900.0;
const STEPS_A_DAY: usize = 96;
const DAYS: usize = 60;
const GRID: Grid = Grid { width: 9, depth: 41, height: 40, cell_size: 0.5 };

/// Days until the snow on some rows of columns is gone, 0.4 m at first, on ground of a height \[m\].
fn melt_out(ground: impl Fn(u32) -> f64, rows: [u32; 2]) -> [usize; 2] {
    let material = Material { hardness_law: HardnessLaw::Alpine, ..Material::default() };
    let ground: Vec<f64> =
        (0..GRID.depth).flat_map(|z| (0..GRID.width).map(move |_| z)).map(ground).collect();
    let snowpack = Snowpack::new(GRID, material, &ground, false).unwrap();
    let mut snowpack = snowpack.with_surfaces(Surface::new([1.0, 2.0, 3.0, 4.0], 0.0));
    let depth = (0.4 / GRID.cell_size * f64::from(CELL)) as u32;
    snowpack.deposit(GRID.all(), depth, (0.4 * 300.0 * MASS_QUANTA) as u32, -1.0);
    let site = Site {
        latitude: Some(45.0),
        longitude: Some(7.0),
        start: Start::parse("2026-04-01T00:00:00Z"),
        pressure: 850.0,
        ..Site::default()
    };
    let mut gathering = Gathering::default();
    let mut days = [DAYS; 2];
    for day in 0..DAYS {
        for step in 0..STEPS_A_DAY {
            let time = (day * STEPS_A_DAY + step) as f64 * STEP;
            let warmth = ((time / 3600.0 - 14.0) / 12.0 * std::f64::consts::PI).cos();
            let air_temperature = 2.0 + 5.0 * warmth;
            let weather = Weather { air_temperature, cloud_cover: Some(0.2), ..Weather::default() };
            let felt = weather.felt(&site, time);
            let due = gathering.fall(&felt, STEP, &GRID);
            let step = WeatherStep::new(&felt, &site, STEP, due);
            if step.shades {
                snowpack.shade(&step);
            }
            snowpack.weather(0..GRID.tiles_z(), &[step]);
        }
        for (days, row) in days.iter_mut().zip(rows) {
            if *days == DAYS && snowpack.column(4, row).height() == 0 {
                *days = day;
            }
        }
    }
    days
}

#[test]
fn the_south_side_melts_out_days_before_the_north_side() {
    // North is towards larger z: rows before the crest face south. The slopes are of 27°.
    let ridge = |z: u32| 10.0 - 0.25 * (f64::from(z) - 20.0).abs();
    let [south, north] = melt_out(ridge, [10, 30]);
    assert!(north < DAYS, "all of it melts");
    assert!(south + 4 <= north, "south {south} days, north {north}");
    let [one, other] = melt_out(|_| 3.0, [10, 30]);
    assert_eq!(one, other, "level ground has no sides");
    assert!((south..=north).contains(&one), "{south} {one} {north}");
}
