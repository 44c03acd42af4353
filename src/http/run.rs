//! Serves until told to stop, then lets everything under way come to its end.

use std::io;
use std::time::Duration;

use axum::serve::ListenerExt;
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tracing::{debug, warn};

use super::router::router;
use super::state::App;

/// Time that streams get to say goodbye.
const FAREWELL: Duration = Duration::from_secs(5);

/// Serves requests until `shutdown` is cancelled; then accepts no more, finishes those under way,
/// ends streams and long steps, and returns.
///
/// # Errors
/// Where the listener fails.
pub async fn run(listener: TcpListener, app: App, shutdown: CancellationToken) -> io::Result<()> {
    let listener = listener.tap_io(|stream| {
        // Small messages go out at once.
        if let Err(failure) = stream.set_nodelay(true) {
            debug!("no TCP_NODELAY: {failure}");
        }
    });
    let draining = app.draining.clone();
    let signal = {
        let (shutdown, draining) = (shutdown.clone(), draining.clone());
        async move {
            shutdown.cancelled().await;
            draining.cancel();
        }
    };
    let serving = axum::serve(listener, router(app.clone())).with_graceful_shutdown(signal);
    // A client that takes its answer in too slowly can't keep the server from stopping.
    let patience = app.requests.request_timeout + FAREWELL;
    let deadline = async {
        shutdown.cancelled().await;
        tokio::time::sleep(patience).await;
    };
    let served = tokio::select! {
        served = serving => served,
        () = deadline => {
            warn!("connections were still open after {} s; they are cut", patience.as_secs_f64());
            Ok(())
        }
    };
    draining.cancel();
    app.streams.close();
    if tokio::time::timeout(FAREWELL, app.streams.wait()).await.is_err() {
        warn!("streams were still open after {} s; they are cut", FAREWELL.as_secs());
    }
    served
}
