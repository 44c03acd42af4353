//! What can be measured, and what is to be reached on one data-centre GPU.

use clap::ValueEnum;
use serde::Serialize;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Case {
    /// One 50³ session with 5.8 m of snow, every tile active: `compact` on the device
    Session,
    /// The same in the thesis's layout: its five kernels on the device
    SessionThesis,
    /// The same session in the running world: a whole frame, from planning to published
    SessionFrame,
    /// The same while another session is asked for its mass all the time: the host's processor does
    /// not fall asleep between frames
    SessionFrameAwake,
    /// 512²×50 full of snow, active: one tick of `compact`
    Field,
    /// The same in the thesis's layout
    FieldThesis,
    /// The same, many ticks in one dispatch
    FieldMany,
    /// 2048²×50 full of snow, active: one tick of `compact`
    World,
    /// 10 000 sessions of 50³ with 5.8 m, all active at 20 Hz: frames that publish nothing
    Crowd,
    /// The same: frames that publish every session, at 5 Hz
    CrowdPublished,
    /// The same 10 000 sessions at rest: frames
    CrowdRest,
    /// 2048²×50 at rest with one moving vehicle on four wheels: frames
    Vehicle,
    /// The same beside a session that is asked for its mass all the time
    VehicleAwake,
    /// 2048²×50 with 1 m of snow at rest, on which 1 m falls in an hour: the average of 169 frames, in which
    /// every column gets what is deposited at once
    Snowfall,
    /// 1000²×16 with fresh snow of 6.5 cells, over which 200 objects move by themselves at 10 m/s: frames at 60 Hz
    Objects,
    /// 1000²×16 with fresh snow of 6.5 cells, into which 4096 feet are pressed by one request: from the request to
    /// the answer
    Stamps,
    /// 50³ of alpine snow that fills every slot: a step of weather
    WeatherSession,
    /// 2048²×50 of the same: a step of weather
    Weather,
    /// 10 000 sessions of 50³ with 5.8 m of it: a step of weather of all of them, in a frame
    WeatherCrowd,
    /// A session of 50³ of alpine snow through 270 days of weather in steps of 900 s
    Season,
    /// 2048²×50 of alpine snow through a day of that
    SeasonColumns,
    /// Creating a 50³ session and reading its first heights
    Create,
}

/// What a case is to reach.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Target {
    /// What is compared.
    pub quantity: Quantity,
    /// Its bound: an upper one for times, a lower one for everything else.
    pub bound: f64,
    /// What was reached.
    pub reached: f64,
    /// Whether that is enough.
    pub met: bool,
}

/// What a target is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Median time \[s\].
    Seconds,
    /// Cell-cycles per second.
    CellCyclesPerSecond,
    /// Share of the copy's bandwidth, with 20 bytes for every cell.
    CopyShare,
    /// Times as long as Firn's own layout takes.
    TimesSlower,
}

impl Case {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Case::Session => "session",
            Case::SessionThesis => "session-thesis",
            Case::SessionFrame => "session-frame",
            Case::SessionFrameAwake => "session-frame-awake",
            Case::Field => "field",
            Case::FieldThesis => "field-thesis",
            Case::FieldMany => "field-many",
            Case::World => "world",
            Case::Crowd => "crowd",
            Case::CrowdPublished => "crowd-published",
            Case::CrowdRest => "crowd-rest",
            Case::Vehicle => "vehicle",
            Case::VehicleAwake => "vehicle-awake",
            Case::Snowfall => "snowfall",
            Case::Objects => "objects",
            Case::Stamps => "stamps",
            Case::WeatherSession => "weather-session",
            Case::Weather => "weather",
            Case::WeatherCrowd => "weather-crowd",
            Case::Season => "season",
            Case::SeasonColumns => "season-columns",
            Case::Create => "create",
        }
    }

    /// What it is to reach at full size on one NVIDIA H200.
    pub fn goal(self) -> (Quantity, f64) {
        match self {
            Case::Session => (Quantity::Seconds, 10e-6),
            Case::SessionThesis => (Quantity::TimesSlower, 20.0),
            Case::SessionFrame | Case::SessionFrameAwake => (Quantity::Seconds, 100e-6),
            Case::Field => (Quantity::CellCyclesPerSecond, 150e9),
            Case::FieldThesis => (Quantity::TimesSlower, 150.0),
            Case::FieldMany => (Quantity::CellCyclesPerSecond, 0.8e12),
            Case::World => (Quantity::CopyShare, 0.75),
            Case::Crowd => (Quantity::Seconds, 8e-3),
            Case::CrowdPublished => (Quantity::Seconds, 15e-3),
            Case::CrowdRest | Case::Snowfall => (Quantity::Seconds, 0.3e-3),
            Case::Vehicle | Case::VehicleAwake => (Quantity::Seconds, 0.15e-3),
            Case::Objects => (Quantity::Seconds, 1.0 / 60.0),
            Case::Stamps => (Quantity::Seconds, 3e-3),
            Case::WeatherSession => (Quantity::Seconds, 100e-6),
            Case::Weather => (Quantity::Seconds, 5e-3),
            Case::WeatherCrowd => (Quantity::Seconds, 20e-3),
            Case::Season => (Quantity::Seconds, 5.0),
            Case::SeasonColumns => (Quantity::Seconds, 1.0),
            Case::Create => (Quantity::Seconds, 5e-3),
        }
    }

    /// The case in Firn's layout that one in the thesis's is compared with.
    pub fn ours(self) -> Option<Case> {
        match self {
            Case::SessionThesis => Some(Case::Session),
            Case::FieldThesis => Some(Case::Field),
            _ => None,
        }
    }
}

impl Target {
    /// A quantity beside its bound.
    pub fn new((quantity, bound): (Quantity, f64), reached: f64) -> Target {
        let met = if quantity == Quantity::Seconds { reached <= bound } else { reached >= bound };
        Target { quantity, bound, reached, met }
    }
}
