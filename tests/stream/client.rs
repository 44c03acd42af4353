//! A client of the height stream that reconstructs what it is told.

#[path = "view.rs"]
mod view;

use std::collections::{HashMap, VecDeque};
use std::time::Duration;

use firn_protocol::heights::{self, GROUND_STEPS_PER_METRE, HeightMessage, Tile};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use tokio::net::{TcpSocket, TcpStream};
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::http::{HeaderName, Request};
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, client_async, connect_async};

use crate::support::Server;

pub use view::View;

type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

/// Time after which a test that waits for a message has failed.
const PATIENCE: Duration = Duration::from_secs(60);

/// Largest message the contract allows \[bytes\].
const LARGEST: usize = 1 << 20;

/// A socket, and what its subscriptions have been told.
pub struct Client {
    socket: Socket,
    views: HashMap<i64, View>,
    /// Bytes of heights so far.
    pub payload: usize,
    /// Messages so far, and their bytes.
    pub heard: (usize, usize),
    /// Answers and events that were not asked for yet.
    answers: VecDeque<Value>,
    events: VecDeque<Value>,
}

/// A binary message, as it would be told as text.
fn as_text(message: &HeightMessage, quantum: f64) -> Value {
    let per_metre = (1.0 / quantum).round();
    let as_text = |column_x: u64, column_z: u64, tile: &Tile, heights: Vec<f64>| {
        json!({"column_x": column_x, "column_z": column_z, "width": tile.width,
               "depth": tile.depth, "heights": heights})
    };
    let tiles: Vec<_> = message
        .tiles()
        .map(|(x, z, tile)| {
            let heights = tile.heights.iter().map(|&steps| f64::from(steps) / per_metre);
            as_text(x, z, tile, heights.collect())
        })
        .collect();
    let ground: Vec<_> = message
        .ground()
        .map(|(x, z, tile)| {
            let heights = tile.elevations().map(|steps| f64::from(steps) / GROUND_STEPS_PER_METRE);
            as_text(x, z, tile, heights.collect())
        })
        .collect();
    let head = &message.head;
    let mut text = json!({
        "op": if head.snapshot { "snapshot" } else { "delta" },
        "id": head.id, "seq": head.seq, "tick": head.tick, "tiles": tiles,
    });
    if head.more {
        text["more"] = json!(true);
    }
    if let Some(recovered) = head.recovered {
        text["recovered"] = json!(recovered);
    }
    if head.level {
        text["level"] = json!(true);
    }
    if !ground.is_empty() {
        text["terrain"] = json!(ground);
    }
    if let Some(colliders) = &message.colliders {
        text["colliders"] = serde_json::from_str(colliders).unwrap();
    }
    text
}

fn request(server: &Server, session: &str, offered: &str) -> Request<()> {
    request_to(&server.url, session, offered)
}

/// A request with headers of its own; `session` may end in a query.
pub fn request_with(server: &Server, session: &str, headers: &[(&str, &str)]) -> Request<()> {
    let (path, query) = session.split_once('?').unwrap_or((session, ""));
    let mut request = request_to(&server.url, path, "");
    let uri = format!("{}?{query}", request.uri());
    *request.uri_mut() = uri.parse().unwrap();
    for (name, value) in headers {
        let name = HeaderName::try_from(*name).unwrap();
        request.headers_mut().insert(name, value.parse().unwrap());
    }
    request
}

/// What opens a stream of a server that is named by its address.
pub fn request_to(server: &str, session: &str, offered: &str) -> Request<()> {
    let url = format!("{}{session}/stream", server.replace("http://", "ws://"));
    let mut request = url.into_client_request().unwrap();
    if !offered.is_empty() {
        request.headers_mut().insert("sec-websocket-protocol", offered.parse().unwrap());
    }
    request
}

/// Opens a stream; returns it and the sub-protocol that the server chose.
pub async fn connect(server: &Server, session: &str, offered: &str) -> (Client, String) {
    let (socket, response) = connect_async(request(server, session, offered)).await.unwrap();
    let chosen = response.headers().get("sec-websocket-protocol");
    let chosen = chosen.map_or("", |value| value.to_str().unwrap()).to_owned();
    (Client::new(socket), chosen)
}

/// Tries to open a stream that the server refuses; returns the status and the problem.
pub async fn refused(server: &Server, session: &str, offered: &str) -> (u16, Value) {
    refusal(request(server, session, offered)).await
}

