//! Configuration: one struct per concern, each field a flag with its environment variable.

mod access;
mod api_keys;
mod log;

use std::net::SocketAddr;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use clap::builder::FalseyValueParser;
use clap::{Args, ValueEnum};

use crate::session::Limits;

pub use access::{AccessConfig, ApiKey, ConnectionConfig};
pub use api_keys::{Scope, Scopes, TenantConfig, TenantConfigs, TenantKey};
pub use log::{LogConfig, LogFormat};

/// Where the server listens.
#[derive(Args, Clone, Debug)]
pub struct ListenConfig {
    /// Address and port to listen on; port 0 takes a free one.
    #[arg(
        long,
        env = "FIRN_LISTEN",
        default_value = "127.0.0.1:8080",
        value_parser = parse_address,
        value_name = "ADDRESS"
    )]
    pub listen: SocketAddr,

    /// Allow an address that other machines can reach without an API key, although everybody who
    /// reaches it may do everything.
    #[arg(long, env = "FIRN_ALLOW_OPEN", value_parser = FalseyValueParser::new())]
    pub allow_open: bool,
}

/// What the server holds at most.
#[derive(Args, Clone, Copy, Debug)]
pub struct LimitsConfig {
    /// Sessions at a time.
    #[arg(long, env = "FIRN_MAX_SESSIONS", default_value_t = 10_000, value_name = "N")]
    pub max_sessions: usize,

    /// Columns (width × depth) of one session, in whole tiles of 8 × 8.
    #[arg(
        long,
        env = "FIRN_MAX_COLUMNS_PER_SESSION",
        default_value_t = 16_777_216,
        value_name = "N"
    )]
    pub max_columns_per_session: u64,

    /// Columns of all sessions together, in whole tiles.
    #[arg(long, env = "FIRN_MAX_COLUMNS", default_value_t = 268_435_456, value_name = "N")]
    pub max_columns: u64,

    /// Cells (width × depth × height) of one session, in whole tiles.
    #[arg(
        long,
        env = "FIRN_MAX_CELLS_PER_SESSION",
        default_value_t = 268_435_456,
        value_name = "N"
    )]
    pub max_cells_per_session: u64,

    /// Cells of all sessions together, in whole tiles.
    #[arg(long, env = "FIRN_MAX_CELLS", default_value_t = 4_000_000_000, value_name = "N")]
    pub max_cells: u64,

    /// Colliders in one session.
    #[arg(long, env = "FIRN_MAX_COLLIDERS", default_value_t = 4096, value_name = "N")]
    pub max_colliders: usize,
}

impl LimitsConfig {
    /// The same as the sessions know it.
    pub fn limits(&self) -> Limits {
        Limits {
            sessions: self.max_sessions,
            columns_per_session: self.max_columns_per_session,
            columns: self.max_columns,
            cells_per_session: self.max_cells_per_session,
            cells: self.max_cells,
            colliders_per_session: self.max_colliders,
        }
    }
}

/// What one request may take.
#[derive(Args, Clone, Copy, Debug)]
pub struct RequestConfig {
    /// Largest body of a request, in bytes or with a unit, as in `16MiB`.
    #[arg(
        long,
        env = "FIRN_MAX_BODY_BYTES",
        default_value = "16MiB",
        value_parser = parse_bytes_here,
        value_name = "BYTES"
    )]
    pub max_body_bytes: usize,

    /// Memory for bodies that are arriving, and for unfinished messages of stream clients, of all
    /// connections together; a request that finds none gets 503.
    #[arg(
        long,
        env = "FIRN_MAX_BODIES",
        default_value = "128MiB",
        value_parser = parse_bytes,
        value_name = "BYTES"
    )]
    pub max_bodies: u64,

    /// Memory for answers that are being made or wait for their clients to take them, and for messages
    /// to stream clients, of all connections together; large answers wait for room, and get 503 where
    /// there is none for half of --request-timeout.
    #[arg(
        long,
        env = "FIRN_MAX_UNSENT",
        default_value = "256MiB",
        value_parser = parse_bytes,
        value_name = "BYTES"
    )]
    pub max_unsent: u64,

    /// Longest time for a request's body to arrive, and for its answer to be made after that, as in
    /// `30s`; stepping a session, calls about the store and streams may take longer.
    #[arg(
        long,
        env = "FIRN_REQUEST_TIMEOUT",
        default_value = "30s",
        value_parser = parse_duration,
        value_name = "TIME"
    )]
    pub request_timeout: Duration,
}

impl Default for RequestConfig {
    fn default() -> Self {
        RequestConfig {
            max_body_bytes: 16 << 20,
            max_bodies: 128 << 20,
            max_unsent: 256 << 20,
            request_timeout: Duration::from_secs(30),
        }
    }
}

/// What one stream may take.
#[derive(Args, Clone, Copy, Debug)]
pub struct StreamConfig {
    /// Longest time for one message to be written to a stream's client, as in `60s`; a client that
    /// takes longer is closed with 3008.
    #[arg(
        long,
        env = "FIRN_STREAM_WRITE_TIMEOUT",
        default_value = "60s",
        value_parser = parse_duration,
        value_name = "TIME"
    )]
    pub stream_write_timeout: Duration,

    /// Commands per second of one stream, and as many at once; a client that sends more is closed
    /// with 3013.
    #[arg(
        long,
        env = "FIRN_STREAM_COMMANDS_PER_SECOND",
        default_value_t = COMMANDS_PER_SECOND,
        value_name = "N"
    )]
    pub stream_commands_per_second: NonZeroU32,

    /// Time that a client has to hear why its stream is closed.
    #[arg(skip = FAREWELL)]
    pub stream_farewell: Duration,
}

