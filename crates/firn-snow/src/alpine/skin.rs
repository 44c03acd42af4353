//! The balance of energy at the skin, which decides its temperature and what melts.

use super::conduction::Eliminated;
use super::turbulence::{FREEZING, Turbulence};
use super::weather_step::WeatherStep;
use super::{FUSION, VAPORISATION};

/// Part of the long wave that is taken in and sent out.
const EMISSIVITY: f32 = 0.99;

/// Stefan and Boltzmann's constant \[W/(m² K⁴)\].
const STEFAN_BOLTZMANN: f32 = 5.67e-8;

/// Specific heat of air \[J/(kg K)\].
const AIR_HEAT: f32 = 1005.0;

/// Most turns of Newton's method.
const MOST_TURNS: u32 = 4;

/// What the skin is in a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Skin<'a> {
    pub weather: &'a WeatherStep,
    /// Whether snow lies.
    pub snow: bool,
    pub turbulence: Turbulence,
    /// Short wave taken in \[W/m²\].
    pub shortwave: f32,
    /// Conductance to the middle of the topmost element \[W/(m² K)\].
    pub conductance: f32,
    /// The topmost element.
    pub top: Eliminated,
}

/// What the balance comes to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Balance {
    /// Temperature of the skin \[°C\].
    pub skin: f32,
    /// Energy that melts \[W/m²\].
    pub melt: f32,
    /// Vapour that leaves, negative where it comes \[kg/(m² s)\].
    pub vapour: f32,
}

/// The balance at one temperature: what is left over, its fall with temperature, and vapour.
struct Trial {
    rest: f32,
    slope: f32,
    vapour: f32,
}

impl Skin<'_> {
    /// Solves the balance, from the temperature of the skin before.
    pub fn solve(&self, before: f32) -> Balance {
        let mut skin = if self.snow { before.min(0.0) } else { before };
        let mut thawed = skin == 0.0 && self.snow;
        for _ in 0..MOST_TURNS {
            let trial = self.at(skin);
            if thawed {
                if trial.rest >= 0.0 {
                    return Balance { skin, melt: trial.rest, vapour: trial.vapour };
                }
                (skin, thawed) = (-0.01, false);
                continue;
            }
            let step = (trial.rest / trial.slope).clamp(-10.0, 10.0);
            skin += step;
            thawed = self.snow && skin > 0.0;
            if thawed {
                skin = 0.0;
            } else if step.abs() < 0.005 {
                break;
            }
        }
        let last = self.at(skin);
        if thawed && last.rest < 0.0 {
            skin = -0.01;
            return Balance { skin, melt: 0.0, vapour: self.at(skin).vapour };
        }
        let melt = if thawed { last.rest } else { 0.0 };
        Balance { skin, melt, vapour: last.vapour }
    }

    /// Heat that is conducted from the skin down, at a temperature of it \[W/m²\].
    pub fn conducted(&self, skin: f32) -> f32 {
        self.conductance * ((1.0 - self.top.bound) * skin - self.top.free)
    }

    /// The balance at a temperature of the skin \[°C\].
    fn at(&self, skin: f32) -> Trial {
        let weather = self.weather;
        let kelvin = skin + FREEZING;
        let exchange =
            weather.air_density * weather.wind * self.turbulence.exchange(weather.air - skin);
        let (humidity, rise) = self.saturation(skin);
        let mut vapour = exchange * (humidity - weather.humidity);
        let mut rise = exchange * rise;
        if !self.snow {
            // Ground gives off less than water does. What settles on it warms it, and is nobody's.
            let wet = if vapour > 0.0 { 0.3 } else { 1.0 };
            (vapour, rise) = (vapour * wet, rise * wet);
        }
        let latent = if self.snow && skin < 0.0 { VAPORISATION + FUSION } else { VAPORISATION };
        let sent = STEFAN_BOLTZMANN * kelvin * kelvin * kelvin;
        let rest = self.shortwave + EMISSIVITY * (weather.longwave - sent * kelvin)
            - exchange * AIR_HEAT * (skin - weather.air)
            - latent * vapour
            - self.conducted(skin);
        let slope = 4.0 * EMISSIVITY * sent
            + exchange * AIR_HEAT
            + latent * rise
            + self.conductance * (1.0 - self.top.bound);
        Trial { rest, slope, vapour }
    }

    /// Specific humidity of saturated air at the skin, and its rise with temperature \[1/K\].
    fn saturation(&self, skin: f32) -> (f32, f32) {
        let (a, b) = if skin < 0.0 { (22.4422, 272.186) } else { (17.5043, 241.3) };
        let humidity = 0.622 * 611.213 * (a * skin / (b + skin)).exp() / self.weather.pressure;
        (humidity, humidity * a * b / ((b + skin) * (b + skin)))
    }
}
