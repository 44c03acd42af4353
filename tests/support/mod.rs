//! Runs the real server on a free port, and talks to it over HTTP.

// Each test program uses its own part of this.
#![allow(dead_code)]

pub mod device;
pub mod wait;

use std::time::Duration;

use firn::backend;
use firn::config::{
    AccessConfig, BackendChoice, ConnectionConfig, EngineConfig, RequestConfig, StreamConfig,
};
use firn::driver::{Driver, Durability, OpenBackend, WorldConfig};
use firn::http::{App, Gate};
use firn::session::{Limits, Sessions};
use reqwest::header::{ACCEPT, CONTENT_TYPE, HeaderMap};
use reqwest::{Client, Method};
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

/// Makes a test of each function for each backend; the function takes the [`BackendChoice`].
#[macro_export]
macro_rules! on_each_backend {
    ($($name:ident),+ $(,)?) => {
        mod cpu {
            $(
                #[tokio::test(flavor = "multi_thread")]
                async fn $name() {
                    super::$name(firn::config::BackendChoice::Cpu).await;
                }
            )+
        }
        mod gpu {
            $(
                #[tokio::test(flavor = "multi_thread")]
                async fn $name() {
                    if $crate::support::skips_gpu() {
                        eprintln!("SKIPPED: FIRN_SKIP_GPU_TESTS=1");
                        return;
                    }
                    super::$name(firn::config::BackendChoice::Gpu).await;
                }
            )+
        }
    };
}

/// Whether tests that need a graphics adapter are to be skipped. Without this they fail where
/// there is none.
pub fn skips_gpu() -> bool {
    std::env::var("FIRN_SKIP_GPU_TESTS").is_ok_and(|value| value == "1")
}

/// How a server is started.
#[derive(Clone, Debug)]
pub struct Options {
    pub limits: Limits,
    pub requests: RequestConfig,
    pub stream: StreamConfig,
    pub access: AccessConfig,
    pub connections: ConnectionConfig,
    pub device_memory: Option<u64>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            limits: Limits {
                sessions: 100,
                columns_per_session: 1 << 28,
                columns: 1 << 40,
                cells_per_session: 1 << 28,
                cells: 1 << 32,
                colliders_per_session: 4096,
            },
            requests: RequestConfig {
                max_body_bytes: 1 << 20,
                request_timeout: Duration::from_secs(60),
                ..RequestConfig::default()
            },
            stream: StreamConfig::default(),
            access: AccessConfig::default(),
            connections: ConnectionConfig::default(),
            device_memory: None,
        }
    }
}

/// A running server.
pub struct Server {
    /// `http://127.0.0.1:port`.
    pub url: String,
    /// The same sessions that the server serves.
    pub sessions: Sessions,
    /// The state of the server.
    pub app: App,
    shutdown: CancellationToken,
    serving: Option<JoinHandle<std::io::Result<()>>>,
    world: Option<Driver>,
    client: Client,
}

/// What the server answered.
#[derive(Debug)]
pub struct Reply {
    pub status: u16,
    pub headers: HeaderMap,
    pub body: Vec<u8>,
}

