//! `firn experiment`: repeats the thesis's experiments.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::backend;
use crate::config::{BackendChoice, EngineConfig};
use crate::driver::{Driver, WorldConfig};
use crate::experiment::{self, Experiment, SIDE};
use crate::session::{Limits, Sessions};
use crate::telemetry;

use super::{Failure, print, progress};

/// Shown below the flags.
pub const EXAMPLES: &str = "\
Examples:
  firn experiment all                      every experiment, into the directory 'experiments'
  firn experiment 3 --out /tmp/weak        the one with the weak layer
  firn experiment 1a --backend cpu         without a graphics device";

/// Options of `firn experiment`.
#[derive(Args, Clone, Debug)]
pub struct Options {
    /// Which experiment.
    experiment: Choice,
    /// What computes: the graphics device, or the plain-Rust reference on the CPU.
    #[arg(long, env = "FIRN_BACKEND", default_value = "auto", value_name = "BACKEND")]
    backend: BackendChoice,
    /// Directory for the figures (SVG) and the numbers (CSV); it is created where it is not there.
    #[arg(long, default_value = "experiments", value_name = "DIR")]
    out: PathBuf,
}

/// What can be asked for.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Choice {
    /// 5.8 m of snow at −3 °C
    #[value(name = "1a")]
    OneA,
    /// 5.8 m of snow at −10 °C
    #[value(name = "1b")]
    OneB,
    /// Snow that is 2 °C colder every 0.8 m
    #[value(name = "2")]
    Two,
    /// Four snowfalls, one of them cold: a weak layer
    #[value(name = "3")]
    Three,
    /// Objects of 100 kg on 16, 1 and 0.1 m²
    Colliders,
    /// A single column of 8 m, warm and cold
    Prototype,
    /// All of these
    All,
}

impl Choice {
    fn experiments(self) -> Vec<Experiment> {
        match self {
            Choice::OneA => vec![Experiment::OneA],
            Choice::OneB => vec![Experiment::OneB],
            Choice::Two => vec![Experiment::Two],
            Choice::Three => vec![Experiment::Three],
            Choice::Colliders => vec![Experiment::Colliders],
            Choice::Prototype => vec![Experiment::Prototype],
            Choice::All => Experiment::ALL.to_vec(),
        }
    }
}

/// Carries the experiments out, prints their tables and writes their files.
///
/// # Errors
/// [`Failure::Failed`] where the device or the directory can't be used, and where a result is not
/// what it should be.
pub fn run(options: &Options) -> Result<(), Failure> {
    telemetry::log_what_goes_wrong();
    let engine = EngineConfig { backend: options.backend, device_memory: None };
    let backend = backend::open(&engine).map_err(|error| Failure::Failed(error.to_string()))?;
    let failed = |what: &str, error: std::io::Error| Failure::Failed(format!("{what}: {error}"));
    let runtime = tokio::runtime::Builder::new_current_thread()
        .build()
        .map_err(|error| failed("starting a runtime", error))?;
    let limits = Limits {
        sessions: 1,
        columns_per_session: 1 << 20,
        columns: 1 << 40,
        cells_per_session: 1 << 20,
        cells: 1 << 20,
        colliders_per_session: 3,
    };
    let config = WorldConfig { limits, publish_rate: 0.0, sleep: true };
    let (sessions, world) =
        Driver::start(backend, config).map_err(|error| failed("starting the engine", error))?;
    let result = runtime.block_on(carry_out(options, &sessions));
    world.stop();
    verdict(&result?)
}

/// Fails where something deviates, and says what.
fn verdict(deviations: &[String]) -> Result<(), Failure> {
    if deviations.is_empty() {
        return Ok(());
    }
    Err(Failure::Failed(format!("not as expected:\n  {}", deviations.join("\n  "))))
}

/// Carries the experiments out; returns what deviates.
async fn carry_out(options: &Options, sessions: &Sessions) -> Result<Vec<String>, Failure> {
    let failed = |error: experiment::ExperimentError| Failure::Failed(error.to_string());
    // An experiment takes its time: what can't be written should show before.
    experiment::make_directory(&options.out).map_err(failed)?;
    let device = sessions.device();
    print(format!("Computed by {} ({}).\n", device.adapter, device.backend).as_bytes())?;
    let experiments = options.experiment.experiments();
    let bar = progress::bar(experiments.iter().map(|experiment| experiment.ticks()).sum());
    let mut deviations = Vec::new();
    for experiment in experiments {
        let progress = |ticks| bar.inc(ticks);
        let studies =
            experiment::run(sessions, experiment, SIDE, &progress).await.map_err(failed)?;
        for study in &studies {
            experiment::write(study, &options.out).map_err(failed)?;
            bar.suspend(|| print(format!("\n{study}").as_bytes()))?;
            deviations.extend(study.deviations());
        }
    }
    bar.finish_and_clear();
    print(format!("\nFigures and numbers are in {}.\n", options.out.display()).as_bytes())?;
    Ok(deviations)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deviation_is_a_failure_that_names_it() {
        assert!(verdict(&[]).is_ok());
        let Err(Failure::Failed(message)) = verdict(&["1a: height is 5 m".to_owned()]) else {
            panic!("it deviates");
        };
        assert!(message.contains("1a: height is 5 m"));
    }
}
