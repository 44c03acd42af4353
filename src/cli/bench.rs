//! `firn bench`: what snow costs on this machine's device.

use std::time::Duration;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use crate::bench::{self, Case, Plan, Report};
use crate::config::BackendChoice;
use crate::telemetry;

use super::Failure;

/// Shown below the flags.
pub const NOTES: &str = "\
What the figures mean:
  clock      device: times that the device took itself; wall: the host's clock around the whole.
  floor      bytes that the cells of one sample must move, over the bandwidth of a copied buffer
             (read and written bytes counted) in the same run. A cell that changes moves 20 bytes,
             one that does not 16; caches can beat it where the cells fit them.
  copy       the same as a share of the copy's bandwidth.
  Gcell-c/s  10^9 cell-cycles per second, counting only cells that give way in every counted cycle.
  slower     the thesis's layout beside Firn's in the same run.
  target     what one NVIDIA H200 should reach at full scale; without --scale only.

Examples:
  firn bench                                everything, at full size: wants a data-centre GPU
  firn bench --scale 0.004 --samples 20     for a software driver or a small GPU
  firn bench session session-thesis --json";

/// Options of `firn bench`.
#[derive(Args, Clone, Debug)]
pub struct Options {
    /// What to measure; everything where nothing is named.
    #[arg(value_name = "CASE")]
    cases: Vec<Case>,
    /// Part of the columns of large worlds and of the number of sessions, above 0 and up to 1.
    #[arg(long, default_value_t = 1.0, value_parser = parse_scale, value_name = "PART")]
    scale: f64,
    /// How often each thing is measured; some slow ones less often.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=900))]
    samples: u32,
    /// What computes: the graphics device, or the plain-Rust reference on the CPU.
    #[arg(long, env = "FIRN_BACKEND", default_value = "auto", value_name = "BACKEND")]
    backend: BackendChoice,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

pub(super) fn parse_scale(text: &str) -> Result<f64, String> {
    let scale: f64 = text.parse().map_err(|_| "expected a number, as in 0.01".to_owned())?;
    if scale > 0.0 && scale <= 1.0 {
        return Ok(scale);
    }
    Err("must be above 0 and at most 1".to_owned())
}

/// Measures and prints the report.
///
/// # Errors
/// [`Failure::Failed`] where the device can't be used or does not hold what is asked for.
pub fn run(options: &Options) -> Result<(), Failure> {
    telemetry::log_what_goes_wrong();
    let plan = Plan {
        cases: options.cases.clone(),
        scale: options.scale,
        samples: options.samples,
        backend: options.backend,
    };
    let bar = progress_bar();
    let report = bench::run(&plan, &mut |what| bar.set_message(what.to_owned()));
    bar.finish_and_clear();
    print(&report.map_err(|error| Failure::Failed(error.to_string()))?, options.json)
}

/// A line on standard error, hidden where that is no terminal.
fn progress_bar() -> ProgressBar {
    let bar = ProgressBar::new_spinner();
    // The template is constant; without it the line is merely plainer.
    if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed} {msg}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

fn print(report: &Report, json: bool) -> Result<(), Failure> {
    let text = if json {
        serde_json::to_string_pretty(report)
            .map_err(|error| Failure::Failed(format!("the report can't be written: {error}")))?
    } else {
        report.to_string()
    };
    super::print(format!("{}\n", text.trim_end()).as_bytes())
}
