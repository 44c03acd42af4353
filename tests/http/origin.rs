//! Web pages of others can't reach the server through somebody's browser.

use firn::config::{AccessConfig, BackendChoice};
use reqwest::Method;

use crate::support::{Options, Server, small};

const PAGE: &str = "https://game.example";

async fn neighbourly() -> Server {
    let access = AccessConfig {
        allowed_host: vec!["snow.example".to_owned()],
        allowed_origin: vec![PAGE.parse().unwrap()],
        ..AccessConfig::default()
    };
    Server::start_with(BackendChoice::Cpu, Options { access, ..Options::default() }).await
}

async fn call(server: &Server, method: Method, path: &str, headers: &[(&str, &str)]) -> u16 {
    let reply = server.send(method, path, headers, Vec::new()).await;
    if reply.status >= 400 {
        reply.problem(reply.status);
    }
    reply.status
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_answers_to_its_own_names_only() {
    let server = neighbourly().await;
    for (host, status) in [
        ("localhost", 200),
        ("127.0.0.1:9", 200),
        ("[::1]:8080", 200),
        ("snow.example", 200),
        ("SNOW.example:8080", 200),
        ("evil.example", 421),
        ("127.0.0.1.evil.example", 421),
        ("192.0.2.1", 421),
        ("not a name", 400),
    ] {
        for path in ["/v1/sessions", "/livez", "/openapi.json"] {
            let found = call(&server, Method::GET, path, &[("host", host)]).await;
            assert_eq!(found, status, "{host} {path}");
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_foreign_page_changes_nothing() {
    let server = neighbourly().await;
    let path = server.create(small()).await;
    let own = server.url.clone();
    for (origin, status) in [
        (own.as_str(), 200),
        (PAGE, 200),
        ("https://evil.example", 403),
        ("http://localhost:1", 403),
        ("null", 403),
    ] {
        let reset = format!("{path}/reset");
        let headers = [("origin", origin)];
        assert_eq!(call(&server, Method::POST, &reset, &headers).await, status, "{origin}");
        // The browser keeps the answer to a read from a page that is not told it may have it.
        assert_eq!(call(&server, Method::GET, &path, &headers).await, 200, "{origin}");
        let upgrade = [("origin", origin), ("connection", "upgrade"), ("upgrade", "websocket")];
        let status = if status == 200 { 400 } else { status };
        let stream = format!("{path}/stream");
        assert_eq!(call(&server, Method::GET, &stream, &upgrade).await, status, "{origin}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn only_allowed_pages_may_read() {
    const ALLOWED: &str = "access-control-allow-origin";
    let server = neighbourly().await;
    for (origin, told) in [(PAGE, PAGE), ("https://evil.example", "")] {
        let headers = [("origin", origin)];
        let reply = server.send(Method::GET, "/v1/sessions", &headers, Vec::new()).await;
        assert_eq!(reply.header(ALLOWED), told);
        // Problems can be read too.
        let reply = server.send(Method::GET, "/v1/sessions/nobody", &headers, Vec::new()).await;
        assert_eq!((reply.status, reply.header(ALLOWED)), (404, told));
    }
    let preflight = [
        ("origin", PAGE),
        ("access-control-request-method", "PUT"),
        ("access-control-request-headers", "authorization,content-type,idempotency-key"),
    ];
    let reply = server.send(Method::OPTIONS, "/v1/sessions/a", &preflight, Vec::new()).await;
    assert_eq!((reply.status, reply.header(ALLOWED)), (200, PAGE));
    assert!(reply.header("access-control-allow-methods").contains("PUT"));
    assert!(reply.header("access-control-allow-headers").contains("authorization"));
    server.stop().await;

    let closed = Server::start(BackendChoice::Cpu).await;
    let reply = closed.send(Method::OPTIONS, "/v1/sessions", &preflight, Vec::new()).await;
    assert_eq!((reply.status, reply.header(ALLOWED)), (405, ""));
    closed.stop().await;
}
