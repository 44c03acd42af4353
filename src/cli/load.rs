//! `firn load`: the load tool.

use std::fmt::Display;
use std::time::Duration;

use clap::{Args, ValueEnum};
use firn_protocol::stream::SubProtocol;
use indicatif::{HumanBytes, ProgressBar, ProgressStyle};
use serde::Serialize;
use tokio_util::sync::CancellationToken;

use crate::config::ApiKey;
use crate::load::{self, Attack, Extent, LoadError, Plan, Progress, Scenario};

use super::Failure;

/// Shown below the flags.
pub const NOTES: &str = "\
What the figures mean:
  tick to client   arrival of the first message that tells a tick, less the instant the tick was
                   due. A client does not know the latter: the least (arrival - tick / tick rate) of
                   all messages of a session stands for zero, so that these are times beyond that
                   of the fastest message. They grow where the server can't hold the tick rate:
                   look at it too. Stalled clients and snapshots do not count.
  deltas           payload bytes and columns of the tiles sent; snapshots do not count.
  moves to acks    from sending a batch of moved objects to its ack.
  stalled clients  messages that a client read after its stall until it saw the newest state that
                   any client had at that moment, those in the sockets' buffers included.
  durable          with --durable, a snowfall counts when it is acknowledged, which is when it is on
                   the server's disk. Every client has one request under way.
  hostile          with --hostile, a session of 32x32 columns at 60 Hz, its neighbour, is changed every
                   0.1 s: ticks per second, and the time from a change to its answer, alone, as
                   `nobody`, and beside each scenario. Changes don't wait for each other. +MiB is the rise
                   of the server's memory to its peak, as seen every 20 ms. Of `ticks` it is also
                   measured what it gets alone. The server should have no other sessions.
  samples          with --samples, from a request to its answer, read and understood, while the snow
                   settles: what the server has at hand, what takes a frame, and that with the depth
                   that a foot of 80 kg on 0.03 m2 would sink.
  server memory    resident set of --server-pid before the first client, and at the end of the run.
                   Linux only, and only on the server's machine.

Examples:
  firn load                                   100 clients of one session for 10 s
  firn load --clients 1000 --tick-rate 10 --max-rate 10 --duration 20s --server-pid $(pidof firn)
  firn load --slow-clients 10 --stall 30s --duration 40s --json
  firn load --durable --sessions 8 --clients 64
  firn load --samples 1000 --tick-rate 20
  firn load --hostile --server-pid $(pidof firn)
  firn load --hostile --scenario ticks,objects --scale 0.1";

/// How heights are written.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum HeightFormat {
    /// As JSON.
    Json,
    /// As packed bytes.
    Bin,
}

impl From<HeightFormat> for SubProtocol {
    fn from(format: HeightFormat) -> SubProtocol {
        match format {
            HeightFormat::Json => SubProtocol::Json,
            HeightFormat::Bin => SubProtocol::Binary,
        }
    }
}

/// Options of `firn load`.
#[derive(Args, Clone, Debug)]
pub struct Options {
    /// The server; only http, without TLS.
    #[arg(long, default_value = "http://127.0.0.1:8080")]
    url: String,
    /// The server's API key, where it asks for one.
    #[arg(long, env = "FIRN_API_KEY", hide_env_values = true, value_name = "KEY")]
    api_key: Option<ApiKey>,
    /// How clients are told heights.
    #[arg(long, default_value = "json")]
    protocol: HeightFormat,
    /// Sessions to create; clients are spread over them.
    #[arg(long, default_value_t = 1)]
    sessions: usize,
    /// Clients that watch, those of all sessions together.
    #[arg(long, default_value_t = 100)]
    clients: usize,
    /// How many of the clients stop reading for a while.
    #[arg(long, default_value_t = 0, value_name = "CLIENTS")]
    slow_clients: usize,
    /// For how long they do, from the beginning of the run.
    #[arg(long, default_value = "5s", value_parser = humantime::parse_duration, value_name = "TIME")]
    stall: Duration,
    /// Columns that each client watches.
    #[arg(long, default_value = "32x32", value_name = "COLUMNS")]
    region: Extent,
    /// Columns of each session, each 0.2 m wide.
    #[arg(long, default_value = "128x128", value_name = "COLUMNS")]
    grid: Extent,
    /// Cells that a column can hold.
    #[arg(long, default_value_t = 20, value_name = "CELLS")]
    height: u32,
    /// Fresh snow that the sessions begin with, in metres.
    #[arg(long, default_value_t = 2.0, value_name = "METRES")]
    snow: f64,
    /// Snow that falls in them during the run, in metres an hour.
    #[arg(long, default_value_t = 0.0, value_name = "RATE")]
    snowfall_rate: f64,
    /// Let snow fall instead of watching it: each client asks for a little, waits until that is
    /// durable, and asks again. The sessions are paused.
    #[arg(long)]
    durable: bool,
    /// With --durable: end when each session has had as many snowfalls, not after --duration.
    #[arg(long, requires = "durable", value_name = "SNOWFALLS")]
    changes: Option<u64>,
    /// With --durable: keep the sessions, to see what a restart makes of them.
    #[arg(long, requires = "durable")]
    keep: bool,
    /// Read the snow of one session at so many points, again and again, instead of watching it.
    #[arg(long, value_name = "POINTS", value_parser = clap::value_parser!(u32).range(1..=65_536), conflicts_with_all = ["durable", "hostile"])]
    samples: Option<u32>,
    /// Let one client take all that it may, and measure what is left for a neighbour; for servers on
    /// this machine. --duration holds for each measurement.
    #[arg(long, conflicts_with = "durable")]
    hostile: bool,
    /// With --hostile: what it does, in this order; everything where it is not given.
    #[arg(long, requires = "hostile", value_delimiter = ',', value_name = "SCENARIO")]
    scenario: Vec<Scenario>,
    /// With --hostile: part of the full columns, pixels, objects, requests and bytes.
    #[arg(long, requires = "hostile", default_value_t = 1.0, value_parser = super::bench::parse_scale, value_name = "PART")]
    scale: f64,
    /// Objects in each session, moved once per tick, all of them in one batch.
    #[arg(long, default_value_t = 20, value_name = "OBJECTS")]
    colliders: usize,
    /// Ticks per second of the sessions.
    #[arg(long, default_value_t = 10.0, value_name = "HZ")]
    tick_rate: f64,
    /// Most messages per second that a client wants.
    #[arg(long, default_value_t = 10.0, value_name = "HZ")]
    max_rate: f64,
    /// Length of the run.
    #[arg(long, default_value = "10s", value_parser = humantime::parse_duration, value_name = "TIME")]
    duration: Duration,
    /// Let the snow settle before the run, so that only what objects do changes it.
    #[arg(long)]
    settled: bool,
    /// The server's process, to measure its memory.
    #[arg(long, value_name = "PID")]
    server_pid: Option<u32>,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

impl Options {
    fn plan(&self) -> Result<Plan, Failure> {
        for (flag, rate) in [("--tick-rate", self.tick_rate), ("--max-rate", self.max_rate)] {
            if !(0.1..=1000.0).contains(&rate) {
                return Err(Failure::Usage(format!("{flag} {rate} is not within 0.1 to 1000 Hz")));
            }
        }
        Ok(Plan {
            url: self.url.clone(),
            api_key: self.api_key.clone(),
            protocol: self.protocol.into(),
            sessions: self.sessions,
            clients: self.clients,
            slow_clients: self.slow_clients,
            stall: self.stall,
            region: self.region,
            grid: self.grid,
            height: self.height,
            colliders: self.colliders,
            tick_rate: self.tick_rate,
            max_rate: self.max_rate,
            duration: self.duration,
            snow: self.snow,
            snowfall_rate: self.snowfall_rate,
            settled: self.settled,
            server_pid: self.server_pid,
        })
    }

