//! `firn season`: alpine snow under a season's weather, beside what was measured.

use std::fmt::Write;
use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use firn_snow::weather::{HeightsAbove, Site};
use serde::Serialize;

use crate::season::{self, Evaluation, Forcing, Plan, Report, Scores, Season, SeasonError, Stamps};

use super::{Failure, print, progress};

/// Shown below the flags.
pub const NOTES: &str = "\
Files:
  forcing     CSV with the columns time, sw_in, lw_in [W/m²], ta_c [°C], rh [% over water], wind [m/s], ps_pa [Pa],
              snow_kgm2s and rain_kgm2s [kg/m²/s]; or SMET, the text format of MeteoIO, with timestamp, TA, RH, VW,
              ISWR, ILWR and PSUM. In SMET the pressure is P or follows from the altitude; PSUM_PH parts snow and
              rain, or else all is snow up to 1.2 °C. Rows are all as far apart, without gaps. Longer steps than rows
              take the rows' mean.
  evaluation  CSV with the column date and any of depth_m, swe_kgm2, tsurf_c, albedo and runoff_kgm2d, by the day. An
              empty field is missing.

What the figures mean:
  RMSE, bias  of daily means, the bias positive where Firn has more. Depth and water equivalent are means of the
              states at full hours, the surface's temperature of all steps. A surface of snow that was measured above
              0 °C counts as 0 °C.
  melt-out    the first day with less than 2 cm of snow after the deepest.
  imbalance   what came in and neither left nor lies there, in mass quanta of 2^-18 kg/m²; it has to be 0.

Examples:
  firn season --forcing forcing.csv
  firn season --forcing forcing.csv --evaluation evaluation.csv --out season
  firn season --forcing station.smet --stamps end --temperature-height 4.5 --heights-above ground --json";

/// Options of `firn season`.
#[derive(Args, Clone, Debug)]
pub struct Options {
    /// The weather, row by row.
    #[arg(long, value_name = "FILE")]
    forcing: PathBuf,
    /// What was measured, day by day.
    #[arg(long, value_name = "FILE")]
    evaluation: Option<PathBuf>,
    /// What a row's time is: when its weather begins, or when it has ended, as MeteoIO sums up precipitation.
    #[arg(long, default_value = "start", value_name = "END")]
    stamps: Stamp,
    /// Side of a fresh cell [m], 0.02 to 2.
    #[arg(long, default_value_t = 0.05, value_parser = cell_size, value_name = "METRES")]
    cell_size: f64,
    /// Length of a step [s], 60 to 3600, that an hour is a multiple of.
    #[arg(long, default_value_t = 900, value_parser = weather_step, value_name = "SECONDS")]
    weather_step: u32,
    /// Height at which the air's temperature and humidity are measured [m].
    #[arg(long, default_value_t = 1.5, value_name = "METRES")]
    temperature_height: f64,
    /// Height at which the wind is measured [m].
    #[arg(long, default_value_t = 10.0, value_name = "METRES")]
    wind_height: f64,
    /// What those heights are counted from.
    #[arg(long, default_value = "snow", value_name = "WHAT")]
    heights_above: Above,
    /// Temperatures of the soil at the beginning [°C], in layers of 0.1, 0.2, 0.4 and 0.8 m from the top.
    #[arg(
        long,
        default_value = "10,11,11.5,11.5",
        allow_hyphen_values = true,
        value_name = "CELSIUS"
    )]
    soil: Soil,
    /// Columns along two sides of a grid, all under the same weather: shows what many cost.
    #[arg(long, default_value = "1x1", value_name = "WIDTHxDEPTH")]
    columns: Columns,
    /// Print one JSON object in place of a table.
    #[arg(long)]
    json: bool,
    /// Directory for daily.csv and the figures (SVG); it is created where it is not there.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// What heights are counted from.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Above {
    /// The snow, where sensors are moved by hand
    Snow,
    /// The ground, on a fixed mast
    Ground,
}

/// What a row's time is.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Stamp {
    /// The row holds from it on
    Start,
    /// The row has held up to it
    End,
}

/// Temperatures of the soil.
#[derive(Clone, Copy, Debug)]
struct Soil([f64; 4]);

/// Columns along x and z.
#[derive(Clone, Copy, Debug)]
struct Columns(u32, u32);

/// Most columns of a grid.
const MOST_COLUMNS: u64 = 1 << 20;

impl FromStr for Soil {
    type Err = String;

    fn from_str(text: &str) -> Result<Soil, String> {
        let layers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
        let four = layers.ok().and_then(|layers| layers.try_into().ok());
        four.map(Soil).ok_or_else(|| "expected four numbers, as 10,11,11.5,11.5".to_owned())
    }
}

impl FromStr for Columns {
    type Err = String;