impl Reply {
    /// The JSON body.
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|error| {
            panic!("{error}: status {}, {:?}", self.status, String::from_utf8_lossy(&self.body))
        })
    }

    /// A header's text; empty where it is not there.
    pub fn header(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", |value| value.to_str().expect("a header is text"))
    }

    /// Whether it says, once, that it varies by a header.
    pub fn varies(&self, by: &str) -> bool {
        let told = self.headers.get_all("vary").iter();
        let told = told.flat_map(|told| told.to_str().expect("a header is text").split(','));
        told.filter(|told| told.trim().eq_ignore_ascii_case(by)).count() == 1
    }

    /// The JSON body of an answer with a status.
    #[track_caller]
    pub fn expect(&self, status: u16) -> Value {
        let body = String::from_utf8_lossy(&self.body);
        assert_eq!(self.status, status, "{body}");
        if self.body.is_empty() { Value::Null } else { self.json() }
    }

    /// The problem of an answer with a status, checked for its form.
    #[track_caller]
    pub fn problem(&self, status: u16) -> Value {
        let body = String::from_utf8_lossy(&self.body);
        assert_eq!(self.status, status, "{body}");
        assert_eq!(self.header("content-type"), "application/problem+json");
        let problem = self.json();
        assert_eq!(problem["status"], status);
        assert!(problem["type"].as_str().is_some_and(|kind| kind.starts_with("urn:firn:problem:")));
        for field in ["title", "detail"] {
            assert!(problem[field].as_str().is_some_and(|text| !text.is_empty()), "{body}");
        }
        for error in problem["errors"].as_array().expect("errors are a list") {
            assert!(error["pointer"].is_string() && error["detail"].is_string(), "{body}");
        }
        problem
    }

    /// The pointers of a problem.
    #[track_caller]
    pub fn pointers(&self, status: u16) -> Vec<String> {
        let problem = self.problem(status);
        let errors = problem["errors"].as_array().expect("errors are a list");
        errors.iter().map(|e| e["pointer"].as_str().unwrap().to_owned()).collect()
    }
}

impl Server {
    /// Starts a server with the usual limits.
    pub async fn start(backend: BackendChoice) -> Server {
        Server::start_with(backend, Options::default()).await
    }

    /// Starts a server.
    pub async fn start_with(backend: BackendChoice, options: Options) -> Server {
        Server::start_stored(backend, options, Durability::ephemeral()).await
    }

    /// Starts a server whose sessions outlive it in some way, and waits until they are back.
    pub async fn start_stored(
        backend: BackendChoice,
        options: Options,
        durability: Durability,
    ) -> Server {
        let engine = EngineConfig { backend, device_memory: options.device_memory };
        Server::start_on(Box::new(move || backend::open(&engine)), options, durability).await
    }

    /// Starts a server on the device that a function opens.
    pub async fn start_on(open: OpenBackend, options: Options, durability: Durability) -> Server {
        let config = WorldConfig { limits: options.limits, publish_rate: 20.0, sleep: true };
        let (sessions, world) = Driver::open(open, config, durability).expect(
            "a graphics adapter is needed, a software one will do; FIRN_SKIP_GPU_TESTS=1 leaves \
             these tests out",
        );
        wait::until("its sessions are back", async || sessions.vitals().is_recovered()).await;
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port is free");
        let url = format!("http://{}", listener.local_addr().expect("it has an address"));
        let shutdown = CancellationToken::new();
        let gate = Gate::new(&options.access, options.connections).expect("a sound configuration");
        let app = App::new(sessions.clone(), options.requests, options.stream, gate).unwrap();
        let serving = tokio::spawn(firn::server::run(listener, app.clone(), shutdown.clone()));
        Server {
            url,
            sessions,
            app,
            shutdown,
            serving: Some(serving),
            world: Some(world),
            // It asks for what a test says, and leaves answers as they are.
            client: Client::builder().no_gzip().no_zstd().build().expect("it can be made"),
        }
    }

    /// Tells the server to stop.
    pub fn begin_to_stop(&self) {
        self.shutdown.cancel();
    }

    /// Stops the server and waits until it has.
    pub async fn stop(mut self) {
        self.shutdown.cancel();
        let serving = self.serving.take().expect("it is stopped once");
        serving.await.expect("the server does not panic").expect("the server ends well");
        let world = self.world.take().expect("it is stopped once");
        tokio::task::spawn_blocking(move || world.stop()).await.expect("the world ends");
    }

    /// Sends a request with a token.
    pub async fn send_as(&self, token: &str, method: Method, path: &str, body: &Value) -> Reply {
        let bearer = format!("Bearer {token}");
        let headers = [("authorization", &*bearer), ("content-type", "application/json")];
        let body = if body.is_null() { Vec::new() } else { body.to_string().into_bytes() };
        self.send(method, path, &headers, body).await
    }

