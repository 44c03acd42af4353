//! What a session of alpine snow has beside others: its weather, and the steps of it that were taken.

use std::sync::Arc;

use firn_engine::frame::Weathering;
use firn_protocol::{
    Physics, SessionSpec, Site, Stamp, Weather, WeatherInput, WeatherNow, WeatherView,
};
use firn_snow::alpine::{Due, Gathering, Surface, WeatherStep};
use firn_snow::weather::new_snow_density;
use firn_snow::{Grid, Pressing};

use crate::core::session::{Clock, Kept, Orders, SessionState};

/// Relative slack with which the end of a step counts as reached.
const SLACK: f64 = 1e-12;

/// Length of a cycle under which objects are pressed in \[s\].
const CYCLE: f64 = 0.25;

/// Cycles of a tick in which nothing is left to do for an object that stands, beyond those that it is pressed in.
const CYCLES_AFTER: u32 = 8;

/// Cycles of a tick in which objects move.
const CYCLES_OF_MOTION: u32 = 4000;

/// Most steps of weather that are taken in one frame, but for those of one tick.
const MOST_STEPS: u64 = 1024;

/// The weather of a session of alpine snow, and how far the snow has come in it.
///
/// Step k is taken in the first tick whose simulated time reaches its end, before the cycles of that tick. It is made
/// of the weather that was told last then, as it is at the step's beginning.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Alpine {
    pub weather: Arc<WeatherInput>,
    pub site: Arc<Site>,
    /// Length of a step \[s\].
    pub step: f64,
    /// Steps taken.
    pub steps: u64,
    /// Snow that has fallen and is still too thin for a cell.
    pub gathering: Gathering,
}

impl Alpine {
    /// As a session begins; none where its snow is not alpine.
    pub fn new(spec: &SessionSpec) -> Option<Alpine> {
        if spec.physics == Physics::Thesis {
            return None;
        }
        Some(Alpine {
            weather: spec.weather.clone()?,
            site: spec.site.clone()?,
            step: spec.weather_step?,
            steps: 0,
            gathering: Gathering::default(),
        })
    }

    /// What each column begins with beside its cells.
    pub fn surface(&self) -> Surface {
        let soil = self.site.soil.map(|celsius| celsius as f32);
        Surface::new(soil, self.weather.at(0.0).air_temperature as f32)
    }

    /// Density \[kg/m³\] and temperature \[°C\] of snow that falls in some weather.
    pub fn new_snow(weather: &Weather) -> (f64, f64) {
        let density = new_snow_density(weather.air_temperature, weather.wind_speed);
        (density, weather.air_temperature.min(0.0))
    }

    /// The weather at the beginning of the step under way.
    pub fn weather_of_step(&self) -> Weather {
        self.weather.at(self.steps as f64 * self.step)
    }

    /// Simulated time at which so many steps have ended \[s\].
    fn end_of(&self, steps: u64) -> f64 {
        steps as f64 * self.step * (1.0 - SLACK)
    }

    /// Steps that have ended at a time \[s\].
    fn ended(&self, time: f64) -> u64 {
        let mut steps = (time / self.step) as u64;
        // The quotient is rounded; the product decides.
        if self.end_of(steps) > time {
            steps -= 1;
        } else if self.end_of(steps + 1) <= time {
            steps += 1;
        }
        steps
    }

    /// Ticks of a clock until so many more steps have ended, at least one; none where time stands still.
    fn ticks_until(&self, steps: u64, clock: &Clock) -> Option<u64> {
        clock.ticks_until(self.end_of(self.steps + steps))
    }

    /// What holds at a simulated time \[s\].
    pub fn now(&self, sim_time: f64) -> WeatherNow {
        let weather = self.weather.at(sim_time);
        let felt = weather.felt(&self.site, sim_time);
        let (snowfall, rainfall) = weather.snow_and_rain();
        WeatherNow {
            air_temperature: felt.air_temperature,
            relative_humidity: felt.relative_humidity,
            wind_speed: felt.wind_speed,
            wind_direction: weather.wind_direction,
            pressure: felt.pressure,
            snowfall,
            rainfall,
            shortwave: felt.shortwave,
            longwave: felt.longwave,
            cloud_cover: weather.cloudiness(),
            sun: felt.sun,
        }
    }

    /// The weather at a simulated time \[s\], as clients read it.
    pub fn view(&self, stamp: Stamp, sim_time: f64) -> WeatherView {
        let (told, now) = (self.weather.at(sim_time), self.now(sim_time));
        let derived = [
            ("shortwave", told.shortwave.is_none()),
            ("longwave", told.longwave.is_none()),
            ("sun", told.sun.is_none() && now.sun.is_some()),
            ("pressure", told.pressure.is_none()),
            ("cloud_cover", told.cloud_cover.is_none()),
        ];
        let derived = derived.into_iter().filter(|(_, is_derived)| *is_derived);
        let derived = derived.map(|(field, _)| field.to_owned()).collect();
        let weather = self.weather.clone();
        WeatherView { stamp, sim_time, steps: self.steps, now, derived, weather }
    }

    /// Whether it is not impossible at a clock's time.
    pub fn is_sound(&self, clock: &Clock) -> bool {
        const MOST: u64 = 1 << 50;
        let Gathering { mass, thickness, celsius } = self.gathering;
        self.steps == self.ended(clock.sim_time())
            && mass < MOST
            && thickness < MOST
            && (-60.0..=0.0).contains(&celsius)
    }

