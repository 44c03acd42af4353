//! What every handler can reach.

use std::io;
use std::ops::Deref;
use std::sync::Arc;

use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use crate::budget::Budget;
use crate::config::{RequestConfig, StreamConfig};
use crate::metrics::Metrics;
use crate::render::Renderer;
use crate::session::Sessions;

use super::answers::Answers;
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
    /// Memory of bodies that are arriving.
    pub bodies: Budget,
    /// What large answers take.
    pub answers: Answers,
    /// Draws pictures.
    pub renderer: Renderer,
    /// Cancelled when the server begins to stop: streams and long steps end then.
    pub draining: CancellationToken,
    /// The stream tasks that the server waits for when it stops.
    pub streams: TaskTracker,
}

impl App {
    /// The state of a server that is about to start.
    ///
    /// # Errors
    /// Where the operating system refuses threads.
    pub fn new(
        sessions: Sessions,
        requests: RequestConfig,
        stream: StreamConfig,
        gate: Gate,
    ) -> io::Result<App> {
        sessions.tenants().set_quotas(&gate.access.keys().quotas());
        let bodies = Budget::new(requests.max_bodies);
        let answers = Answers::new(requests.max_unsent, requests.request_timeout / 2)?;
        Ok(App(Arc::new(Shared {
            metrics: Metrics::new(&sessions, &bodies, &answers.unsent),
            sessions,
            requests,
            stream,
            gate,
            bodies,
            answers,
            renderer: Renderer::default(),
            draining: CancellationToken::new(),
            streams: TaskTracker::new(),
        })))
    }
}

impl Deref for App {
    type Target = Shared;

    fn deref(&self) -> &Shared {
        &self.0
    }
}
