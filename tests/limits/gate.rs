//! What one client, one connection and one token may take, and TLS.

use std::io;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use firn::config::{AccessConfig, ApiKey, BackendChoice, ConnectionConfig};
use futures_util::StreamExt;
use rcgen::CertifiedKey;
use reqwest::Method;
use rustls::pki_types::{CertificateDer, ServerName};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;

use crate::connections::PRIOR_KNOWLEDGE;
use crate::support::wait::{PATIENCE, until};
use crate::support::{Options, Server, small};

const KEY: &str = "a-key-that-nobody-can-guess";

async fn limited(connections: ConnectionConfig) -> Server {
    let options = Options { connections, ..Options::default() };
    Server::start_with(BackendChoice::Cpu, options).await
}

async fn connect(server: &Server) -> TcpStream {
    TcpStream::connect(server.url.split_once("://").unwrap().1).await.unwrap()
}

/// Asks for `/livez` on an open connection, and waits for the answer.
async fn lives(stream: &mut TcpStream) -> bool {
    let asked = stream.write_all(b"GET /livez HTTP/1.1\r\nhost: localhost\r\n\r\n").await;
    let mut answer = Vec::new();
    let read = async {
        while !answer.ends_with(b"}") && stream.read_buf(&mut answer).await.unwrap_or(0) > 0 {}
    };
    timeout(PATIENCE, read).await.expect("it ends");
    asked.is_ok() && answer.starts_with(b"HTTP/1.1 200") && answer.ends_with(b"}")
}

