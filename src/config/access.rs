//! Who may reach the server: the API key, the names and pages that it answers to, its certificate,
//! and what one client may take of it.

use std::fmt;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use axum::http::HeaderValue;
use axum::http::uri::Uri;
use clap::Args;

use super::api_keys::{self, TenantConfigs};
use super::parse_duration;

/// Fewest characters of an API key: what a person can remember can be guessed.
pub(super) const SHORTEST_KEY: usize = 16;

/// Who may do what.
#[derive(Args, Clone, Debug)]
pub struct AccessConfig {
    /// Key that may do everything; without one the server is open. Better given in a file or in the
    /// environment: other users of this machine can see a command line.
    #[arg(long, env = "FIRN_API_KEY", hide_env_values = true, value_name = "KEY")]
    pub api_key: Option<ApiKey>,

    /// File that holds the API key in its first line.
    #[arg(long, env = "FIRN_API_KEY_FILE", value_name = "FILE", conflicts_with = "api_key")]
    pub api_key_file: Option<PathBuf>,

    /// TOML file with more API keys, each for what one tenant may do within its quotas; `firn key`
    /// makes one. SIGHUP has it read again, as well as the files of --api-key-file and --tls-cert.
    #[arg(long, env = "FIRN_API_KEYS_FILE", value_name = "FILE")]
    pub api_keys_file: Option<PathBuf>,

    /// Another name by which clients call this server, as their `Host` header says it; may be
    /// given several times.
    #[arg(
        long,
        env = "FIRN_ALLOWED_HOST",
        value_delimiter = ',',
        value_parser = parse_host,
        value_name = "NAME"
    )]
    pub allowed_host: Vec<String>,

    /// Web pages that may use this server beside those it serves itself, as in
    /// `https://game.example`; may be given several times.
    #[arg(
        long,
        env = "FIRN_ALLOWED_ORIGIN",
        value_delimiter = ',',
        value_parser = parse_origin,
        value_name = "ORIGIN"
    )]
    pub allowed_origin: Vec<HeaderValue>,

    /// Requests per second with one token, and as many at once; 429 beyond them.
    #[arg(
        long,
        env = "FIRN_REQUESTS_PER_SECOND",
        default_value_t = REQUESTS_PER_SECOND,
        value_name = "N"
    )]
    pub requests_per_second: NonZeroU32,

    /// Requests with a wrong token per minute and address, IPv6 addresses by their /64, that are told
    /// so; 429 beyond them. Right tokens still work then.
    #[arg(
        long,
        env = "FIRN_AUTH_FAILURES_PER_MINUTE",
        default_value_t = AUTH_FAILURES_PER_MINUTE,
        value_name = "N"
    )]
    pub auth_failures_per_minute: NonZeroU32,
}

/// Several times what a game server needs that sends a request for each of its objects.
const REQUESTS_PER_SECOND: NonZeroU32 = NonZeroU32::new(10_000).expect("not zero");

/// More than people make mistakes, and little to answer and to log.
const AUTH_FAILURES_PER_MINUTE: NonZeroU32 = NonZeroU32::new(60).expect("not zero");

impl Default for AccessConfig {
    fn default() -> Self {
        AccessConfig {
            api_key: None,
            api_key_file: None,
            api_keys_file: None,
            allowed_host: Vec::new(),
            allowed_origin: Vec::new(),
            requests_per_second: REQUESTS_PER_SECOND,
            auth_failures_per_minute: AUTH_FAILURES_PER_MINUTE,
        }
    }
}

/// What one connection may take, and how many there may be.
#[derive(Args, Clone, Debug)]
pub struct ConnectionConfig {
    /// Connections at a time, streams among them; those beyond them are closed at once.
    #[arg(
        long,
        env = "FIRN_MAX_CONNECTIONS",
        default_value_t = MAX_CONNECTIONS,
        value_name = "N"
    )]
    pub max_connections: usize,

    /// Longest time for the head of a request to arrive, from the connection's beginning or the
    /// end of the request before, as in `30s`.
    #[arg(
        long,
        env = "FIRN_HEADER_TIMEOUT",
        default_value = "30s",
        value_parser = parse_duration,
        value_name = "TIME"
    )]
    pub header_timeout: Duration,

    /// Longest time without a byte taken by a client that something is sent to, as in `30s`; then the
    /// connection is closed.
    #[arg(
        long,
        env = "FIRN_WRITE_TIMEOUT",
        default_value = "30s",
        value_parser = parse_duration,
        value_name = "TIME"
    )]
    pub write_timeout: Duration,

    /// Certificate chain for TLS, in a PEM file; without one the server speaks plain HTTP.
    #[arg(long, env = "FIRN_TLS_CERT", value_name = "FILE", requires = "tls_key")]
    pub tls_cert: Option<PathBuf>,

    /// Private key for TLS, in a PEM file.
    #[arg(long, env = "FIRN_TLS_KEY", value_name = "FILE", requires = "tls_cert")]
    pub tls_key: Option<PathBuf>,
}

const MAX_CONNECTIONS: usize = 10_000;

