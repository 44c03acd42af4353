//! Random weather of a winter, for alpine snow.

use firn_snow::Grid;
use firn_snow::alpine::{Gathering, WeatherStep};
use firn_snow::weather::{Felt, Site, SunPosition};

use crate::support::Dice;

/// Length of a step of weather [s].
pub const STEP: f64 = 900.0;

/// Winter by the day, with storms, sun, rain and thaw.
pub struct Winter {
    dice: Dice,
    grid: Grid,
    gathering: Gathering,
    step: u64,
    storm: f64,
    /// The sun's place is told.
    sun: bool,
    /// Mass that has come down on a column, in quanta.
    pub fallen: u64,
}

impl Winter {
    pub fn new(seed: u64, grid: Grid, sun: bool) -> Winter {
        let (dice, gathering) = (Dice::new(seed), Gathering::default());
        Winter { dice, grid, gathering, step: 0, storm: 0.0, sun, fallen: 0 }
    }

    fn felt(&mut self) -> Felt {
        let hour = self.step as f64 * STEP / 3600.0;
        let day = hour / 24.0;
        if self.dice.below(120) == 0 {
            self.storm = self.dice.range(5.0, 40.0);
        }
        self.storm = (self.storm - STEP / 3600.0).max(0.0);
        let height = ((hour - 6.0) / 12.0 * std::f64::consts::PI).sin();
        let air = -6.0 + 0.3 * day + 5.0 * height + self.dice.range(-1.0, 1.0);
        let rate = if self.storm > 0.0 { self.dice.range(0.0, 4.0) / 3600.0 } else { 0.0 };
        let (snowfall, rainfall) = if air <= 1.2 { (rate, 0.0) } else { (0.0, rate) };
        let elevation = 40.0 * height;
        let azimuth = (15.0 * hour).rem_euclid(360.0);
        let clear = if self.storm > 0.0 { 0.2 } else { 1.0 };
        Felt {
            air_temperature: air,
            relative_humidity: self.dice.range(50.0, 100.0),
            wind_speed: self.dice.range(0.0, 6.0),
            pressure: 870.0,
            snowfall,
            rainfall,
            shortwave: 700.0 * height.max(0.0) * clear,
            longwave: 210.0 + 60.0 * (1.0 - clear) + 2.0 * air,
            diffuse: if elevation < 1.0 { 1.0 } else { 0.3 },
            sun: self.sun.then_some(SunPosition { azimuth, elevation }),
            derived: Default::default(),
        }
    }

    fn next(&mut self) -> WeatherStep {
        let felt = self.felt();
        self.step += 1;
        let due = self.gathering.fall(&felt, STEP, &self.grid);
        self.fallen += u64::from(due.mass) + u64::from(due.rain);
        WeatherStep::new(&felt, &Site::default(), STEP, due)
    }

    pub fn steps(&mut self, count: usize) -> Vec<WeatherStep> {
        (0..count).map(|_| self.next()).collect()
    }
}
