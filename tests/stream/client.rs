//! A client of the height stream that reconstructs what it is told.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::time::Duration;

use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use serde_json::Value;
use tokio::net::{TcpSocket, TcpStream};
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::http::Request;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, client_async, connect_async};

use crate::support::{Server, numbers};

type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

/// Time after which a test that waits for a message has failed.
const PATIENCE: Duration = Duration::from_secs(60);

/// Largest message the contract allows \[bytes\].
const LARGEST: usize = 1 << 20;

/// A socket, and what its subscriptions have been told.
pub struct Client {
    socket: Socket,
    views: HashMap<i64, View>,
    /// Answers and events that were not asked for yet.
    answers: VecDeque<Value>,
    events: VecDeque<Value>,
}

/// What one subscription has been told.
#[derive(Default)]
pub struct View {
    /// Heights by row and column, so that they are in the order of a read.
    heights: BTreeMap<(u64, u64), f64>,
    pub colliders: Value,
    /// Whole messages so far.
    pub messages: usize,
    stride: u64,
    parts: Vec<Value>,
}

impl View {
    fn values(&self) -> Vec<f64> {
        self.heights.values().copied().collect()
    }

    pub fn samples_equal(&self, expected: &[f64]) -> bool {
        self.values() == expected
    }

    /// Takes a whole message over, once its last part is there.
    fn take(&mut self, part: &Value) -> bool {
        self.parts.push(part.clone());
        if part.get("more").is_some() {
            return false;
        }
        self.messages += 1;
        for whole in std::mem::take(&mut self.parts) {
            for field in ["op", "seq", "tick"] {
                assert_eq!(whole[field], part[field], "all parts are of one state");
            }
            let part = whole;
            for tile in part["tiles"].as_array().unwrap() {
                let field = |name: &str| tile[name].as_u64().unwrap();
                let (width, depth) = (field("width"), field("depth"));
                let heights = numbers(&tile["heights"]);
                assert_eq!(heights.len() as u64, width * depth);
                for (i, height) in (0..).zip(heights) {
                    let z = field("column_z") + i / width * self.stride;
                    let x = field("column_x") + i % width * self.stride;
                    self.heights.insert((z, x), height);
                }
            }
            if let Some(colliders) = part.get("colliders") {
                self.colliders = colliders.clone();
            }
        }
        true
    }
}

fn request(server: &Server, session: &str, offered: &str) -> Request<()> {
    let url = format!("{}{session}/stream", server.url.replace("http://", "ws://"));
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
    match connect_async(request(server, session, offered)).await {
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
        let (mut client, _) = connect(server, session, "firn.v1.json").await;
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
        Client { socket, views: HashMap::new(), answers, events }
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
            let view = View { stride, ..View::default() };
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
        match self.message().await {
            Some(Ok(Message::Text(text))) => {
                assert!(text.len() <= LARGEST, "{} bytes", text.len());
                serde_json::from_str(&text).unwrap()
            }
            other => panic!("the stream ended: {other:?}"),
        }
    }

    /// Takes in the next message. Returns it where a subscription's message is complete with it.
    async fn take(&mut self) -> Option<Value> {
        let message = self.next().await;
        match message["op"].as_str().unwrap() {
            "snapshot" | "delta" => {
                let view = self.views.get_mut(&message["id"].as_i64().unwrap()).unwrap();
                return view.take(&message).then_some(message);
            }
            "event" => self.events.push_back(message),
            _ => self.answers.push_back(message),
        }
        None
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
    async fn told(&mut self, id: i64) -> Value {
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