impl Default for ConnectionConfig {
    fn default() -> Self {
        ConnectionConfig {
            max_connections: MAX_CONNECTIONS,
            header_timeout: Duration::from_secs(30),
            write_timeout: Duration::from_secs(30),
            tls_cert: None,
            tls_key: None,
        }
    }
}

impl AccessConfig {
    /// Whether nobody is asked for a token.
    pub fn is_open(&self) -> bool {
        self.api_key.is_none() && self.api_key_file.is_none() && self.api_keys_file.is_none()
    }

    /// The tenants of the keys file, where there is one.
    ///
    /// # Errors
    /// Where the file can't be read, or something in it can't hold.
    pub fn tenants(&self) -> Result<Option<TenantConfigs>, String> {
        self.api_keys_file.as_deref().map(api_keys::read).transpose()
    }

    /// The operator's API key, wherever it stands; `None` where there is none.
    ///
    /// # Errors
    /// Where the file can't be read, or the key could be guessed or can't be sent.
    pub fn key(&self) -> Result<Option<ApiKey>, String> {
        let (key, place) = match (&self.api_key, &self.api_key_file) {
            (None, None) => return Ok(None),
            (Some(key), _) => (key.clone(), "--api-key".to_owned()),
            (None, Some(file)) => {
                let place = format!("--api-key-file {}", file.display());
                let text = std::fs::read_to_string(file).map_err(|error| {
                    format!("{place}: {error}; expected a file that this user can read")
                })?;
                (ApiKey::from(text.lines().next().unwrap_or("")), place)
            }
        };
        if !key.is_sound() {
            return Err(format!(
                "{place}: a key has at least {SHORTEST_KEY} characters, visible ASCII without \
                 spaces; `openssl rand -hex 32` makes one"
            ));
        }
        Ok(Some(key))
    }
}

/// A secret that may do everything. It is checked by [`AccessConfig::key`] and not where it is
/// read, because a command line's complaint would repeat it.
#[derive(Clone)]
pub struct ApiKey(String);

impl ApiKey {
    pub(super) fn is_sound(&self) -> bool {
        self.0.len() >= SHORTEST_KEY && self.0.bytes().all(|b| b.is_ascii_graphic())
    }

    /// Its hash: all that the server keeps.
    pub fn hash(&self) -> blake3::Hash {
        blake3::hash(self.0.as_bytes())
    }

    /// The secret itself, for a client to send.
    pub fn secret(&self) -> &str {
        &self.0
    }
}

impl From<&str> for ApiKey {
    fn from(secret: &str) -> ApiKey {
        ApiKey(secret.to_owned())
    }
}

impl fmt::Debug for ApiKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("ApiKey(…)")
    }
}

/// Reads the name of a host, without a port.
fn parse_host(text: &str) -> Result<String, String> {
    let host = text.parse::<axum::http::uri::Authority>().ok();
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_.:[]".contains(c);
    match host.filter(|host| host.host() == text && text.chars().all(plain)) {
        Some(_) => Ok(text.to_ascii_lowercase()),
        None => Err("expected a host's name or address without a port, as in snow.example".into()),
    }
}

/// Reads an origin as browsers send it: scheme and host, and a port where it is not the usual one.
fn parse_origin(text: &str) -> Result<HeaderValue, String> {
    let text = text.to_ascii_lowercase();
    let plain = text.parse::<Uri>().is_ok_and(|uri| {
        let (scheme, authority) = (uri.scheme_str(), uri.authority());
        scheme.zip(authority).is_some_and(|(s, a)| format!("{s}://{a}") == text)
    });
    let value = HeaderValue::from_str(&text).ok().filter(|_| plain && !text.contains('@'));
    value.ok_or_else(|| "expected a scheme and a host, as in https://game.example".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_api_key_is_long_fits_a_header_and_is_not_shown() {
        let config =
            |key: &str| AccessConfig { api_key: Some(key.into()), ..AccessConfig::default() };
        let sound = config("0123456789abcdef");
        assert!(sound.key().is_ok_and(|key| key.is_some()));
        assert!(!format!("{sound:?}").contains("0123"));
        for wrong in ["", "short", "0123456789abcde f", "0123456789abcdé"] {
            let error = config(wrong).key().unwrap_err();
            assert!(wrong.is_empty() || !error.contains(wrong), "{error}");
        }
    }

    #[test]
    fn hosts_have_no_port() {
        assert_eq!(parse_host("Snow.Example"), Ok("snow.example".to_owned()));
        assert_eq!(parse_host("[2001:db8::1]"), Ok("[2001:db8::1]".to_owned()));
        for wrong in ["", "snow.example:80", "http://snow.example", "a@b", "*", "a b"] {
            assert!(parse_host(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn origins_are_what_browsers_send() {
        let origin = parse_origin("HTTPS://game.example:8443").unwrap();
        assert_eq!(origin, "https://game.example:8443");
        for wrong in ["", "*", "null", "game.example", "https://game.example/", "https://a@b"] {
            assert!(parse_origin(wrong).is_err(), "{wrong}");
        }
    }
}
