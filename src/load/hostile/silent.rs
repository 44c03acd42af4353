//! Requests that are not sent to their end, and answers that are not read.

use std::io::ErrorKind;
use std::time::Duration;

use firn_client::Client;
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;
use tokio_util::sync::CancellationToken;

use crate::load::Plan;

/// Bytes that are sent at a time.
const PIECE: usize = 64 << 10;

/// Time in which an answer is seen that has arrived.
const LOOK: Duration = Duration::from_millis(100);

/// A request that is written by hand.
#[derive(Clone, Debug)]
pub struct Request {
    pub method: &'static str,
    pub path: String,
    /// Bytes of the body that is announced. The last of them is not sent.
    pub body: usize,
}

/// Sends a request and does nothing more until the end. Returns the status that had been answered by then,
/// or what happened instead.
pub async fn send(
    client: &Client,
    plan: &Plan,
    request: &Request,
    end: &CancellationToken,
) -> String {
    let mut stream = match TcpStream::connect(client.address()).await {
        Ok(stream) => stream,
        Err(error) => return format!("not connected: {}", error.kind()),
    };
    tokio::select! {
        biased;
        () = end.cancelled() => {}
        // Where it is cut, the server has said why, or closed.
        _ = write(&mut stream, client, plan, request) => end.cancelled().await,
    }
    answered(&stream).await
}

async fn write(
    stream: &mut TcpStream,
    client: &Client,
    plan: &Plan,
    request: &Request,
) -> std::io::Result<()> {
    let (host, below) = (client.address(), client.base_path());
    let Request { method, path, body } = request;
    let mut head = format!("{method} {below}{path} HTTP/1.1\r\nhost: {host}\r\n");
    if let Some(key) = &plan.api_key {
        head += &format!("authorization: Bearer {}\r\n", key.secret());
    }
    if *body > 0 {
        head += &format!("content-type: application/json\r\ncontent-length: {body}\r\n");
    }
    stream.write_all(format!("{head}\r\n").as_bytes()).await?;
    let piece = [b' '; PIECE];
    let mut left = body.saturating_sub(1);
    while left > 0 {
        let next = left.min(PIECE);
        stream.write_all(&piece[..next]).await?;
        left -= next;
    }
    Ok(())
}

/// The status of an answer, of which only the beginning is read.
async fn answered(stream: &TcpStream) -> String {
    // What is there already is seen at once; nothing is waited for.
    let _ = tokio::time::timeout(LOOK, stream.readable()).await;
    let mut head = [0; "HTTP/1.1 200".len()];
    match stream.try_read(&mut head) {
        Ok(count) if count == head.len() => {
            String::from_utf8_lossy(&head).rsplit(' ').next().unwrap_or_default().to_owned()
        }
        Err(error) if error.kind() == ErrorKind::WouldBlock => "under way".to_owned(),
        _ => "closed".to_owned(),
    }
}
