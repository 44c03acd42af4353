//! A day of spring on alpine snow: slush that lets a walker sink in the afternoon, and a crust that carries him at night.
//!
//! Nothing is told but the air's temperature and the clouds: sun and sky follow from the place and the
//! simulated time. Every hour a walker's foot is probed. The program prints a table, and draws a picture where it is
//! asked for one.
//!
//! ```sh
//! cargo run --release --example alpine_day -- http://127.0.0.1:8080 --picture day.svg
//! ```
//!
//! The day passes as fast as the server can. With `--live` it passes at 60 simulated seconds a second, as in a
//! game, and takes 24 minutes. A guarded server's key comes from `FIRN_API_KEY`.

mod picture;

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use clap::Parser;
use firn_client::{Client, Session};
use firn_protocol::{
    Physics, Probe, ProbeBatch, SessionBody, SessionSpec, SettingsPatch, Site, SnowLayer, Start,
    StepSpec, Weather, WeatherInput, WeatherRow, WeatherSeries,
};
use firn_snow::Grid;

type Failure = Box<dyn Error + Send + Sync>;

/// When the day begins, UTC, and its first hour.
const START: &str = "2026-04-05T10:00:00Z";
const FIRST_HOUR: f64 = 10.0;
/// Simulated seconds per second in a game.
const TIME_SCALE: f64 = 60.0;
/// Mass of the walker \[kg\], and the area of a foot \[m²\].
const WALKER: (f64, f64) = (80.0, 0.03);

/// A day of spring on alpine snow.
#[derive(Parser)]
struct Options {
    /// Address of the Firn server.
    #[arg(default_value = "http://127.0.0.1:8080")]
    server: String,
    /// Let the day pass at 60 simulated seconds a second.
    #[arg(long)]
    live: bool,
    /// Draw the day into this file, as SVG.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Key of a guarded server.
    #[arg(long, env = "FIRN_API_KEY", hide_env_values = true)]
    key: Option<String>,
}

/// What is seen in an hour.
#[derive(Clone, Copy, Debug)]
pub struct Hour {
    /// Hours since the day began.
    pub hour: f64,
    /// \[°C\]
    pub air: f64,
    /// \[°C\]
    pub skin: f64,
    /// How deep the walker sinks \[m\].
    pub sink: f64,
}

#[tokio::main]
async fn main() -> ExitCode {
    match run(Options::parse()).await {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("alpine_day: {why}");
            ExitCode::FAILURE
        }
    }
}

async fn run(options: Options) -> Result<(), Failure> {
    let mut client = Client::new(&options.server)?;
    if let Some(key) = &options.key {
        client = client.with_key(key)?;
    }
    let (session, _) = client.create(&spec()).await?;
    let hours = pass(&session, options.live).await;
    session.delete().await?;
    let hours = hours?;
    if let Some(file) = &options.picture {
        picture::write(file, FIRST_HOUR, &hours)?;
    }
    Ok(())
}

/// A metre of old snow in the Alps.
fn spec() -> SessionSpec {
    let site = Site {
        latitude: Some(46.8),
        longitude: Some(9.8),
        start: Start::parse(START),
        pressure: 800.0,
        soil: [0.0, 0.5, 1.0, 2.0],
        ..Site::default()
    };
    let layer = SnowLayer { depth: 1.0, density: Some(290.0), temperature: Some(-1.0) };
    SessionSpec::from(SessionBody {
        physics: Physics::Alpine,
        grid: Grid { width: 8, depth: 8, height: 100, cell_size: 0.05 },
        site: Some(Arc::new(site)),
        weather: Some(Arc::new(WeatherInput::Series(day()))),
        initial_snow: vec![layer],
        time_scale: TIME_SCALE,
        tick_rate: 20.0,
        paused: true,
        ..SessionBody::default()
    })
}

/// A clear day: warmest at two in the afternoon, and frost at night.
fn day() -> WeatherSeries {
    let row = |hour: u32| {
        let time = FIRST_HOUR + f64::from(hour);
        let warmth = ((time - 14.0) / 12.0 * std::f64::consts::PI).cos();
        let air_temperature = 3.0 + 7.0 * warmth;
        let weather = Weather { air_temperature, cloud_cover: Some(0.0), ..Weather::default() };
        WeatherRow { at: 3600.0 * f64::from(hour), weather }
    };
    WeatherSeries { series: (0..=24).map(row).collect(), interpolate: true }
}

/// Lets the day pass, and looks at the snow every hour.
async fn pass(session: &Session, live: bool) -> Result<Vec<Hour>, Failure> {
    println!("  UTC    air      skin    a walker sinks");
    let mut hours = vec![look(session, 0).await?];
    if live {
        session.set(&SettingsPatch { paused: Some(false), ..SettingsPatch::default() }).await?;
    }
    for hour in 1..=24 {
        if live {
            tokio::time::sleep(Duration::from_secs_f64(3600.0 / TIME_SCALE)).await;
        } else {
            session.step(&StepSpec { seconds: Some(3600.0), ..StepSpec::default() }).await?;
        }
        hours.push(look(session, hour).await?);
    }
    Ok(hours)
}

async fn look(session: &Session, hour: u32) -> Result<Hour, Failure> {
    let (mass, area) = WALKER;
    let probe = Probe { x: 0.2, z: 0.2, mass, area, duration: None };
    let probes = session.probe(&ProbeBatch { probes: vec![probe] }).await?;
    let column = session.column(4, 4).await?;
    let seen = Hour {
        hour: hour.into(),
        air: session.weather().await?.now.air_temperature,
        skin: column.alpine.map_or(0.0, |alpine| alpine.skin_temperature),
        sink: probes.probes.first().map_or(0.0, |probe| probe.sink_depth),
    };
    let clock = (FIRST_HOUR as u32 + hour) % 24;
    let Hour { air, skin, sink, .. } = seen;
    let verdict = if sink < 0.005 { "carried" } else { "" };
    println!("{clock:02}:00 {air:6.1} °C {skin:6.1} °C {:8.1} cm  {verdict}", 100.0 * sink);
    Ok(seen)
}
