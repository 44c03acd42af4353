//! `firn serve`: the server.

use std::io::IsTerminal;
use std::time::Duration;

use clap::Args;
use tokio::net::TcpListener;
use tokio::time::{Instant, sleep_until};
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};
use tracing_subscriber::EnvFilter;

use crate::config::{
    AccessConfig, BackendChoice, ConnectionConfig, EngineConfig, LimitsConfig, ListenConfig,
    LogConfig, RequestConfig, StoreConfig, StreamConfig,
};
use crate::engine::cpu::CpuBackend;
use crate::engine::frame::{Backend, EngineError};
use crate::engine::gpu::GpuBackend;
use crate::http::{self, App, Gate};
use crate::open_files;
use crate::session::{Durability, SessionError, Sessions, World, WorldConfig};
use crate::store::{Ephemeral, RedbStore, Store};

use super::{Failure, demo};

/// Publications per second, beside those that requests ask for.
const PUBLISH_RATE: f64 = 20.0;

/// Open files that are needed beside one per connection.
const OTHER_FILES: u64 = 64;

/// Part of the drain timeout that is kept for saving sessions.
const SAVING: f64 = 0.4;

/// Shown below the flags.
pub const EXAMPLES: &str = "\
Examples:
  firn serve --demo                        a snowpack to look at: GET /v1/sessions/demo
  firn serve --ephemeral                   keep nothing when it stops
  firn serve --backend cpu                 without a graphics device
  firn serve --listen 127.0.0.1:0          on a free port; the log says which
  firn serve --listen [::]:8080 --api-key-file key --tls-cert cert.pem --tls-key key.pem
                                           for other machines, which need the key
  firn serve --listen [::]:8080 --allow-open    for every machine that can reach this one";

/// Options of `firn serve`.
#[derive(Args, Clone, Debug)]
pub struct Serve {
    #[command(flatten)]
    listen: ListenConfig,
    #[command(flatten)]
    access: AccessConfig,
    #[command(flatten)]
    connections: ConnectionConfig,
    #[command(flatten)]
    engine: EngineConfig,
    #[command(flatten)]
    store: StoreConfig,
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
    let gate = Gate::new(&options.access, options.connections.clone()).map_err(Failure::Usage)?;
    if gate.access.is_open() && !address.ip().is_loopback() && !options.listen.allow_open {
        return Err(Failure::Usage(format!(
            "other machines can reach {address}, and without an API key everybody who does may do \
             everything; give --api-key-file, or --allow-open if that is intended, or listen on \
             127.0.0.1"
        )));
    }
    if let Err(error) = open_files::allow(options.connections.max_connections as u64 + OTHER_FILES)
    {
        warn!("not as many connections as --max-connections: {error}");
    }
    let failed = |what: &str, error: std::io::Error| Failure::Failed(format!("{what}: {error}"));
    let runtime =
        tokio::runtime::Runtime::new().map_err(|error| failed("starting threads", error))?;
    let listener = runtime
        .block_on(TcpListener::bind(address))
        .map_err(|error| failed(&format!("listening on {address}"), error))?;
    let config =
        WorldConfig { limits: options.limits.limits(), publish_rate: PUBLISH_RATE, sleep: true };
    let store = open_store(&options.store)?;
    let durability = Durability { store, checkpoint_interval: options.store.checkpoint_interval };
    let engine = options.engine;
    let (sessions, world) =
        World::open(Box::new(move || open_backend(&engine)), config, durability)
            .map_err(|error| Failure::Failed(error.to_string()))?;
    let (served, deadline) = runtime.block_on(serve(options, listener, sessions, gate));
    world.stop_by(deadline.into_std());
    info!("stopped");
    served
}

/// Serves until it is to stop. Returns when everything has to be over as well.
async fn serve(
    options: &Serve,
    listener: TcpListener,
    sessions: Sessions,
    gate: Gate,
) -> (Result<(), Failure>, Instant) {
    if let Err(failure) = introduce(options, &listener, &sessions, &gate) {
        return (Err(failure), Instant::now());
    }
    let shutdown = CancellationToken::new();
    let signals = tokio::spawn(stop_on_signal(shutdown.clone()));
    if options.demo {
        let demo = make_demo(sessions.clone());
        // Who asks first finds it, unless other sessions have to be brought back before.
        if sessions.vitals().is_recovered() {
            demo.await;
        } else {
            tokio::spawn(demo);
        }
    }
    let app = App::new(sessions.clone(), options.requests, options.stream, gate);
    let patience = options.store.drain_timeout;
    let serving = http::run(listener, app, shutdown.clone());
    let draining = async {
        shutdown.cancelled().await;
        sessions.close();
        let deadline = Instant::now() + patience;
        sleep_until(deadline - patience.mul_f64(SAVING)).await;
        deadline
    };
    tokio::pin!(serving, draining);
    let (served, deadline) = tokio::select! {
        served = &mut serving => (served, Instant::now() + patience.mul_f64(SAVING)),
        deadline = &mut draining => {
            warn!("requests or streams were still under way; they are cut");
            (Ok(()), deadline)
        }
    };
    signals.abort();
    (served.map_err(|error| Failure::Failed(format!("serving: {error}"))), deadline)
}

/// Says where the server listens and on what it runs.
fn introduce(
    options: &Serve,
    listener: &TcpListener,
    sessions: &Sessions,
    gate: &Gate,
) -> Result<(), Failure> {
    let address = listener
        .local_addr()
        .map_err(|error| Failure::Failed(format!("the address listened on: {error}")))?;
    let device = sessions.device();
    let scheme = if gate.tls.is_some() { "https" } else { "http" };
    if !gate.access.is_open() && gate.tls.is_none() && !address.ip().is_loopback() {
        warn!("tokens can be read on their way: --tls-cert or a proxy with TLS keeps them secret");
    }
    info!(
        adapter = device.adapter,
        backend = device.backend,
        auth = if gate.access.is_open() { "open" } else { "required" },
        "listening on {scheme}://{address}"
    );
    if options.store.ephemeral {
        info!("sessions live in memory only: they are gone when the server stops");
    } else {
        info!("sessions are kept in {}", options.store.data_dir.display());
    }
    if options.demo {
        info!("the session 'demo' is at {scheme}://{address}/v1/sessions/demo");
    }
    Ok(())
}

/// Creates the session `demo`, unless it is there from before.
async fn make_demo(sessions: Sessions) {
    while !sessions.vitals().is_recovered() {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    match demo::create(&sessions).await {
        Ok(()) | Err(SessionError::Conflict(_)) => {}
        Err(error) => warn!("the session 'demo' could not be made: {error}"),
    }
}

/// Opens what sessions are kept in.
///
/// # Errors
/// Where it can't be used.
fn open_store(config: &StoreConfig) -> Result<Box<dyn Store>, Failure> {
    if config.ephemeral {
        return Ok(Box::new(Ephemeral));
    }
    match RedbStore::in_directory(&config.data_dir) {
        Ok(store) => Ok(Box::new(store)),
        Err(error) => Err(Failure::Failed(format!(
            "{error}; choose another with --data-dir, or keep nothing with --ephemeral"
        ))),
    }
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
