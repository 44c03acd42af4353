//! What the server counts and measures, for Prometheus. `docs/operations.md` says what to do about
//! each figure.

mod engine;
mod requests;

use std::fmt;
use std::sync::Arc;

use prometheus_client::registry::Registry;

use crate::session::Sessions;
use crate::stream::StreamMetrics;

pub use requests::{Request, RequestMetrics};

/// The media type of [`Metrics::encode`].
pub const MEDIA_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Everything that one server counts. Clones are handles to the same.
#[derive(Clone, Debug)]
pub struct Metrics {
    registry: Arc<Registry>,
    /// Requests that were answered.
    pub requests: RequestMetrics,
    /// Streams that are open, and how they ended.
    pub streams: StreamMetrics,
}

impl Metrics {
    /// The metrics of a server that is about to start, with those of its sessions' engine.
    pub fn new(sessions: &Sessions) -> Metrics {
        let mut registry = Registry::with_prefix("firn");
        registry.register_collector(Box::new(engine::EngineCollector(sessions.clone())));
        let requests = RequestMetrics::register(&mut registry);
        let streams = StreamMetrics::register(&mut registry);
        Metrics { registry: Arc::new(registry), requests, streams }
    }

    /// All of them in the OpenMetrics text format.
    ///
    /// # Errors
    /// Where a collector fails to write, which none of ours does.
    pub fn encode(&self) -> Result<String, fmt::Error> {
        let mut text = String::new();
        prometheus_client::encoding::text::encode(&mut text, &self.registry)?;
        Ok(text)
    }
}
