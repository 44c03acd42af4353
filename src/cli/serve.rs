//! `firn serve`: the server.

use std::io::ErrorKind;
use std::net::SocketAddr;
use std::time::Duration;

use clap::Args;
use firn_engine::parallel;
use tokio::net::TcpListener;
use tokio::time::{Instant, sleep_until};
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use crate::backend;
use crate::config::{
    AccessConfig, ConnectionConfig, EngineConfig, LimitsConfig, ListenConfig, LogConfig,
    RequestConfig, StoreConfig, StreamConfig,
};
use crate::driver::{Driver, Durability, OpenBackend, WorldConfig};
use crate::http::{App, Gate};
use crate::open_files;
use crate::server;
use crate::session::{SessionError, Sessions};
use crate::store::{Ephemeral, RedbStore, Store};
use crate::telemetry::Telemetry;

use super::giving_up::{GAVE_UP, stop_on_giving_up};
use super::signals::{Hangups, Signals, reload_on_signal, stop_on_signal};
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
  firn serve --api-key-file key --api-keys-file keys.toml
                                           for tenants, each with keys and quotas of its own
  kill -HUP $(pidof firn)                  read keys and certificates again
  firn serve --listen [::]:8080 --allow-open    for every machine that can reach this one
  RUST_LOG=info,firn=debug firn serve      with a line in the log for each request
  firn serve --log-format json --otlp-endpoint http://127.0.0.1:4318
                                           for machines that read logs and traces
  firn serve --print-config > firn.env     what holds, and where it comes from

Exit codes: 0 stopped by a signal, with all that was under way finished; 1 failed, as where the port
is taken; 2 an option is wrong, unknown or missing.";

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
    /// Print every option as it would hold, as environment variables and with its origin, and end.
    #[arg(long)]
    print_config: bool,
}

impl Serve {
    /// Whether its options are to be printed rather than carried out.
    pub fn prints_config(&self) -> bool {
        self.print_config
    }
}

/// Serves until a signal says to stop.
///
/// # Errors
/// [`Failure::Usage`] for options that can't be carried out, [`Failure::Failed`] where the port is
/// taken or the device can't be used.
pub fn run(options: &Serve) -> Result<(), Failure> {
    let engine = options.engine;
    run_on(options, Box::new(move || backend::open(&engine)))
}

/// As [`run`], on what a function opens.
///
/// # Errors
/// As [`run`].
pub fn run_on(options: &Serve, open: OpenBackend) -> Result<(), Failure> {
    let telemetry =
        Telemetry::start(&options.log).map_err(|error| Failure::Usage(error.to_string()))?;
    let served = start(options, open);
    telemetry.finish();
    served
}

fn start(options: &Serve, open: OpenBackend) -> Result<(), Failure> {
    let address = options.listen.listen;
    let gate = Gate::new(&options.access, options.connections.clone()).map_err(Failure::Usage)?;
    if gate.access.is_open() && !address.ip().is_loopback() && !options.listen.allow_open {
        return Err(Failure::Usage(format!(
            "other machines can reach {address}, and without an API key everybody who does may do \
             everything; give --api-key-file or --api-keys-file, or --allow-open if that is intended, or listen on \
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
    parallel::start()
        .map_err(|why| Failure::Failed(format!("starting threads for the snowpacks: {why}")))?;
    let listener = runtime
        .block_on(TcpListener::bind(address))
        .map_err(|error| not_listening(address, &error))?;
    let config =
        WorldConfig { limits: options.limits.limits(), publish_rate: PUBLISH_RATE, sleep: true };
    let store = open_store(&options.store)?;
    let StoreConfig { checkpoint_interval, accept_loss, .. } = options.store;
    let durability = Durability { store, checkpoint_interval, accept_loss };
    let (sessions, world) = Driver::open(open, config, durability)
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
    // From before anybody is told that there is a server: who starts it may stop it at once.
    // What was read from no file can't be read again: then SIGHUP ends the server, as the end of its
    // terminal has to.
    let hangups = gate.has_files().then(Hangups::new).transpose();
    let (signals, hangups) = match Signals::new().and_then(|signals| Ok((signals, hangups?))) {
        Ok(signals) => signals,
        Err(error) => {
            return (Err(Failure::Failed(format!("taking signals: {error}"))), Instant::now());
        }
    };
    if let Err(failure) = introduce(options, &listener, &sessions, &gate) {
        return (Err(failure), Instant::now());
    }
    let shutdown = CancellationToken::new();
    let signals = tokio::spawn(stop_on_signal(signals, shutdown.clone()));
    if options.demo {
        let demo = make_demo(sessions.clone());
        // Who asks first finds it, unless other sessions have to be brought back before.
        if sessions.vitals().is_recovered() {
            demo.await;
        } else {
            tokio::spawn(demo);
        }
    }
    let app = match App::new(sessions.clone(), options.requests, options.stream, gate) {
        Ok(app) => app,
        Err(error) => {
            return (Err(Failure::Failed(format!("starting threads: {error}"))), Instant::now());
        }
    };
    let reloading = tokio::spawn(reload_on_signal(hangups, app.clone()));
    let giving_up = tokio::spawn(stop_on_giving_up(sessions.clone(), shutdown.clone()));
    let patience = options.store.drain_timeout;
    let serving = server::run(listener, app, shutdown.clone());
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
    reloading.abort();
    giving_up.abort();
    if sessions.vitals().gave_up() {
        return (Err(Failure::Failed(GAVE_UP.to_owned())), deadline);
    }
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

/// Why an address can't be listened on, and what to do about it.
fn not_listening(address: SocketAddr, error: &std::io::Error) -> Failure {
    let advice = match error.kind() {
        ErrorKind::AddrInUse => {
            "; another program listens there: stop it, or choose another port with --listen, as in \
             --listen 127.0.0.1:0 for a free one"
        }
        ErrorKind::AddrNotAvailable => {
            "; this machine has no such address: 127.0.0.1 is for this machine alone, 0.0.0.0 and \
             [::] are all that it has"
        }
        ErrorKind::PermissionDenied => {
            "; ports below 1024 are for privileged programs: choose another with --listen"
        }
        _ => "",
    };
    Failure::Failed(format!("listening on {address}: {error}{advice}"))
}
