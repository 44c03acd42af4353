//! HTTP/1.1 alone. A connection with one request at a time is all that browsers and WebSockets need, and
//! what it may take is bounded; a proxy in front may speak HTTP/2.
//!
//! The library that serves connections speaks both where a client begins with HTTP/2 unasked, and can't be
//! told otherwise where upgrades to WebSockets are wanted.

use std::future::Future;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};

use axum_server::accept::Accept;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

/// What a connection begins with that is HTTP/2 (RFC 9113, section 3.4); no method of HTTP/1.1.
const PREFACE: &[u8] = b"PRI ";

/// Takes what another acceptor takes, but for HTTP/2.
#[derive(Clone, Debug)]
pub struct Http1<A>(pub A);

type Accepting<I, S> = Pin<Box<dyn Future<Output = io::Result<(I, S)>> + Send>>;

impl<A, I, S> Accept<I, S> for Http1<A>
where
    A: Accept<I, S>,
    A::Future: Send + 'static,
{
    type Stream = Opening<A::Stream>;
    type Service = A::Service;
    type Future = Accepting<Self::Stream, Self::Service>;

    fn accept(&self, stream: I, service: S) -> Self::Future {
        let accepted = self.0.accept(stream, service);
        Box::pin(async move {
            let (stream, service) = accepted.await?;
            Ok((Opening { stream, seen: 0 }, service))
        })
    }
}

/// A connection whose first bytes are looked at.
#[derive(Debug)]
pub struct Opening<S> {
    stream: S,
    /// How much of the preface it began with so far; all of it where it did not.
    seen: usize,
}

impl<S: AsyncRead + Unpin> AsyncRead for Opening<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        ready!(Pin::new(&mut self.stream).poll_read(context, buffer))?;
        if self.seen < PREFACE.len() {
            let read = &buffer.filled()[before..];
            let expected = &PREFACE[self.seen..];
            let alike = read.iter().zip(expected).take_while(|(read, preface)| read == preface);
            let alike = alike.count();
            if alike == expected.len() {
                buffer.set_filled(before);
                let why = "HTTP/2 is not spoken here";
                return Poll::Ready(Err(io::Error::new(io::ErrorKind::InvalidData, why)));
            }
            self.seen = if alike == read.len() { self.seen + alike } else { PREFACE.len() };
        }
        Poll::Ready(Ok(()))
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Opening<S> {
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

#[cfg(test)]
mod tests {
    use tokio::io::AsyncReadExt;

    use super::*;

    /// What is read of some pieces that arrive one after another.
    async fn read(pieces: &[&[u8]]) -> io::Result<Vec<u8>> {
        let nothing: Box<dyn AsyncRead + Unpin> = Box::new(tokio::io::empty());
        let stream = pieces
            .iter()
            .fold(nothing, |before, piece| Box::new(before.chain(io::Cursor::new(piece.to_vec()))));
        let mut all = Vec::new();
        Opening { stream, seen: 0 }.read_to_end(&mut all).await.map(|_| all)
    }

    #[tokio::test]
    async fn http_2_is_known_by_its_first_bytes_however_they_arrive() {
        for pieces in
            [&[&b"PRI * HTTP/2.0\r\n"[..]][..], &[b"P", b"R", b"I", b" *"], &[b"PRI", b" "]]
        {
            let error = read(pieces).await.unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::InvalidData, "{pieces:?}");
        }
        for pieces in
            [&[&b"GET / HTTP/1.1\r\n"[..]][..], &[b"P", b"OST PRI "], &[b"PR"], &[b"PRIX"]]
        {
            assert_eq!(read(pieces).await.unwrap(), pieces.concat());
        }
    }
}
