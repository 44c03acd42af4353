//! What every handler can reach.

use std::ops::Deref;
use std::sync::Arc;

use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use crate::config::{RequestConfig, StreamConfig};
use crate::metrics::Metrics;
use crate::render::Renderer;
use crate::session::{Idempotency, Sessions};

use super::gate::Gate;

/// State shared by all requests and streams. Clones are handles to the same; there are several
/// in each request.
#[derive(Clone, Debug)]
pub struct App(Arc<Shared>);

/// What an [`App`] leads to.
#[derive(Debug)]
pub struct Shared {
    /// Every session of the server.
    pub sessions: Sessions,
    /// What the server counts.
    pub metrics: Metrics,
    /// Limits of requests.
    pub requests: RequestConfig,
    /// Limits of streams.
    pub stream: StreamConfig,
    /// Who gets in.
    pub gate: Gate,
    /// Answers to requests that may be repeated.
    pub repeats: Idempotency,
    /// Draws pictures.
    pub renderer: Renderer,
    /// Cancelled when the server begins to stop: streams and long steps end then.
    pub draining: CancellationToken,
    /// The stream tasks that the server waits for when it stops.
    pub streams: TaskTracker,
}

impl App {
    /// The state of a server that is about to start.
    pub fn new(
        sessions: Sessions,
        requests: RequestConfig,
        stream: StreamConfig,
        gate: Gate,
    ) -> App {
        App(Arc::new(Shared {
            metrics: Metrics::new(&sessions),
            sessions,
            requests,
            stream,
            gate,
            repeats: Idempotency::default(),
            renderer: Renderer::default(),
            draining: CancellationToken::new(),
            streams: TaskTracker::new(),
        }))
    }
}

impl Deref for App {
    type Target = Shared;

    fn deref(&self) -> &Shared {
        &self.0
    }
}
