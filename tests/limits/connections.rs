//! Connections that hold their places.

use std::time::Duration;

use firn::config::{BackendChoice, ConnectionConfig};
use tokio::io::AsyncWriteExt;

use crate::raw::{ask, connect, reached, rest};
use crate::support::wait::until;
use crate::support::{Options, Server};

/// How a client begins that speaks HTTP/2 without asking, with its settings.
pub const PRIOR_KNOWLEDGE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0";

async fn server(connections: ConnectionConfig) -> Server {
    let options = Options { connections, ..Options::default() };
    Server::start_with(BackendChoice::Cpu, options).await
}

#[tokio::test(flavor = "multi_thread")]
async fn who_speaks_http_2_holds_no_place() {
    let server = server(ConnectionConfig {
        max_connections: 3,
        header_timeout: Duration::from_millis(300),
        ..ConnectionConfig::default()
    })
    .await;
    let mut held = Vec::new();
    for _ in 0..3 {
        let mut stream = connect(&server).await;
        stream.write_all(PRIOR_KNOWLEDGE).await.unwrap();
        held.push(stream);
    }
    for stream in &mut held {
        let said = rest(stream).await;
        assert!(said.is_empty() || said.starts_with("HTTP/1.1 400"), "{said:?}");
    }
    // They are still open on their side.
    server.get("/livez").await.expect(200);
    drop(held);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn who_takes_nothing_is_cut_off() {
    let server = server(ConnectionConfig {
        write_timeout: Duration::from_millis(200),
        ..ConnectionConfig::default()
    })
    .await;
    let grid = serde_json::json!({"width": 1024, "depth": 1024, "height": 1, "cell_size": 0.5});
    let path = server.create(serde_json::json!({"grid": grid, "paused": true})).await;
    // More than the sockets' buffers hold.
    let silent =
        ask(&server, &format!("GET {path}/heights"), "accept: application/x-npy\r\n").await;
    until("it is cut off", async || reached(&server, "write-timeout").await == 1).await;
    assert_eq!(server.app.answers.unsent.held(), 0);
    drop(silent);
    // Whoever takes it slowly, but takes it, gets it whole.
    let mut slow = ask(
        &server,
        &format!("GET {path}/heights"),
        "accept: application/x-npy\r\nconnection: close\r\n",
    )
    .await;
    let mut read = 0;
    let mut piece = vec![0; 512 * 1024];
    loop {
        tokio::time::sleep(Duration::from_millis(20)).await;
        match tokio::io::AsyncReadExt::read(&mut slow, &mut piece).await.unwrap() {
            0 => break,
            bytes => read += bytes,
        }
    }
    assert!(read > 4 << 20, "{read} bytes");
    assert_eq!(reached(&server, "write-timeout").await, 1);
    server.stop().await;
}
