//! What the server says about its work: the log, and traces.

use axum::http::uri::{Scheme, Uri};
use clap::{Args, ValueEnum};

/// What is logged where nothing says otherwise.
const USUAL: &str = "info,wgpu_core=warn,wgpu_hal=error,naga=warn";

/// What the server says about its work.
#[derive(Args, Clone, Debug, Default)]
pub struct LogConfig {
    /// What is logged to standard error: a level, or levels for parts, as in `info,firn=debug`.
    /// Where it is not given `RUST_LOG` says it, and else all that is worth knowing.
    #[arg(long, env = "FIRN_LOG", value_name = "FILTER")]
    pub log: Option<String>,

    /// How it is written.
    #[arg(long, env = "FIRN_LOG_FORMAT", default_value = "text", value_name = "FORMAT")]
    pub log_format: LogFormat,

    /// Collector that traces of requests are sent to, by OpenTelemetry's protocol over HTTP, as in
    /// `http://127.0.0.1:4318`; without one there are no traces.
    #[arg(long, env = "FIRN_OTLP_ENDPOINT", value_parser = parse_endpoint, value_name = "URL")]
    pub otlp_endpoint: Option<String>,
}

/// How the log is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// Lines for people.
    #[default]
    Text,
    /// A JSON object on each line.
    Json,
}

impl LogConfig {
    /// What is logged, and what says so.
    pub fn filter(&self) -> (String, &'static str) {
        let general = || std::env::var("RUST_LOG").ok().filter(|filter| !filter.is_empty());
        match (&self.log, general) {
            (Some(filter), _) => (filter.clone(), "--log"),
            (None, general) => match general() {
                Some(filter) => (filter, "RUST_LOG"),
                None => (USUAL.to_owned(), "--log"),
            },
        }
    }
}

/// Reads the base address of a collector.
fn parse_endpoint(text: &str) -> Result<String, String> {
    let uri = text.parse::<Uri>().ok();
    let plain = uri.filter(|uri| {
        let host = uri.authority().is_some_and(|host| !host.as_str().contains('@'));
        uri.scheme() == Some(&Scheme::HTTP) && host && uri.query().is_none()
    });
    match plain {
        Some(_) => Ok(text.trim_end_matches('/').to_owned()),
        None => {
            Err("expected the address of a collector without TLS, as in http://127.0.0.1:4318; \
                     a collector beside the server can send on with TLS"
                .to_owned())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn collectors_are_reached_without_tls() {
        assert_eq!(parse_endpoint("http://[::1]:4318/"), Ok("http://[::1]:4318".to_owned()));
        assert_eq!(parse_endpoint("http://tempo/otlp"), Ok("http://tempo/otlp".to_owned()));
        for wrong in ["", "127.0.0.1:4318", "https://tempo", "http://a:b@tempo", "http://tempo/?x"]
        {
            assert!(parse_endpoint(wrong).is_err(), "{wrong}");
        }
    }
}