    fn from_str(text: &str) -> Result<Columns, String> {
        let sides =
            text.split_once('x').and_then(|(x, z)| Some((x.parse().ok()?, z.parse().ok()?)));
        let fits =
            |&(x, z): &(u32, u32)| (1..=MOST_COLUMNS).contains(&(u64::from(x) * u64::from(z)));
        sides.filter(fits).map(|(x, z)| Columns(x, z)).ok_or_else(|| {
            format!("expected two numbers, as 8x8, of at most {MOST_COLUMNS} columns")
        })
    }
}

fn cell_size(text: &str) -> Result<f64, String> {
    let metres = text.parse().ok().filter(|metres| (0.02..=2.0).contains(metres));
    metres.ok_or_else(|| "expected 0.02 to 2 m".to_owned())
}

fn weather_step(text: &str) -> Result<u32, String> {
    let whole = |seconds: &u32| (60..=3600).contains(seconds) && 3600 % seconds == 0;
    text.parse().ok().filter(whole).ok_or_else(|| {
        "expected 60 to 3600 s, of which an hour is a multiple: 60, 300, 900, 1800, 3600".to_owned()
    })
}

impl Options {
    fn plan(&self) -> Result<Plan, Failure> {
        let site = Site {
            temperature_height: self.temperature_height,
            wind_height: self.wind_height,
            heights_above: match self.heights_above {
                Above::Snow => HeightsAbove::Snow,
                Above::Ground => HeightsAbove::Ground,
            },
            soil: self.soil.0,
            ..Site::default()
        };
        site.check().map_err(|problem| {
            let field = problem.field.split('[').next().unwrap_or_default().replace('_', "-");
            Failure::Usage(format!("--{field}: {}", problem.message))
        })?;
        Ok(Plan {
            site,
            cell_size: self.cell_size,
            step: f64::from(self.weather_step),
            columns: (self.columns.0, self.columns.1),
        })
    }
}

/// Runs the season, prints how near it comes, and writes its files.
///
/// # Errors
/// [`Failure::Usage`] for heights and temperatures that can't be; [`Failure::Failed`] for files that can't be read or
/// written, and where mass got lost.
pub fn run(options: &Options) -> Result<(), Failure> {
    let plan = options.plan()?;
    let failed = |error: SeasonError| Failure::Failed(error.to_string());
    let stamps = match options.stamps {
        Stamp::Start => Stamps::Start,
        Stamp::End => Stamps::End,
    };
    let forcing = Forcing::read(&options.forcing, stamps).map_err(failed)?;
    let evaluation = options.evaluation.as_deref().map(Evaluation::read).transpose();
    let evaluation = evaluation.map_err(failed)?;
    if let Some(directory) = &options.out {
        // What can't be written should show before the season has passed.
        season::make_directory(directory).map_err(failed)?;
    }
    let bar = progress::bar(plan.steps(&forcing));
    let season = season::run(&plan, &forcing, &|steps| bar.inc(steps));
    bar.finish_and_clear();
    if let Some(directory) = &options.out {
        season::write(&season, evaluation.as_ref(), directory).map_err(failed)?;
    }
    let scores = evaluation.map(|all| Scores::new(&season, &all));
    let mut text = match options.json {
        true => json(&season, &scores.unwrap_or_default())?,
        false => Report { plan: &plan, season: &season, scores: scores.as_ref() }.to_string(),
    };
    if let Some(directory) = options.out.as_ref().filter(|_| !options.json) {
        // Writing to a string can't fail.
        let _ = write!(text, "\nFigures and numbers are in {}.\n", directory.display());
    }
    print(text.as_bytes())?;
    match season.ledger.imbalance() {
        0 => Ok(()),
        quanta => {
            Err(Failure::Failed(format!("the mass does not balance: {quanta} quanta are lost")))
        }
    }
}

/// What `--json` prints; null where nothing was measured.
#[derive(Serialize)]
struct Outcome {
    depth_rmse_m: Option<f64>,
    depth_bias_m: Option<f64>,
    swe_rmse_kgm2: Option<f64>,
    swe_bias_kgm2: Option<f64>,
    tsurf_rmse_k: Option<f64>,
    melt_out_days: Option<i64>,
    imbalance_quanta: i128,
    seconds: f64,
}

fn json(season: &Season, scores: &Scores) -> Result<String, Failure> {
    let outcome = Outcome {
        depth_rmse_m: scores.depth.map(|score| score.rmse),
        depth_bias_m: scores.depth.map(|score| score.bias),
        swe_rmse_kgm2: scores.water.map(|score| score.rmse),
        swe_bias_kgm2: scores.water.map(|score| score.bias),
        tsurf_rmse_k: scores.skin.map(|score| score.rmse),
        melt_out_days: scores.melt_out.map(|melt_out| melt_out.days_late()),
        imbalance_quanta: season.ledger.imbalance(),
        seconds: season.seconds,
    };
    let text = serde_json::to_string_pretty(&outcome)
        .map_err(|error| Failure::Failed(format!("the result can't be written: {error}")))?;
    Ok(format!("{text}\n"))
}
