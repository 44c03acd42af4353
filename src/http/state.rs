//! What every handler can reach.

use std::sync::Arc;

use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use crate::config::{RequestConfig, StreamConfig};
use crate::render::Renderer;
use crate::session::Sessions;
use crate::stream::Endings;

/// State shared by all requests and streams. Clones are handles to the same.
#[derive(Clone, Debug)]
pub struct App {
    /// Every session of the server.
    pub sessions: Sessions,
    /// Limits of requests.
    pub requests: RequestConfig,
    /// Limits of streams.
    pub stream: StreamConfig,
    /// How many streams have ended, and why.
    pub endings: Arc<Endings>,
    /// Draws pictures.
    pub renderer: Renderer,
    /// Cancelled when the server begins to stop: streams and long steps end then.
    pub draining: CancellationToken,
    /// The stream tasks that the server waits for when it stops.
    pub streams: TaskTracker,
}

impl App {
    /// The state of a server that is about to start, with the usual limits of streams.
    pub fn new(sessions: Sessions, requests: RequestConfig) -> App {
        App {
            sessions,
            requests,
            stream: StreamConfig::default(),
            endings: Arc::default(),
            renderer: Renderer::default(),
            draining: CancellationToken::new(),
            streams: TaskTracker::new(),
        }
    }
}
