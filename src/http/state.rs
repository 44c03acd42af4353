//! What every handler can reach.

use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use crate::config::{RequestConfig, StreamConfig};
use crate::metrics::Metrics;
use crate::session::Sessions;

/// State shared by all requests and streams. Clones are handles to the same.
#[derive(Clone, Debug)]
pub struct App {
    /// Every session of the server.
    pub sessions: Sessions,
    /// Limits of requests.
    pub requests: RequestConfig,
    /// Limits of streams.
    pub stream: StreamConfig,
    /// What the server counts.
    pub metrics: Metrics,
    /// Cancelled when the server begins to stop: streams and long steps end then.
    pub draining: CancellationToken,
    /// The stream tasks that the server waits for when it stops.
    pub streams: TaskTracker,
}

impl App {
    /// The state of a server that is about to start, with the usual limits of streams.
    pub fn new(sessions: Sessions, requests: RequestConfig) -> App {
        App {
            metrics: Metrics::new(&sessions),
            sessions,
            requests,
            stream: StreamConfig::default(),
            draining: CancellationToken::new(),
            streams: TaskTracker::new(),
        }
    }
}
