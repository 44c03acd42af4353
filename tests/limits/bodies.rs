//! Bodies and messages that arrive slowly, in part, or not at all.

use std::time::Duration;

use firn::config::{BackendChoice, RequestConfig, StreamConfig};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::raw::{ask, connect, reached, rest};
use crate::support::wait::{PATIENCE, until};
use crate::support::{Options, Server, small};

/// Memory for bodies.
const BUDGET: u64 = 4 << 20;

async fn server(request_timeout: Duration) -> Server {
    let requests = RequestConfig {
        max_body_bytes: 2 << 20,
        max_bodies: BUDGET,
        request_timeout,
        ..RequestConfig::default()
    };
    Server::start_with(BackendChoice::Cpu, Options { requests, ..Options::default() }).await
}

/// Sends halves one after another, each once the server has refused the one before or holds so many bytes of it. Those
/// that come at a time share the room between them, and then timing decides how many are refused.
async fn one_by_one(
    server: &Server,
    count: u64,
    bytes: u64,
    send: impl AsyncFn() -> TcpStream,
) -> Vec<TcpStream> {
    let mut sent = Vec::new();
    for number in 1..=count {
        sent.push(send().await);
        let taken = async || {
            let refused = reached(server, "max-bodies").await;
            server.app.bodies.held() >= (number - refused) * bytes
        };
        until("it is held or refused", taken).await;
    }
    sent
}

#[tokio::test(flavor = "multi_thread")]
async fn every_body_has_to_arrive_in_time() {
    let server = server(Duration::from_millis(200)).await;
    let path = server.create(small()).await;
    let routes = ["step", "snowfalls", "reset", "tokens", "colliders:batch", "probes", "samples"];
    for call in
        routes.map(|route| format!("{path}/{route}")).into_iter().chain(["/v1/sessions".into()])
    {
        let headers = "content-type: application/json\r\ncontent-length: 1000\r\n\
                       connection: close\r\n";
        let mut stream = ask(&server, &format!("POST {call}"), headers).await;
        stream.write_all(b"{").await.unwrap();
        let said = rest(&mut stream).await;
        assert!(
            said.starts_with("HTTP/1.1 503") && said.contains("did not arrive"),
            "{call}: {said}"
        );
    }
    assert_eq!(reached(&server, "request-timeout").await, 8);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn half_sent_bodies_stay_within_their_budget() {
    let server = server(Duration::from_secs(60)).await;
    let path = server.create(small()).await;
    let half = one_by_one(&server, 8, 975_000, async || {
        let headers = "content-type: application/json\r\ncontent-length: 2000000\r\n";
        let mut stream = ask(&server, &format!("POST {path}/snowfalls"), headers).await;
        // Those that find no room are closed.
        let _ = stream.write_all(&vec![b' '; 1_000_000]).await;
        stream
    })
    .await;
    assert_eq!(reached(&server, "max-bodies").await, 4);
    assert!(server.app.bodies.held() >= 3_900_000, "{}", server.app.bodies.held());
    // Small ones need no room.
    server.post(&format!("{path}/snowfalls"), serde_json::json!({"depth": 0.1})).await.expect(200);
    drop(half);
    until("it is given back", async || server.app.bodies.held() == 0).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_that_is_too_long_is_refused_before_it_is_sent() {
    let server = server(Duration::from_secs(60)).await;
    let step = format!("{}/step", server.create(serde_json::json!({"paused": true})).await);
    for call in ["/v1/sessions", &step] {
        let headers = "content-type: application/json\r\ncontent-length: 99000000000\r\n\
                       expect: 100-continue\r\nconnection: close\r\n";
        let mut stream = ask(&server, &format!("POST {call}"), headers).await;
        let said = rest(&mut stream).await;
        assert!(said.starts_with("HTTP/1.1 413"), "{said}");
    }
    // Who does not say how long it is, is stopped where it gets too long.
    let headers = "content-type: application/json\r\ntransfer-encoding: chunked\r\n";
    let mut stream = ask(&server, "POST /v1/sessions", headers).await;
    let piece = [b"100000\r\n", &vec![b' '; 1 << 20][..], b"\r\n"].concat();
    for _ in 0..3 {
        let _ = stream.write_all(&piece).await;
    }
    assert!(rest(&mut stream).await.starts_with("HTTP/1.1 413"));
    assert_eq!(reached(&server, "max-body-bytes").await, 3);
    assert_eq!(server.app.bodies.held(), 0);
    server.stop().await;
}

/// Opens a stream, as a browser does, and sends so many bytes of one frame that has a MiB once the
/// server has said something.
async fn half_a_message(server: &Server, path: &str, says: &[u8], bytes: usize) -> TcpStream {
    let mut stream = connect(server).await;
    let head = format!(
        "GET {path}/stream HTTP/1.1\r\nhost: localhost\r\norigin: http://localhost\r\n\
         connection: upgrade\r\nupgrade: websocket\r\nsec-websocket-version: 13\r\n\
         sec-websocket-key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    let mut said = Vec::new();
    while !said.windows(says.len()).any(|seen| seen == says) {
        assert_ne!(stream.read_buf(&mut said).await.unwrap(), 0, "{}", said.escape_ascii());
    }
    let mut frame = vec![0x81, 0xff];
    frame.extend(1_000_000u64.to_be_bytes());
    frame.extend([0; 4]);
    frame.extend(vec![b' '; bytes]);
    let _ = stream.write_all(&frame).await;
    stream
}

#[tokio::test(flavor = "multi_thread")]
async fn unfinished_messages_stay_within_the_budget_of_bodies() {
    let server = server(Duration::from_secs(60)).await;
    let path = server.create(small()).await;
    let send = async || half_a_message(&server, &path, b"welcome", 900_000).await;
    let mut half = one_by_one(&server, 7, 875_000, send).await;
    assert_eq!(reached(&server, "max-bodies").await, 3);
    let held = server.app.bodies.held();
    assert!(held >= 3_500_000, "{held}");
    // One that ends gives its memory back.
    half[0].write_all(&vec![b' '; 100_000]).await.unwrap();
    until("it is whole", async || server.app.bodies.held() < 3_500_000).await;
    drop(half);
    until("it is given back", async || server.app.bodies.held() == 0).await;
    server.stop().await;
}

/// A browser's stream that is only opened to be closed holds no more than any other.
#[tokio::test(flavor = "multi_thread")]
async fn unfinished_messages_on_refused_streams_are_counted_too() {
    let requests = RequestConfig { max_bodies: BUDGET, ..RequestConfig::default() };
    // They are not cut off before they are looked at.
    let stream = StreamConfig { stream_farewell: PATIENCE, ..StreamConfig::default() };
    let options = Options { requests, stream, ..Options::default() };
    let server = Server::start_with(BackendChoice::Cpu, options).await;
    let unknown = 3501u16.to_be_bytes();
    let send = async || half_a_message(&server, "/v1/sessions/nobody", &unknown, 900_000).await;
    let mut half = one_by_one(&server, 7, 875_000, send).await;
    assert_eq!(reached(&server, "max-bodies").await, 3);
    // One that ends gives its memory back.
    half[0].write_all(&vec![b' '; 100_000]).await.unwrap();
    until("it is whole", async || server.app.bodies.held() < 3_500_000).await;
    drop(half);
    until("it is given back", async || server.app.bodies.held() == 0).await;
    server.stop().await;
}