    fn attack(&self) -> Attack {
        let all = || Scenario::value_variants().to_vec();
        let scenarios = if self.scenario.is_empty() { all() } else { self.scenario.clone() };
        Attack { scenarios, scale: self.scale }
    }
}

/// Carries a run out and prints its report.
///
/// # Errors
/// [`Failure::Usage`] for rates that can't be, [`Failure::Failed`] where the run can't be carried
/// out.
pub fn run(options: &Options) -> Result<(), Failure> {
    let plan = options.plan()?;
    let runtime = tokio::runtime::Runtime::new()
        .map_err(|error| Failure::Failed(format!("starting threads: {error}")))?;
    let json = options.json;
    if options.hostile {
        let (attack, show) = (options.attack(), |beside| format!("a neighbour beside {beside}"));
        let run = async |observe: &dyn Fn(_), stop: &_| {
            load::run_hostile(&plan, &attack, observe, stop).await
        };
        return print(&runtime.block_on(carry_out(show, run))?, json);
    }
    let show = |progress| line(&plan, &progress);
    if let Some(points) = options.samples {
        let run = async |observe: &dyn Fn(_), stop: &_| {
            load::run_samples(&plan, points as usize, observe, stop).await
        };
        return print(&runtime.block_on(carry_out(show, run))?, json);
    }
    if options.durable {
        let (changes, keep) = (options.changes, options.keep);
        let run = async |observe: &dyn Fn(_), stop: &_| {
            load::run_durable(&plan, changes, keep, observe, stop).await
        };
        return print(&runtime.block_on(carry_out(show, run))?, json);
    }
    let run = async |observe: &dyn Fn(_), stop: &_| load::run(&plan, observe, stop).await;
    print(&runtime.block_on(carry_out(show, run))?, json)
}

/// Carries a run out, and shows how far it is.
async fn carry_out<P, R>(
    show: impl Fn(P) -> String,
    run: impl AsyncFnOnce(&dyn Fn(P), &CancellationToken) -> Result<R, LoadError>,
) -> Result<R, Failure> {
    let stop = CancellationToken::new();
    let interrupt = tokio::spawn({
        let stop = stop.clone();
        async move {
            if tokio::signal::ctrl_c().await.is_ok() {
                stop.cancel();
            }
        }
    });
    let bar = progress_bar();
    let result = run(&|progress| bar.set_message(show(progress)), &stop).await;
    bar.finish_and_clear();
    interrupt.abort();
    result.map_err(|error| Failure::Failed(error.to_string()))
}

/// A line on standard error, hidden where that is no terminal.
fn progress_bar() -> ProgressBar {
    let bar = ProgressBar::new_spinner().with_message("preparing the sessions");
    // The template is constant; without it the line is merely plainer.
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

fn line(plan: &Plan, progress: &Progress) -> String {
    let Progress { connected, elapsed, messages, bytes } = *progress;
    if elapsed.is_zero() {
        return format!("{connected} of {} clients connected", plan.clients);
    }
    format!(
        "{:.0} of {:.0} s, {connected} clients, {messages} messages, {}",
        elapsed.as_secs_f64(),
        plan.duration.as_secs_f64(),
        HumanBytes(bytes)
    )
}

fn print(report: &(impl Display + Serialize), json: bool) -> Result<(), Failure> {
    let text = if json {
        serde_json::to_string_pretty(report)
            .map_err(|error| Failure::Failed(format!("the report can't be written: {error}")))?
    } else {
        report.to_string()
    };
    super::print(format!("{}\n", text.trim_end()).as_bytes())
}