/// As [`refused`].
pub async fn refusal(request: Request<()>) -> (u16, Value) {
    match connect_async(request).await {
        Err(Error::Http(response)) => {
            assert_eq!(response.headers()["content-type"], "application/problem+json");
            let body = response.body().as_deref().unwrap_or_default();
            (response.status().as_u16(), serde_json::from_slice(body).unwrap())
        }
        other => panic!("not refused: {:?}", other.map(|(_, response)| response)),
    }
}

impl Client {
    /// Opens a stream, and reads its welcome.
    pub async fn open(server: &Server, session: &str) -> Client {
        Client::open_as(server, session, "firn.v1.json").await
    }

    /// Opens a stream by a request of its own, and reads nothing.
    pub async fn begin(request: Request<()>) -> Client {
        Client::new(connect_async(request).await.unwrap().0)
    }

    /// As [`Client::open`], with a sub-protocol.
    pub async fn open_as(server: &Server, session: &str, protocol: &str) -> Client {
        let (mut client, chosen) = connect(server, session, protocol).await;
        assert_eq!(chosen, protocol);
        assert_eq!(client.next().await["op"], "welcome");
        client
    }

    /// As [`Client::open`], through a connection that holds little of what is not read.
    pub async fn open_narrow(server: &Server, session: &str) -> Client {
        let address = server.url.trim_start_matches("http://").parse().unwrap();
        let socket = TcpSocket::new_v4().unwrap();
        socket.set_recv_buffer_size(16 * 1024).unwrap();
        let stream = MaybeTlsStream::Plain(socket.connect(address).await.unwrap());
        let request = request(server, session, "firn.v1.json");
        let mut client = Client::new(client_async(request, stream).await.unwrap().0);
        assert_eq!(client.next().await["op"], "welcome");
        client
    }

    fn new(socket: Socket) -> Client {
        let (answers, events) = (VecDeque::new(), VecDeque::new());
        Client { socket, views: HashMap::new(), payload: 0, heard: (0, 0), answers, events }
    }

    pub fn split(self) -> (SplitSink<Socket, Message>, SplitStream<Socket>) {
        self.socket.split()
    }

    pub async fn send_raw(&mut self, message: Message) {
        self.socket.send(message).await.unwrap();
    }

    pub async fn send(&mut self, request: Value) {
        if request["op"] == "subscribe" {
            let stride = request["stride"].as_u64().unwrap_or(1);
            let quantum = request["quantum"].as_f64().unwrap_or(0.001);
            let view = View::of(stride, quantum);
            self.views.insert(request["id"].as_i64().unwrap(), view);
        }
        self.send_raw(Message::text(request.to_string())).await;
    }

    /// The next message but pings, which come from a silent server too.
    async fn message(&mut self) -> Option<Result<Message, Error>> {
        let message = async {
            loop {
                match self.socket.next().await {
                    Some(Ok(Message::Ping(_))) => {}
                    message => return message,
                }
            }
        };
        timeout(PATIENCE, message).await.expect("the server tells nothing")
    }

    /// The next message, whatever it is.
    pub async fn next(&mut self) -> Value {
        self.try_next().await.unwrap_or_else(|end| panic!("the stream ended: {end}"))
    }

    /// The next message, or why there is none.
    pub async fn try_next(&mut self) -> Result<Value, String> {
        let message = self.message().await;
        if let Some(Ok(message)) = &message {
            self.heard = (self.heard.0 + 1, self.heard.1 + message.len());
        }
        match message {
            Some(Ok(Message::Text(text))) => {
                assert!(text.len() <= LARGEST, "{} bytes", text.len());
                Ok(serde_json::from_str(&text).unwrap())
            }
            Some(Ok(Message::Binary(bytes))) => {
                assert!(bytes.len() <= LARGEST, "{} bytes", bytes.len());
                self.payload += bytes.len();
                let message = heights::decode(&bytes).unwrap();
                Ok(as_text(&message, self.views[&message.head.id].quantum))
            }
            other => Err(format!("{other:?}")),
        }
    }

    /// Takes in the next message, or says why there is none. Returns it where a subscription's
    /// message is complete with it.
    pub async fn try_take(&mut self) -> Result<Option<Value>, String> {
        let message = self.try_next().await?;
        match message["op"].as_str().unwrap() {
            "snapshot" | "delta" => {
                let view = self.views.get_mut(&message["id"].as_i64().unwrap()).unwrap();
                return Ok(view.take(&message).then_some(message));
            }
            "event" => self.events.push_back(message),
            _ => self.answers.push_back(message),
        }
        Ok(None)
    }