    /// Sends a request.
    pub async fn send(
        &self,
        method: Method,
        path: &str,
        headers: &[(&str, &str)],
        body: Vec<u8>,
    ) -> Reply {
        let mut request = self.client.request(method, format!("{}{path}", self.url));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        if !body.is_empty() {
            request = request.body(body);
        }
        let response = request.send().await.expect("the server answers");
        let (status, headers) = (response.status().as_u16(), response.headers().clone());
        let body = response.bytes().await.expect("the answer is whole").to_vec();
        Reply { status, headers, body }
    }

    async fn json(&self, method: Method, path: &str, body: &Value) -> Reply {
        let headers = [(CONTENT_TYPE.as_str(), "application/json")];
        self.send(method, path, &headers, body.to_string().into_bytes()).await
    }

    pub async fn get(&self, path: &str) -> Reply {
        self.send(Method::GET, path, &[], Vec::new()).await
    }

    /// Asks until the device is back. Who asks while it is lost is told to ask again.
    pub async fn get_once_back(&self, path: &str) -> Value {
        let mut answer = Value::Null;
        wait::until("the device is back", async || {
            let reply = self.get(path).await;
            match reply.status {
                200 => answer = reply.json(),
                _ => drop(reply.problem(503)),
            }
            !answer.is_null()
        })
        .await;
        answer
    }

    /// Waits until the world has gone on by some beats. There has to be a session.
    pub async fn beats(&self, count: u64) {
        let session = self.sessions.list(None, None, 1).pop().expect("there is a session");
        let then = session.frame();
        wait::until("beats pass", async || session.frame() >= then + count).await;
    }

    pub async fn get_as(&self, path: &str, accept: &str) -> Reply {
        self.send(Method::GET, path, &[(ACCEPT.as_str(), accept)], Vec::new()).await
    }

    pub async fn delete(&self, path: &str) -> Reply {
        self.send(Method::DELETE, path, &[], Vec::new()).await
    }

    pub async fn post(&self, path: &str, body: Value) -> Reply {
        self.json(Method::POST, path, &body).await
    }

    /// Posts a body that is not JSON.
    pub async fn post_bytes(&self, path: &str, media_type: &str, body: Vec<u8>) -> Reply {
        self.send(Method::POST, path, &[(CONTENT_TYPE.as_str(), media_type)], body).await
    }

    pub async fn put(&self, path: &str, body: Value) -> Reply {
        self.json(Method::PUT, path, &body).await
    }

    pub async fn patch(&self, path: &str, body: Value) -> Reply {
        self.json(Method::PATCH, path, &body).await
    }

    /// Creates a session; returns its path.
    pub async fn create(&self, spec: Value) -> String {
        let created = self.post("/v1/sessions", spec).await.expect(201);
        format!("/v1/sessions/{}", created["id"].as_str().expect("it has an id"))
    }

    /// Steps a session by a number of ticks; returns the session.
    pub async fn step(&self, session: &str, ticks: u64) -> Value {
        self.post(&format!("{session}/step"), json!({ "ticks": ticks })).await.expect(200)
    }

    /// All snow depths of a session.
    pub async fn heights(&self, session: &str) -> Vec<f64> {
        numbers(&self.get(&format!("{session}/heights")).await.expect(200)["heights"])
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shutdown.cancel();
    }
}

/// A list of numbers.
#[track_caller]
pub fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().expect("a list");
    list.iter().map(|number| number.as_f64().expect("a number")).collect()
}

/// Body of a small session that stands still, with 1 m of snow on 2 m × 1.4 m.
pub fn small() -> Value {
    json!({
        "grid": {"width": 10, "depth": 7, "height": 20, "cell_size": 0.2},
        "paused": true,
        "initial_snow": [{"depth": 1.0}]
    })
}

/// Body of a session of which a million ticks take minutes on the fastest device: snow falls before
/// each of them, so that each is a frame of its own.
pub fn slow() -> Value {
    let mut body = small();
    body["snowfall_rate"] = json!(100);
    body["time_scale"] = json!(10);
    body
}