/// Twice as many as 200 objects take that are each moved 60 times a second.
const COMMANDS_PER_SECOND: NonZeroU32 = NonZeroU32::new(24_000).expect("not zero");
const FAREWELL: Duration = Duration::from_secs(2);

impl Default for StreamConfig {
    fn default() -> Self {
        StreamConfig {
            stream_write_timeout: Duration::from_secs(60),
            stream_commands_per_second: COMMANDS_PER_SECOND,
            stream_farewell: FAREWELL,
        }
    }
}

/// What the snowpacks live on.
#[derive(Args, Clone, Copy, Debug)]
pub struct EngineConfig {
    /// What computes: the graphics device, or the plain-Rust reference on the CPU.
    #[arg(long, env = "FIRN_BACKEND", default_value = "auto", value_name = "BACKEND")]
    pub backend: BackendChoice,

    /// Most device memory to use for snowpacks, as in `8GiB`; all there is where it is not given.
    #[arg(long, env = "FIRN_DEVICE_MEMORY", value_parser = parse_bytes, value_name = "BYTES")]
    pub device_memory: Option<u64>,
}

/// How sessions outlive the server.
#[derive(Args, Clone, Debug)]
pub struct StoreConfig {
    /// Directory that sessions are kept in; one server at a time may use it.
    #[arg(long, env = "FIRN_DATA_DIR", default_value = "./firn-data", value_name = "DIRECTORY")]
    pub data_dir: PathBuf,

    /// Keep sessions in memory only: they are gone when the server stops.
    #[arg(long, env = "FIRN_EPHEMERAL", value_parser = FalseyValueParser::new())]
    pub ephemeral: bool,

    /// Time after a change until the session is saved whole, as in `60s`; until then a restart
    /// repeats its changes.
    #[arg(
        long,
        env = "FIRN_CHECKPOINT_INTERVAL",
        default_value = "60s",
        value_parser = parse_duration,
        value_name = "TIME"
    )]
    pub checkpoint_interval: Duration,

    /// Begin empty where the data directory is damaged and no session in it is whole; without this the
    /// server does not start then. The damaged file is kept beside the new one.
    #[arg(long, env = "FIRN_ACCEPT_LOSS", value_parser = FalseyValueParser::new())]
    pub accept_loss: bool,

    /// Longest time to stop in, as in `30s`: requests under way end, streams are closed, and
    /// sessions are saved.
    #[arg(
        long,
        env = "FIRN_DRAIN_TIMEOUT",
        default_value = "30s",
        value_parser = parse_duration,
        value_name = "TIME"
    )]
    pub drain_timeout: Duration,
}

/// What computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum BackendChoice {
    /// The best graphics adapter; the CPU where there is none.
    Auto,
    /// The best graphics adapter; not starting where there is none.
    Gpu,
    /// The CPU.
    Cpu,
}

fn parse_address(text: &str) -> Result<SocketAddr, String> {
    let expected = "expected a numeric address and a port, as in 127.0.0.1:8080 or [::1]:8080";
    text.parse().map_err(|_| expected.to_owned())
}

fn parse_bytes_here(text: &str) -> Result<usize, String> {
    let bytes = parse_bytes(text)?;
    usize::try_from(bytes).map_err(|_| format!("{bytes} bytes are more than this machine counts"))
}

/// Reads a number of bytes: `1048576`, `1024KiB`, `1MiB`.
fn parse_bytes(text: &str) -> Result<u64, String> {
    let digits = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let factor: u64 = match unit.trim_start() {
        "" | "B" => 1,
        "KiB" => 1 << 10,
        "MiB" => 1 << 20,
        "GiB" => 1 << 30,
        "TiB" => 1 << 40,
        other => return Err(format!("'{other}' is no unit; use KiB, MiB, GiB or TiB")),
    };
    let number: u64 = number.parse().map_err(|_| "expected a number, as in 16MiB".to_owned())?;
    number.checked_mul(factor).ok_or_else(|| format!("{text} is too much"))
}

/// Reads a time that is not zero: `30s`, `1m 30s`, or plain seconds.
fn parse_duration(text: &str) -> Result<Duration, String> {
    let time = match text.parse::<u64>() {
        Ok(seconds) => Duration::from_secs(seconds),
        Err(_) => humantime::parse_duration(text).map_err(|error| error.to_string())?,
    };
    if time.is_zero() { Err("must be longer than 0".to_owned()) } else { Ok(time) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_have_units() {
        assert_eq!(parse_bytes("12"), Ok(12));
        assert_eq!(parse_bytes("16MiB"), Ok(16 << 20));
        assert_eq!(parse_bytes("8 GiB"), Ok(8 << 30));
        for wrong in ["", "MiB", "-1", "1.5MiB", "1MB", "99999999999TiB"] {
            assert!(parse_bytes(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn times_have_units() {
        assert_eq!(parse_duration("30"), Ok(Duration::from_secs(30)));
        assert_eq!(parse_duration("1m 30s"), Ok(Duration::from_secs(90)));
        for wrong in ["", "0s", "soon", "-1"] {
            assert!(parse_duration(wrong).is_err(), "{wrong}");
        }
    }
}
