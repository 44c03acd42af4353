//! Steps are the same steps however they are taken.

use super::energy::winter;
use super::*;
use crate::weather::SunPosition;
use crate::{HardnessLaw, Material, Snowpack};

const GRID: Grid = Grid { width: 1, depth: 1, height: 100, cell_size: 0.05 };

fn trial() -> Trial {
    Trial::new(GRID, 900.0, [1.0, 2.0, 3.0, 4.0], -3.0)
}

#[test]
fn a_column_needs_nothing_of_another_and_nothing_but_what_is_kept() {
    let hours = winter(60, 7);
    let mut whole = trial();
    hours.iter().for_each(|felt| _ = whole.step(felt));
    assert!(!whole.column.cells.is_empty());
    // In turn with another column, in the same room to work in.
    let (mut one, mut other) = (trial(), Trial::new(GRID, 900.0, [-2.0; 4], 9.0));
    for (felt, unlike) in hours.iter().zip(winter(60, 8)) {
        one.step(felt);
        std::mem::swap(&mut one.scratch, &mut other.scratch);
        other.step(&unlike);
        std::mem::swap(&mut one.scratch, &mut other.scratch);
    }
    assert_eq!((&one.column, &one.surface), (&whole.column, &whole.surface));
    // Given up and taken up again at any time.
    for each in [1, 37, 400] {
        let mut parted = trial();
        for hours in hours.chunks(each) {
            let Trial { gathering, column, surface, .. } = parted;
            parted = Trial { gathering, column, surface, ..trial() };
            hours.iter().for_each(|felt| _ = parted.step(felt));
        }
        assert_eq!((&parted.column, &parted.surface), (&whole.column, &whole.surface));
    }
}

#[test]
fn level_open_ground_has_the_sun_of_a_single_column() {
    let grid = Grid { width: 11, depth: 9, ..GRID };
    let material = Material { hardness_law: HardnessLaw::Alpine, ..Material::default() };
    let mut single = trial();
    let field = Snowpack::new(grid, material, &[], false).unwrap();
    let mut field = field.with_surfaces(single.surface);
    let mut gathering = Gathering::default();
    for (hour, felt) in winter(60, 3).iter().take(600).enumerate() {
        let sun = SunPosition { azimuth: 15.0 * hour as f64 % 360.0, elevation: 33.0 };
        let sunny = Felt { sun: Some(sun), diffuse: 0.2, ..*felt };
        let due = gathering.fall(&sunny, single.seconds, &grid);
        let step = WeatherStep::new(&sunny, &single.site, single.seconds, due);
        if step.shades {
            field.shade(&step);
        }
        field.weather(0..grid.tiles_z(), &[step]);
        // No sun is told of: nothing falls aslant.
        single.step(felt);
    }
    assert!(single.absorbed > 0.0 && !single.column.cells.is_empty());
    for (x, z) in [(0, 0), (10, 0), (5, 4), (0, 8), (10, 8)] {
        assert_eq!(field.column(x, z), &single.column);
    }
    let totals = field.column_totals(grid.all());
    assert!(totals.iter().all(|totals| totals.surface == single.surface));
}

#[test]
fn a_part_of_the_short_wave_is_as_much_less_of_it() {
    let felt = |shortwave| Felt { shortwave, ..felt(-5.0) };
    let site = Site::default();
    let step = |shortwave, shine| {
        let mut trial = trial();
        trial.column.deposit_alpine(100, 50 << 18, 4 * CELL, -5.0);
        let weather = WeatherStep::new(&felt(shortwave), &site, 900.0, Due::default());
        let Trial { mut column, mut surface, mut scratch, .. } = trial;
        let stepped = column.weather(&mut surface, &weather, &GRID, shine, false, &mut scratch);
        (column, surface, stepped)
    };
    assert_eq!(step(400.0, 0.5), step(200.0, 1.0));
    assert_ne!(step(400.0, 1.0), step(200.0, 1.0));
}
