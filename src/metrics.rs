//! What the server counts and measures, for Prometheus. `docs/operations.md` says what to do about
//! each figure.

mod engine;
mod gate;
mod limits;
mod memory;
mod requests;
mod streams;
mod tenants;

use std::fmt;
use std::sync::Arc;

use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::Registry;

use crate::budget::Budget;
use crate::session::Sessions;

pub use gate::{AuthFailure, GateMetrics, Reload};
pub use limits::LimitMetrics;
pub use requests::{Request, RequestMetrics};
pub use streams::{Carried, StreamMetrics};

/// The media type of [`Metrics::encode`].
pub const MEDIA_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Everything that one server counts. Clones are handles to the same.
#[derive(Clone, Debug)]
pub struct Metrics {
    registry: Arc<Registry>,
    /// Callers who were not let in, and what was read again.
    pub gate: GateMetrics,
    /// Requests that were answered.
    pub requests: RequestMetrics,
    /// Connections that are open.
    pub connections: Gauge,
    /// How often limits were reached.
    pub limits: LimitMetrics,
    /// Streams that are open, and how they ended.
    pub streams: StreamMetrics,
}

impl Metrics {
    /// The metrics of a server that is about to start, with those of its sessions' engine, and of the
    /// memory of bodies and answers.
    pub fn new(sessions: &Sessions, bodies: &Budget, unsent: &Budget) -> Metrics {
        let mut registry = Registry::with_prefix("firn");
        registry.register_collector(Box::new(engine::EngineCollector(sessions.clone())));
        let memory = memory::MemoryCollector {
            bodies: bodies.clone(),
            unsent: unsent.clone(),
            keyed: sessions.keyed().clone(),
        };
        registry.register_collector(Box::new(memory));
        let gate = GateMetrics::register(&mut registry);
        let requests = RequestMetrics::register(&mut registry);
        let connections = Gauge::default();
        registry.register("connections", "Connections that are open", connections.clone());
        let limits = LimitMetrics::register(&mut registry);
        let streams = StreamMetrics::register(&mut registry);
        Metrics { registry: Arc::new(registry), gate, requests, connections, limits, streams }
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
