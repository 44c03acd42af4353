//! Connections: how many there may be, and what each is wrapped in.

use std::future::{Ready, ready};
use std::io;
use std::path::Path;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use axum_server::accept::{Accept, LocalAddrAcceptor, LocalAddrService};
use axum_server::tls_rustls::RustlsConfig;
use rustls::ServerConfig;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::config::ConnectionConfig;

/// Takes connections while there is room for them.
#[derive(Clone, Debug)]
pub struct Door {
    room: Arc<Semaphore>,
}

impl Door {
    /// Room for a number of connections.
    pub fn new(most: usize) -> Door {
        Door { room: Arc::new(Semaphore::new(most.min(Semaphore::MAX_PERMITS))) }
    }
}

impl<S> Accept<TcpStream, S> for Door {
    type Stream = Counted<TcpStream>;
    type Service = LocalAddrService<S>;
    type Future = Ready<io::Result<(Self::Stream, Self::Service)>>;

    fn accept(&self, stream: TcpStream, service: S) -> Self::Future {
        let Ok(place) = self.room.clone().try_acquire_owned() else {
            return ready(Err(io::Error::other("there are --max-connections already")));
        };
        // Small messages go out at once.
        let accepted = stream.set_nodelay(true).and_then(|()| {
            let (stream, service) = LocalAddrAcceptor.accept(stream, service).into_inner()?;
            Ok((Counted { stream, _place: place }, service))
        });
        ready(accepted)
    }
}

/// A connection that holds its place until it is closed, as a WebSocket too.
#[derive(Debug)]
pub struct Counted<S> {
    stream: S,
    _place: OwnedSemaphorePermit,
}

impl<S: AsyncRead + Unpin> AsyncRead for Counted<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Counted<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        parts: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write_vectored(context, parts)
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
