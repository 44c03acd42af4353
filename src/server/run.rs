//! Serves until told to stop, then lets everything under way come to its end.

use std::io;
use std::net::SocketAddr;
use std::time::Duration;

use axum_server::tls_rustls::RustlsAcceptor;
use axum_server::{Handle, Server};
use tokio::net::TcpListener;
use tokio_util::sync::CancellationToken;
use tracing::{debug, warn};

use crate::http::App;
use crate::http::gate::{Door, Http1};

use super::router::router;

/// Longest head of a request, and what a connection reads and writes at a time \[bytes\].
const BUFFER: usize = 32 * 1024;

/// Time that streams get to say goodbye.
const FAREWELL: Duration = Duration::from_secs(5);

/// Serves requests until `shutdown` is cancelled; then accepts no more, finishes those under way,
/// ends streams and long steps, and returns.
///
/// # Errors
/// Where the listener fails.
pub async fn run(listener: TcpListener, app: App, shutdown: CancellationToken) -> io::Result<()> {
    let handle = Handle::new();
    // A client that takes its answer in too slowly can't keep the server from stopping.
    let patience = app.requests.request_timeout + FAREWELL;
    let stopping = {
        let (handle, draining) = (handle.clone(), app.draining.clone());
        async move {
            shutdown.cancelled().await;
            draining.cancel();
            handle.graceful_shutdown(Some(patience));
        }
    };
    let stopping = tokio::spawn(stopping);
    let served = serve(listener, &app, handle.clone()).await;
    stopping.abort();
    if handle.connection_count() > 0 {
        warn!("connections were still open after {} s; they are cut", patience.as_secs_f64());
    }
    app.draining.cancel();
    app.streams.close();
    if tokio::time::timeout(FAREWELL, app.streams.wait()).await.is_err() {
        warn!("streams were still open after {} s; they are cut", FAREWELL.as_secs());
    }
    served
}

async fn serve(listener: TcpListener, app: &App, handle: Handle<SocketAddr>) -> io::Result<()> {
    let limits = &app.gate.connections;
    let mut server = Server::<SocketAddr>::from_listener(listener)
        .handle(handle)
        .first_request_timeout(limits.header_timeout)
        .accept_error_handler(|peer, error| debug!(?peer, "connection refused: {error}"));
    let mut http = server.http_builder().http1();
    http.header_read_timeout(limits.header_timeout).max_buf_size(BUFFER);
    let door = Door::new(app);
    let service = router(app.clone()).into_make_service_with_connect_info::<SocketAddr>();
    match &app.gate.tls {
        None => server.acceptor(Http1(door)).serve(service).await,
        Some(tls) => {
            let handshake =
                RustlsAcceptor::new(tls.clone()).handshake_timeout(limits.header_timeout);
            server.acceptor(Http1(handshake.acceptor(door))).serve(service).await
        }
    }
}
