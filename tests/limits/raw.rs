//! Clients that don't behave: requests written by hand, answers that are not read.

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;

use crate::support::Server;
use crate::support::wait::PATIENCE;

pub async fn connect(server: &Server) -> TcpStream {
    TcpStream::connect(server.url.strip_prefix("http://").unwrap()).await.unwrap()
}

/// Sends a request's head on a connection of its own.
pub async fn ask(server: &Server, request: &str, headers: &str) -> TcpStream {
    let mut stream = connect(server).await;
    let head = format!("{request} HTTP/1.1\r\nhost: localhost\r\n{headers}\r\n");
    stream.write_all(head.as_bytes()).await.unwrap();
    stream
}

/// What the server says until it closes the connection.
pub async fn rest(stream: &mut TcpStream) -> String {
    let mut rest = Vec::new();
    // A reset ends it as well.
    let _ = timeout(PATIENCE, stream.read_to_end(&mut rest)).await.expect("it is closed");
    String::from_utf8_lossy(&rest).into_owned()
}

/// A figure of the server's metrics.
pub async fn metric(server: &Server, name: &str) -> u64 {
    let text = String::from_utf8(server.get("/metrics").await.body).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    line.unwrap_or_else(|| panic!("no {name}")).parse().unwrap()
}

/// How often a limit was reached.
pub async fn reached(server: &Server, limit: &str) -> u64 {
    metric(server, &format!("firn_limits_reached_total{{limit=\"{limit}\"}}")).await
}
