//! What every handler can reach.

use std::sync::Arc;

use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use crate::config::{RequestConfig, StreamConfig};
use crate::session::{Idempotency, Sessions};
use crate::stream::Endings;

use super::gate::Gate;

/// State shared by all requests and streams. Clones are handles to the same.
#[derive(Clone, Debug)]
pub struct App {
    /// Every session of the server.
    pub sessions: Sessions,
    /// Limits of requests.
    pub requests: RequestConfig,
    /// Limits of streams.
    pub stream: StreamConfig,
    /// Who gets in.
    pub gate: Arc<Gate>,
    /// Answers to requests that may be repeated.
    pub repeats: Arc<Idempotency>,
    /// How many streams have ended, and why.
    pub endings: Arc<Endings>,
    /// Cancelled when the server begins to stop: streams and long steps end then.
    pub draining: CancellationToken,
    /// The stream tasks that the server waits for when it stops.
    pub streams: TaskTracker,
}

impl App {
    /// The state of a server that is about to start: an open one, with the usual limits of streams
    /// and connections.
    pub fn new(sessions: Sessions, requests: RequestConfig) -> App {
        App {
            sessions,
            requests,
            stream: StreamConfig::default(),
            gate: Arc::default(),
            repeats: Arc::default(),
            endings: Arc::default(),
            draining: CancellationToken::new(),
            streams: TaskTracker::new(),
        }
    }
}
