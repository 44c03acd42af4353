//! SIGHUP has keys and certificates read again.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use futures_util::{SinkExt, StreamExt};
use rcgen::CertifiedKey;
use reqwest::{Client, StatusCode};
use rustix::process::Signal;
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::crypto::CryptoProvider;
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::{DigitallySignedStruct, SignatureScheme};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

use crate::running::{Running, serve};
use crate::support::wait::{PATIENCE, until};

const OPERATOR: &str = "the-key-of-the-operator";
const NEW_OPERATOR: &str = "another-key-of-the-operator";
const OLD: &str = "a-key-of-alpine-that-is-taken-away";
const NEW: &str = "a-key-of-alpine-that-takes-its-place";
const KEPT: &str = "a-key-of-alpine-that-is-left-alone";
const LESSER: &str = "a-key-of-alpine-that-loses-a-scope";

fn entry(key: &str, scopes: &str) -> String {
    format!("[[tenants.alpine.keys]]\nkey = \"{key}\"\nscopes = [{scopes}]\n")
}

/// The value of a metric.
async fn value(server: &Running, metric: &str) -> u64 {
    let text = metrics(&server.url).await;
    let line = text.lines().find_map(|line| line.strip_prefix(metric)?.strip_prefix(' '));
    line.unwrap_or_else(|| panic!("no {metric} in {text}")).parse().unwrap()
}

/// Has a server read its files again, and waits until it has read one of them.
async fn reload(server: &Running, what: &str, result: &str) {
    let metric = format!("firn_reloads_total{{what=\"{what}\",result=\"{result}\"}}");
    let before = value(server, &metric).await;
    server.signal(Signal::HUP);
    until("it reads its files again", async || value(server, &metric).await != before).await;
}

async fn status(server: &Running, key: &str, body: Option<Value>) -> StatusCode {
    let sessions = format!("{}/v1/sessions", server.url);
    let request = match body {
        None => Client::new().get(sessions),
        Some(body) => Client::new().post(sessions).json(&body),
    };
    request.bearer_auth(key).send().await.expect("it answers").status()
}

type Stream = WebSocketStream<MaybeTlsStream<TcpStream>>;

/// Opens a stream of the session `peak`, and reads its welcome.
async fn stream(server: &Running, key: &str) -> Stream {
    let url = server.url.replace("http://", "ws://");
    let url = format!("{url}/v1/sessions/peak/stream?token={key}");
    let (mut stream, _) = connect_async(url).await.expect("a stream begins");
    let welcome = stream.next().await.expect("a welcome").expect("a message");
    assert!(welcome.to_text().unwrap().contains("welcome"));
    stream
}

/// The code that a stream is closed with.
async fn close_code(stream: &mut Stream) -> u16 {
    let closed = async {
        loop {
            if let Message::Close(frame) = stream.next().await.expect("a code").expect("a message")
            {
                return frame.expect("a code").code.into();
            }
        }
    };
    timeout(PATIENCE, closed).await.expect("it is closed")
}