    /// Opens a stream through somebody in between, if that lets it.
    pub async fn try_open(between: &str, session: &str, protocol: &str) -> Option<Client> {
        let request = request_to(between, session, protocol);
        let opening = async {
            let mut client = Client::new(connect_async(request).await.ok()?.0);
            (client.try_next().await.ok()?["op"] == "welcome").then_some(client)
        };
        timeout(PATIENCE / 6, opening).await.ok().flatten()
    }

    /// Sends a request, if the stream still takes it.
    pub async fn try_send(&mut self, request: &Value) -> bool {
        self.socket.send(Message::text(request.to_string())).await.is_ok()
    }

    /// Takes over what another client was told.
    pub fn inherit(&mut self, id: i64, view: View) {
        self.views.insert(id, view.without_parts());
    }

    /// What a subscription was told.
    pub fn view(&mut self, id: i64) -> &mut View {
        self.views.get_mut(&id).unwrap()
    }

    /// An answer that has come already.
    pub fn pop_answer(&mut self) -> Option<Value> {
        self.answers.pop_front()
    }

    /// What a subscription was told, to be inherited.
    pub fn bequeath(&mut self, id: i64) -> View {
        self.views.remove(&id).unwrap()
    }

    /// Ends without a word.
    pub fn cut(self) {
        drop(self.socket);
    }

    /// Takes in the next message. Returns it where a subscription's message is complete with it.
    async fn take(&mut self) -> Option<Value> {
        self.try_take().await.unwrap_or_else(|end| panic!("the stream ended: {end}"))
    }

    /// The next ack, error or pong.
    pub async fn answer(&mut self) -> Value {
        loop {
            if let Some(answer) = self.answers.pop_front() {
                return answer;
            }
            self.take().await;
        }
    }

    /// The next event.
    pub async fn next_event(&mut self) -> Value {
        loop {
            if let Some(event) = self.events.pop_front() {
                return event;
            }
            self.take().await;
        }
    }

    /// An event that has come already.
    pub fn pop_event(&mut self) -> Option<Value> {
        self.events.pop_front()
    }

    /// The next event of a kind; others before it are dropped.
    pub async fn event(&mut self, kind: &str) -> Value {
        loop {
            while let Some(event) = self.events.pop_front() {
                if event["event"] == kind {
                    return event;
                }
            }
            self.take().await;
        }
    }

    /// The next message of heights of a subscription.
    pub async fn told(&mut self, id: i64) -> Value {
        loop {
            if let Some(message) = self.take().await
                && message["id"] == id
            {
                return message;
            }
        }
    }

    /// Waits for the next heights of a subscription; returns their seq.
    pub async fn heights_of(&mut self, id: i64) -> u64 {
        self.told(id).await["seq"].as_u64().unwrap()
    }

    /// The `op` and the corners of the tiles of the next message of heights of subscription 1.
    pub async fn tiles(&mut self) -> (String, Vec<(u64, u64)>) {
        let message = self.told(1).await;
        let corner =
            |tile: &Value| (tile["column_x"].as_u64().unwrap(), tile["column_z"].as_u64().unwrap());
        let corners = message["tiles"].as_array().unwrap().iter().map(corner).collect();
        (message["op"].as_str().unwrap().to_owned(), corners)
    }

    /// Reads on until a subscription has been told something.
    pub async fn until(&mut self, id: i64, enough: impl Fn(&View) -> bool) {
        while !enough(&self.views[&id]) {
            self.take().await;
        }
    }

    /// Heights that a subscription has been told, row by row.
    pub fn heights(&self, id: i64) -> Vec<f64> {
        self.views[&id].values()
    }

    /// Messages of heights of all subscriptions together.
    pub fn messages(&self) -> usize {
        self.views.values().map(|view| view.messages).sum()
    }

    /// Colliders that a subscription has been told.
    pub fn colliders(&self, id: i64) -> Value {
        self.views[&id].colliders.clone()
    }

    /// The code that the server closes with.
    pub async fn close_code(&mut self) -> u16 {
        loop {
            match self.message().await {
                Some(Ok(Message::Close(Some(frame)))) => return frame.code.into(),
                Some(Ok(_)) => {}
                other => panic!("the stream ended without a code: {other:?}"),
            }
        }
    }
}