/// Waits until the other side closes; returns what it said before.
async fn rest(stream: &mut TcpStream) -> Vec<u8> {
    let mut rest = Vec::new();
    let read = timeout(PATIENCE, stream.read_to_end(&mut rest)).await.expect("it is closed");
    // A reset ends it as well.
    let _ = read;
    rest
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_is_good_for_so_many_requests_a_second() {
    let access = AccessConfig {
        api_key: Some(ApiKey::from(KEY)),
        requests_per_second: NonZeroU32::new(3).unwrap(),
        ..AccessConfig::default()
    };
    let options = Options { access, ..Options::default() };
    let server = Server::start_with(BackendChoice::Cpu, options).await;
    let created = server.send_as(KEY, Method::POST, "/v1/sessions", &small()).await.expect(201);
    let path = format!("/v1/sessions/{}", created["id"].as_str().unwrap());
    let mut refused = None;
    for _ in 0..1000 {
        let reply = server.send_as(KEY, Method::GET, &path, &Value::Null).await;
        if reply.status == 429 {
            refused = Some(reply);
            break;
        }
    }
    let refused = refused.expect("a thousand requests are more than 3 a second");
    refused.problem(429);
    assert_eq!(refused.header("retry-after"), "1");
    // Another token has a rate of its own, and strangers use up nobody's.
    let other = created["token"].as_str().unwrap();
    server.send_as(other, Method::GET, &path, &Value::Null).await.expect(200);
    server.send_as("nonsense", Method::GET, &path, &Value::Null).await.problem(401);
    // It comes back.
    until("the token is let in again", async || {
        server.send_as(KEY, Method::GET, &path, &Value::Null).await.status != 429
    })
    .await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn there_is_room_for_so_many_connections() {
    let config = ConnectionConfig { max_connections: 3, ..ConnectionConfig::default() };
    let server = limited(config).await;
    let mut held = Vec::new();
    for _ in 0..3 {
        let mut stream = connect(&server).await;
        assert!(lives(&mut stream).await);
        held.push(stream);
    }
    let mut fourth = connect(&server).await;
    assert_eq!(rest(&mut fourth).await, b"", "it is closed without an answer");
    // Those that are there still work, and one that ends makes room.
    assert!(lives(&mut held[0]).await);
    drop(held.pop());
    until("the place is given back", async || lives(&mut connect(&server).await).await).await;
    drop(held);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_head_that_does_not_arrive_ends_the_connection() {
    let header_timeout = Duration::from_millis(200);
    let config = ConnectionConfig { header_timeout, ..ConnectionConfig::default() };
    let server = limited(config).await;
    // Nothing at all, a first head in part, a second head in part, and nothing after an answer.
    for (first, second) in
        [(None, ""), (None, "GET /livez HT"), (Some(()), "GET /l"), (Some(()), "")]
    {
        let mut stream = connect(&server).await;
        if first.is_some() {
            assert!(lives(&mut stream).await);
        }
        stream.write_all(second.as_bytes()).await.unwrap();
        let said = String::from_utf8(rest(&mut stream).await).unwrap();
        assert!(!said.contains("HTTP/1.1 200"), "{said}");
    }
    // A stream has no head any more: nothing happens when the time for one is over.
    let path = server.create(small()).await;
    let url = format!("{}{path}/stream", server.url.replace("http", "ws"));
    let (mut stream, _) = tokio_tungstenite::connect_async(url).await.unwrap();
    tokio::time::sleep(3 * header_timeout).await;
    server.post(&format!("{path}/snowfalls"), json!({"depth": 0.1})).await.expect(200);
    for expected in ["welcome", "snowfall"] {
        let message = timeout(PATIENCE, stream.next()).await.expect("it tells").unwrap().unwrap();
        assert!(message.to_text().unwrap().contains(expected), "{message}");
    }
    drop(stream);
    server.stop().await;
}

/// A certificate for `localhost` in two files; they are gone when this is dropped.
struct Certificate {
    folder: PathBuf,
    der: CertificateDer<'static>,
}

impl Certificate {
    fn new(name: &str) -> Certificate {
        let folder = std::env::temp_dir().join(format!("firn-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let CertifiedKey { cert, signing_key } =
            rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
        std::fs::write(folder.join("cert.pem"), cert.pem()).unwrap();
        std::fs::write(folder.join("key.pem"), signing_key.serialize_pem()).unwrap();
        Certificate { folder, der: cert.der().clone() }
    }

    fn config(&self) -> ConnectionConfig {
        ConnectionConfig {
            tls_cert: Some(self.folder.join("cert.pem")),
            tls_key: Some(self.folder.join("key.pem")),
            ..ConnectionConfig::default()
        }
    }

    /// Opens a connection for one of some protocols.
    async fn connect(
        &self,
        server: &Server,
        protocols: &[&str],
    ) -> io::Result<TlsStream<TcpStream>> {
        let mut roots = rustls::RootCertStore::empty();
        roots.add(self.der.clone()).unwrap();
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let mut client = rustls::ClientConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .unwrap()
            .with_root_certificates(roots)
            .with_no_client_auth();
        client.alpn_protocols = protocols.iter().map(|name| name.as_bytes().to_vec()).collect();
        let name = ServerName::try_from("localhost").unwrap();
        TlsConnector::from(Arc::new(client)).connect(name, connect(server).await).await
    }
}

impl Drop for Certificate {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_and_streams_are_encrypted() {
    let certificate = Certificate::new("tls");
    let server = limited(certificate.config()).await;
    let mut stream = certificate.connect(&server, &[]).await.unwrap();
    let body = r#"{"id": "secret", "paused": true}"#;
    let request = format!(
        "POST /v1/sessions HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\n\
         content-length: {}\r\nconnection: close\r\n\r\n{body}",
        body.len()
    );
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 201"), "{answer}");

    let stream = certificate.connect(&server, &[]).await.unwrap();
    let url = "wss://localhost/v1/sessions/secret/stream";
    let (mut stream, _) = tokio_tungstenite::client_async(url, stream).await.unwrap();
    let message = timeout(PATIENCE, stream.next()).await.expect("it tells").unwrap().unwrap();
    assert!(message.to_text().unwrap().contains("welcome"), "{message}");
    drop(stream);

    // Whoever does not encrypt is not understood.
    assert!(!lives(&mut connect(&server).await).await);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn http_2_is_not_spoken_behind_tls() {
    let certificate = Certificate::new("http2");
    let server = limited(ConnectionConfig {
        max_connections: 1,
        header_timeout: Duration::from_secs(1),
        ..certificate.config()
    })
    .await;
    // There is one place. Each of these has it in turn, so none of them keeps it.
    until("who offers HTTP/2 alone is refused", async || {
        let refused = certificate.connect(&server, &["h2"]).await.expect_err("it is refused");
        refused.to_string().contains("NoApplicationProtocol")
    })
    .await;
    until("who offers both gets HTTP/1.1", async || {
        let stream = certificate.connect(&server, &["h2", "http/1.1"]).await;
        stream.is_ok_and(|stream| stream.get_ref().1.alpn_protocol() == Some(&b"http/1.1"[..]))
    })
    .await;
    let mut stream = None;
    until("there is room again", async || {
        stream = certificate.connect(&server, &[]).await.ok();
        stream.is_some()
    })
    .await;
    let mut stream = stream.unwrap();
    stream.write_all(PRIOR_KNOWLEDGE).await.unwrap();
    let mut said = Vec::new();
    let _ = timeout(PATIENCE, stream.read_to_end(&mut said)).await.expect("it is closed");
    let said = String::from_utf8_lossy(&said).into_owned();
    assert!(said.is_empty() || said.starts_with("HTTP/1.1 400"), "{said}");
    server.stop().await;
}

#[test]
fn a_certificate_that_can_not_be_used_is_named() {
    use firn::http::Gate;
    let certificate = Certificate::new("unusable");
    let other = Certificate::new("other");
    let missing = PathBuf::from("/nowhere/cert.pem");
    let access = AccessConfig::default();
    for (config, flag) in [
        (
            ConnectionConfig { tls_cert: Some(missing.clone()), ..certificate.config() },
            "--tls-cert",
        ),
        (ConnectionConfig { tls_key: Some(missing), ..certificate.config() }, "--tls-key"),
        (
            ConnectionConfig { tls_key: other.config().tls_key, ..certificate.config() },
            "--tls-cert",
        ),
        (
            ConnectionConfig { tls_cert: other.config().tls_key, ..certificate.config() },
            "--tls-cert",
        ),
    ] {
        let error = Gate::new(&access, config).unwrap_err();
        assert!(error.starts_with(flag), "{error}");
    }
}