/// Whether a stream still answers.
async fn answers(stream: &mut Stream) -> bool {
    stream.send(Message::text(r#"{"op": "ping", "id": 1}"#)).await.expect("it is open");
    let answer = timeout(PATIENCE, stream.next()).await.expect("it answers");
    matches!(answer, Some(Ok(Message::Text(text))) if text.contains("pong"))
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_that_are_gone_stop_working_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let (operator, keys) = (folder.path().join("operator"), folder.path().join("keys.toml"));
    fs::write(&operator, OPERATOR).unwrap();
    let both = "\"read\", \"write\"";
    let before = [entry(OLD, both), entry(KEPT, both), entry(LESSER, both)].concat();
    fs::write(&keys, format!("[tenants.alpine]\nquotas = {{ sessions = 5 }}\n{before}")).unwrap();
    let path = |path: &Path| path.to_str().unwrap().to_owned();
    let server = Running::start(serve(&[
        "--listen",
        "127.0.0.1:0",
        "--api-key-file",
        &path(&operator),
        "--api-keys-file",
        &path(&keys),
    ]));
    let session = json!({"id": "peak", "paused": true});
    assert_eq!(status(&server, OLD, Some(session)).await, 201);
    let mut streams = Vec::new();
    for key in [OLD, KEPT, LESSER, OPERATOR] {
        streams.push(stream(&server, key).await);
    }
    let [old, kept, lesser, of_operator] = &mut streams[..] else { panic!() };

    // A file that is cut short, as by an editor that is still writing, changes nothing.
    fs::write(&keys, "[tenants.alp").unwrap();
    reload(&server, "api_keys", "failed").await;
    fs::write(&keys, "").unwrap();
    reload(&server, "api_keys", "failed").await;
    assert_eq!(status(&server, OLD, None).await, 200);
    assert!(answers(old).await);

    let after = [entry(NEW, both), entry(KEPT, both), entry(LESSER, "\"read\"")].concat();
    fs::write(&keys, format!("[tenants.alpine]\nquotas = {{ sessions = 1 }}\n{after}")).unwrap();
    reload(&server, "api_keys", "ok").await;
    assert_eq!(status(&server, OLD, None).await, 401);
    for key in [NEW, KEPT, LESSER] {
        assert_eq!(status(&server, key, None).await, 200, "{key}");
    }
    assert_eq!((close_code(old).await, close_code(lesser).await), (3500, 3500));
    assert!(answers(kept).await && answers(of_operator).await);
    // What loses a scope may do the rest.
    assert!(answers(&mut stream(&server, LESSER).await).await);
    assert_eq!(status(&server, LESSER, Some(json!({}))).await, 403);
    // Quotas that shrink refuse what is new and delete nothing.
    assert_eq!(status(&server, NEW, Some(json!({}))).await, 429);
    assert!(answers(&mut stream(&server, NEW).await).await);

    fs::write(&operator, NEW_OPERATOR).unwrap();
    reload(&server, "api_key", "ok").await;
    assert_eq!(close_code(of_operator).await, 3500);
    assert_eq!(status(&server, OPERATOR, None).await, 401);
    assert_eq!(status(&server, NEW_OPERATOR, None).await, 200);
    fs::remove_file(&operator).unwrap();
    reload(&server, "api_key", "failed").await;
    assert_eq!(status(&server, NEW_OPERATOR, None).await, 200);
    assert!(answers(kept).await);

    let log = server.end();
    assert!(log.contains("line 1: ") && log.contains("still holds"), "{log}");
    for secret in [OPERATOR, NEW_OPERATOR, OLD, NEW, KEPT, LESSER] {
        assert!(!log.contains(secret), "{log}");
    }
}

#[test]
fn without_files_a_hangup_ends_it() {
    use std::os::unix::process::ExitStatusExt;
    let server = Running::start(serve(&["--listen", "127.0.0.1:0"]));
    server.signal(Signal::HUP);
    assert_eq!(server.ended().0.signal(), Some(Signal::HUP.as_raw()));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_that_is_made_is_good_once_the_file_is_read_again() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let make = |scopes: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_firn"));
        let made = command.args(["key", "alpine", "--scopes", scopes]).output().expect("it runs");
        assert!(made.status.success());
        let (entry, key) = (String::from_utf8(made.stdout), String::from_utf8(made.stderr));
        let (entry, key) = (entry.unwrap(), key.unwrap().trim().to_owned());
        assert!(!entry.contains(&key), "the file holds no secret");
        let text = fs::read_to_string(file.path()).unwrap();
        fs::write(file.path(), text + &entry).unwrap();
        key
    };
    // With other tables in between.
    fs::write(file.path(), "[tenants.alpine]\nquotas = {}\n[tenants.baltic]\n").unwrap();
    let reader = make("read");
    let keys = ["--listen", "127.0.0.1:0", "--api-keys-file", file.path().to_str().unwrap()];
    let server = Running::start(serve(&keys));
    let admin = make("admin");
    assert_eq!(status(&server, &reader, None).await, 200);
    assert_eq!(status(&server, &admin, None).await, 401);
    reload(&server, "api_keys", "ok").await;
    assert_eq!(status(&server, &admin, Some(json!({"paused": true}))).await, 201);
    assert_eq!(status(&server, &reader, Some(json!({"paused": true}))).await, 403);
    server.end();
}

/// What a server counts.
async fn metrics(url: &str) -> String {
    let Some(address) = url.strip_prefix("https://") else {
        return reqwest::get(format!("{url}/metrics")).await.unwrap().text().await.unwrap();
    };
    let mut stream = connect(address).await;
    let request = b"GET /metrics HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n";
    stream.write_all(request).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    answer
}

/// Takes any certificate.
#[derive(Debug)]
struct Curious(Arc<CryptoProvider>);

impl ServerCertVerifier for Curious {
    fn verify_server_cert(
        &self,
        _: &CertificateDer<'_>,
        _: &[CertificateDer<'_>],
        _: &ServerName<'_>,
        _: &[u8],
        _: UnixTime,
    ) -> Result<ServerCertVerified, rustls::Error> {
        Ok(ServerCertVerified::assertion())
    }

    fn verify_tls12_signature(
        &self,
        _: &[u8],
        _: &CertificateDer<'_>,
        _: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        Ok(HandshakeSignatureValid::assertion())
    }

    fn verify_tls13_signature(
        &self,
        _: &[u8],
        _: &CertificateDer<'_>,
        _: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        Ok(HandshakeSignatureValid::assertion())
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.0.signature_verification_algorithms.supported_schemes()
    }
}

/// Connects to a server, whatever its certificate, offering HTTP/2 as well.
async fn connect(address: &str) -> TlsStream<TcpStream> {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let mut config = rustls::ClientConfig::builder_with_provider(provider.clone())
        .with_safe_default_protocol_versions()
        .unwrap()
        .dangerous()
        .with_custom_certificate_verifier(Arc::new(Curious(provider)))
        .with_no_client_auth();
    config.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
    let stream = TcpStream::connect(address).await.unwrap();
    let name = ServerName::try_from("localhost").unwrap();
    TlsConnector::from(Arc::new(config)).connect(name, stream).await.unwrap()
}

/// The certificate of a server, and the protocol that it chooses.
async fn presented(address: &str) -> (Vec<u8>, Option<Vec<u8>>) {
    let stream = connect(address).await;
    let (_, connection) = stream.get_ref();
    let certificate = connection.peer_certificates().unwrap()[0].to_vec();
    (certificate, connection.alpn_protocol().map(<[u8]>::to_vec))
}

#[tokio::test(flavor = "multi_thread")]
async fn new_connections_get_the_new_certificate() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let write = |parts: [bool; 2]| {
        let CertifiedKey { cert, signing_key } =
            rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
        if parts[0] {
            fs::write(file("cert.pem"), cert.pem()).unwrap();
        }
        if parts[1] {
            fs::write(file("key.pem"), signing_key.serialize_pem()).unwrap();
        }
        cert.der().to_vec()
    };
    let first = write([true, true]);
    let options = ["--tls-cert", &file("cert.pem"), "--tls-key", &file("key.pem")];
    let server = Running::start(serve(&[&["--listen", "127.0.0.1:0"], &options[..]].concat()));
    let address = server.url.split_once("://").unwrap().1.to_owned();
    let http1 = Some(b"http/1.1".to_vec());
    assert_eq!(presented(&address).await, (first.clone(), http1.clone()));

    // The key is not that of the certificate: the two are taken over together or not at all.
    write([true, false]);
    reload(&server, "certificate", "failed").await;
    assert_eq!(presented(&address).await, (first, http1.clone()));
    let second = write([true, true]);
    reload(&server, "certificate", "ok").await;
    assert_eq!(presented(&address).await, (second, http1));
    let log = server.end();
    assert!(log.contains("--tls-cert"), "{log}");
}