    /// Lets it snow and rain for a step. Returns the step, what comes down, and the mass that falls, in quanta.
    fn fall(&mut self, grid: &Grid) -> (WeatherStep, Due, u64) {
        let felt = self.weather.felt(&self.site, self.steps as f64 * self.step);
        let before = self.gathering.mass;
        let due = self.gathering.fall(&felt, self.step, grid);
        let fallen = self.gathering.mass + u64::from(due.mass) - before;
        self.steps += 1;
        (WeatherStep::new(&felt, &self.site, self.step, due), due, fallen)
    }
}

impl SessionState {
    /// The physics of its snow.
    pub fn physics(&self) -> Physics {
        if self.alpine.is_some() { Physics::Alpine } else { Physics::Thesis }
    }

    /// Mass of all snow in the air that is too thin for a cell, in quanta.
    pub fn gathered(&self) -> u128 {
        let gathered = self.alpine.as_ref().map_or(0, |alpine| alpine.gathering.mass);
        u128::from(gathered) * u128::from(self.grid.columns())
    }

    /// Whether no cycle can change anything, as there is nothing that presses the snow and nothing that moves: alpine
    /// snow settles with the weather.
    pub fn lies_alone(&self) -> bool {
        self.alpine.is_some()
            && !self.is_restless()
            && self.colliders.values().all(|collider| collider.body.airborne)
    }

    /// Most cycles of a tick.
    pub fn most_cycles_of_tick(&self) -> u32 {
        if self.alpine.is_none() {
            return u32::MAX;
        }
        let pressing = match self.settings.pressing {
            Pressing::Within(seconds) => seconds,
            Pressing::Creep => 0.0,
        };
        let standing = (pressing / CYCLE).ceil() as u32 + CYCLES_AFTER;
        if self.moves() { CYCLES_OF_MOTION } else { standing }
    }

    /// Ticks until a step of weather is taken; none where time stands still, or where there is no weather.
    pub fn ticks_until_weather(&self) -> Option<u64> {
        self.alpine.as_ref()?.ticks_until(1, &self.clock)
    }

    /// Ticks that pass by themselves before a step of weather is taken, where nothing else happens.
    pub fn ticks_without_weather(&self) -> u64 {
        self.ticks_until_weather().map_or(u64::MAX, |ticks| ticks - 1)
    }

    /// Ticks that can be taken at once for the weather's sake: a tick with weather has to be the first, unless no cycle
    /// can change anything. Then they are as many as there is room for, each step taking so many units.
    pub fn ticks_of_weather(&self, units: u64, unit: u64, alone: bool) -> u64 {
        let Some(alpine) = &self.alpine else { return u64::MAX };
        let Some(next) = self.ticks_until_weather() else { return u64::MAX };
        let until = |steps| alpine.ticks_until(steps, &self.clock).unwrap_or(u64::MAX);
        if alone && self.settings.snowfall_rate == 0.0 {
            let steps = (units / unit.max(1)).clamp(1, MOST_STEPS);
            return (until(steps + 1) - 1).max(next);
        }
        // With objects that move, how many cycles a tick has is seen at its beginning.
        if self.moves() {
            return 1;
        }
        let mut after = self.clock;
        after.pass(1);
        match alpine.ended(after.sim_time()).saturating_sub(alpine.steps) {
            0 => next - 1,
            steps => until(steps + 1) - 1,
        }
    }

    /// Steps of weather that end in an advance which is about to be taken.
    pub fn steps_until(&self, clock: &Clock) -> u64 {
        let ended = |alpine: &Alpine| alpine.ended(clock.sim_time()).saturating_sub(alpine.steps);
        self.alpine.as_ref().map_or(0, ended)
    }

    /// Takes the steps of weather that have ended by the present tick, as edits of some orders. `tick` is the one before
    /// the first of their ticks. Returns how many they are.
    pub fn take_weather(&mut self, tick: u64, orders: &mut Orders) -> u64 {
        let count = self.steps_until(&self.clock);
        if count == 0 {
            return 0;
        }
        if self.settings.snowfall_rate > 0.0 {
            self.falling.mark(tick, self.snowing());
        }
        let Some(mut alpine) = self.alpine.take() else { return 0 };
        let (all, columns) = (self.grid.all(), u128::from(self.grid.columns()));
        let mut steps = Vec::with_capacity(count as usize);
        for _ in 0..count {
            let (step, due, fallen) = alpine.fall(&self.grid);
            self.ledger.fallen += u128::from(fallen) * columns;
            self.ledger.weather.rained += u128::from(due.rain) * columns;
            if due.mass > 0 {
                let kept = Kept { depth: due.thickness, mass: due.mass, refused: 0 };
                self.shelter(&all, &kept, due.celsius, orders);
            }
            steps.push(step);
        }
        self.alpine = Some(alpine);
        orders.edits.extend(Weathering::edits(&self.grid, &steps));
        count
    }

    /// Tiles that may be awake after a step of weather: those under objects.
    pub fn tiles_under_objects(&self) -> u64 {
        self.colliders.values().map(|collider| collider.reach.tiles).sum()
    }
}
