//! `firn serve`: the server.

use std::io::IsTerminal;

use clap::Args;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};
use tracing_subscriber::EnvFilter;

use crate::config::{
    BackendChoice, EngineConfig, LimitsConfig, ListenConfig, LogConfig, RequestConfig, StreamConfig,
};
use crate::engine::cpu::CpuBackend;
use crate::engine::frame::{Backend, EngineError};
use crate::engine::gpu::GpuBackend;
use crate::http::{self, App};
use crate::session::{Sessions, World, WorldConfig};

use super::{Failure, demo};

/// Publications per second, beside those that requests ask for.
const PUBLISH_RATE: f64 = 20.0;

/// Shown below the flags.
pub const EXAMPLES: &str = "\
Examples:
  firn serve --demo                        a snowpack to look at: GET /v1/sessions/demo
  firn serve --backend cpu                 without a graphics device
  firn serve --listen 127.0.0.1:0          on a free port; the log says which
  firn serve --listen [::]:8080 --allow-open    for every machine that can reach this one";

/// Options of `firn serve`.
#[derive(Args, Clone, Debug)]
pub struct Serve {
    #[command(flatten)]
    listen: ListenConfig,
    #[command(flatten)]
    engine: EngineConfig,
    #[command(flatten)]
    limits: LimitsConfig,
    #[command(flatten)]
    requests: RequestConfig,
    #[command(flatten)]
    stream: StreamConfig,
    #[command(flatten)]
    log: LogConfig,
    /// Begin with a live session `demo`: 5.8 m of snow and three objects on it.
    #[arg(long, env = "FIRN_DEMO", value_parser = clap::builder::FalseyValueParser::new())]
    demo: bool,
}

/// Serves until a signal says to stop.
///
/// # Errors
/// [`Failure::Usage`] for options that can't be carried out, [`Failure::Failed`] where the port is
/// taken or the device can't be used.
pub fn run(options: &Serve) -> Result<(), Failure> {
    start_log(&options.log)?;
    let address = options.listen.listen;
    if !address.ip().is_loopback() && !options.listen.allow_open {
        return Err(Failure::Usage(format!(
            "other machines can reach {address}, and everybody who does may do everything; add \
             --allow-open if that is intended, or listen on 127.0.0.1"
        )));
    }
    let failed = |what: &str, error: std::io::Error| Failure::Failed(format!("{what}: {error}"));
    let runtime =
        tokio::runtime::Runtime::new().map_err(|error| failed("starting threads", error))?;
    let listener = runtime
        .block_on(TcpListener::bind(address))
        .map_err(|error| failed(&format!("listening on {address}"), error))?;
    let backend =
        open_backend(&options.engine).map_err(|error| Failure::Failed(error.to_string()))?;
    let config =
        WorldConfig { limits: options.limits.limits(), publish_rate: PUBLISH_RATE, sleep: true };
    let (sessions, world) =
        World::start(backend, config).map_err(|error| failed("starting the engine", error))?;
    let served = runtime.block_on(serve(options, listener, sessions));
    world.stop();
    info!("stopped");
    served
}

async fn serve(options: &Serve, listener: TcpListener, sessions: Sessions) -> Result<(), Failure> {
    let address = listener
        .local_addr()
        .map_err(|error| Failure::Failed(format!("the address listened on: {error}")))?;
    let device = sessions.device();
    info!(
        adapter = device.adapter,
        backend = device.backend,
        auth = "open",
        "listening on http://{address}"
    );
    info!("sessions live in memory only: they are gone when the server stops");
    if options.demo {
        demo::create(&sessions)
            .await
            .map_err(|error| Failure::Failed(format!("the session 'demo': {error}")))?;
        info!("the session 'demo' is at http://{address}/v1/sessions/demo");
    }
    let shutdown = CancellationToken::new();
    let signals = tokio::spawn(stop_on_signal(shutdown.clone()));
    let app = App::new(sessions, options.requests, options.stream);
    let served = http::run(listener, app, shutdown).await;
    signals.abort();
    served.map_err(|error| Failure::Failed(format!("serving: {error}")))
}

/// Opens what the snowpacks will live on.
///
/// # Errors
/// Where there is no adapter and `auto` was not asked for, or the adapter can't be used.
pub fn open_backend(config: &EngineConfig) -> Result<Box<dyn Backend + Send>, EngineError> {
    let on_cpu = || Box::new(CpuBackend::new(config.device_memory, false));
    if config.backend == BackendChoice::Cpu {
        return Ok(on_cpu());
    }
    match GpuBackend::new(config.device_memory, false) {
        Ok(backend) => Ok(Box::new(backend)),
        Err(EngineError::NoAdapter(why)) if config.backend == BackendChoice::Auto => {
            warn!("no usable graphics adapter ({why}); computing on the CPU");
            Ok(on_cpu())
        }
        Err(error) => Err(error),
    }
}

fn start_log(config: &LogConfig) -> Result<(), Failure> {
    let filter = EnvFilter::try_new(&config.log)
        .map_err(|error| Failure::Usage(format!("--log '{}': {error}", config.log)))?;
    let ansi = std::io::stderr().is_terminal();
    // There is a log already where a test starts the server twice.
    let _ = tracing_subscriber::fmt()
        // A log that nobody reads any more must not end the server.
        .log_internal_errors(false)
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(ansi)
        .with_target(false)
        .try_init();
    Ok(())
}

/// Begins to stop on the first signal, and ends the process on the second.
async fn stop_on_signal(shutdown: CancellationToken) {
    signal().await;
    info!("stopping: finishing what is under way");
    shutdown.cancel();
    signal().await;
    warn!("stopped at once by a second signal");
    std::process::exit(1);
}

#[cfg(unix)]
async fn signal() {
    use tokio::signal::unix::{SignalKind, signal};
    let terminated = async {
        match signal(SignalKind::terminate()) {
            Ok(mut signals) => drop(signals.recv().await),
            Err(error) => {
                warn!("SIGTERM is not handled: {error}");
                std::future::pending().await
            }
        }
    };
    tokio::select! {
        () = interrupted() => {}
        () = terminated => {}
    }
}

#[cfg(not(unix))]
async fn signal() {
    interrupted().await;
}

async fn interrupted() {
    if let Err(error) = tokio::signal::ctrl_c().await {
        warn!("SIGINT is not handled: {error}");
        std::future::pending::<()>().await;
    }
}
