//! Connections: how many there may be, and what each is wrapped in.

use std::future::{Ready, ready};
use std::io;
use std::path::Path;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum_server::accept::{Accept, LocalAddrAcceptor, LocalAddrService};
use axum_server::tls_rustls::RustlsConfig;
use prometheus_client::metrics::gauge::Gauge;
use rustls::ServerConfig;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep, sleep};
use tower_http::add_extension::AddExtension;

use crate::budget::Budget;
use crate::config::ConnectionConfig;
use crate::http::App;
use crate::limit::Limit;
use crate::metrics::LimitMetrics;

use super::unfinished::Unfinished;

/// Takes connections while there is room for them.
#[derive(Clone, Debug)]
pub struct Door {
    room: Arc<Semaphore>,
    write_timeout: Duration,
    bodies: Budget,
    open: Gauge,
    limits: LimitMetrics,
}

impl Door {
    /// The door of a server.
    pub fn new(app: &App) -> Door {
        let config = &app.gate.connections;
        let most = config.max_connections.min(Semaphore::MAX_PERMITS);
        Door {
            room: Arc::new(Semaphore::new(most)),
            write_timeout: config.write_timeout,
            bodies: app.bodies.clone(),
            open: app.metrics.connections.clone(),
            limits: app.metrics.limits.clone(),
        }
    }
}

impl<S> Accept<TcpStream, S> for Door {
    type Stream = Connection<TcpStream>;
    type Service = AddExtension<LocalAddrService<S>, Arc<Unfinished>>;
    type Future = Ready<io::Result<(Self::Stream, Self::Service)>>;

    fn accept(&self, stream: TcpStream, service: S) -> Self::Future {
        let Ok(place) = self.room.clone().try_acquire_owned() else {
            self.limits.reached(Limit::MaxConnections);
            return ready(Err(io::Error::other("there are --max-connections already")));
        };
        // Small messages go out at once.
        let accepted = stream.set_nodelay(true).and_then(|()| {
            let (stream, service) = LocalAddrAcceptor.accept(stream, service).into_inner()?;
            let unfinished = Arc::new(Unfinished::new(self.bodies.clone(), self.limits.clone()));
            let service = AddExtension::new(service, unfinished.clone());
            Ok((Connection::new(stream, place, unfinished, self), service))
        });
        ready(accepted)
    }
}

/// A connection that holds its place until it is closed, as a WebSocket too, and is closed where its
/// client takes nothing of what it is sent.
#[derive(Debug)]
pub struct Connection<S> {
    stream: S,
    _place: OwnedSemaphorePermit,
    unfinished: Arc<Unfinished>,
    write_timeout: Duration,
    /// Ends when the client has taken nothing for too long, while something waits for it.
    stall: Pin<Box<Sleep>>,
    stalled: bool,
    open: Gauge,
    limits: LimitMetrics,
}

impl<S> Connection<S> {
    fn new(
        stream: S,
        place: OwnedSemaphorePermit,
        unfinished: Arc<Unfinished>,
        door: &Door,
    ) -> Connection<S> {
        let Door { write_timeout, open, limits, .. } = door.clone();
        open.inc();
        let stall = Box::pin(sleep(write_timeout));
        let stalled = false;
        Connection {
            stream,
            _place: place,
            unfinished,
            write_timeout,
            stall,
            stalled,
            open,
            limits,
        }
    }

    /// What became of a write; an error where none has gone on for too long.
    fn watch<T>(
        &mut self,
        context: &mut Context<'_>,
        written: Poll<io::Result<T>>,
    ) -> Poll<io::Result<T>> {
        if written.is_ready() {
            self.stalled = false;
            return written;
        }
        if !self.stalled {
            self.stalled = true;
            self.stall.as_mut().reset(Instant::now() + self.write_timeout);
        }
        ready!(self.stall.as_mut().poll(context));
        self.limits.reached(Limit::WriteTimeout);
        let why = "the client has taken nothing of what it was sent for --write-timeout";
        Poll::Ready(Err(io::Error::new(io::ErrorKind::TimedOut, why)))
    }
}

impl<S> Drop for Connection<S> {
    fn drop(&mut self) {
        self.open.dec();
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Connection<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        ready!(Pin::new(&mut self.stream).poll_read(context, buffer))?;
        Poll::Ready(self.unfinished.add(buffer.filled().len() - before))
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Connection<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.watch(context, written)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let flushed = Pin::new(&mut self.stream).poll_flush(context);
        self.watch(context, flushed)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        parts: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write_vectored(context, parts);
        self.watch(context, written)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}

/// The certificate and key that a configuration names; nothing where it names none.
///
/// # Errors
/// Where a file can't be read, or the two don't belong together.
pub fn tls(config: &ConnectionConfig) -> Result<Option<RustlsConfig>, String> {
    let (Some(cert), Some(key)) = (&config.tls_cert, &config.tls_key) else { return Ok(None) };
    let named = |flag: &str, file: &Path, error: &dyn std::fmt::Display| {
        let what = if flag == "--tls-key" { "a private key" } else { "a certificate chain" };
        format!("{flag} {}: {error}; expected a PEM file with {what}", file.display())
    };
    let chain = CertificateDer::pem_file_iter(cert)
        .and_then(Iterator::collect::<Result<Vec<_>, _>>)
        .map_err(|error| named("--tls-cert", cert, &error))?;
    if chain.is_empty() {
        return Err(named("--tls-cert", cert, &"it holds none"));
    }
    let secret =
        PrivateKeyDer::from_pem_file(key).map_err(|error| named("--tls-key", key, &error))?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let mut tls = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, secret))
        .map_err(|error| named("--tls-cert", cert, &error))?;
    // A WebSocket begins as HTTP/1.1.
    tls.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(Some(RustlsConfig::from_config(Arc::new(tls))))
}
