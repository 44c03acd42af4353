//! A height stream's socket.

use std::collections::HashMap;
use std::time::Duration;

use firn_protocol::Subscribe;
use firn_protocol::stream::{Command, SubProtocol};
use futures_util::{SinkExt, StreamExt};
use reqwest::Method;
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::http::{HeaderValue, header};
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;
use tokio_tungstenite::tungstenite::{Bytes, Error as SocketError, Message as Frame, Utf8Bytes};
use tokio_tungstenite::{WebSocketStream, client_async_with_config};

use crate::client::Client;
use crate::error::{Error, refused};
use crate::message::{self, Message, Welcome};

/// Read buffer \[bytes\]: thousands of streams may live in one process.
const READ_BUFFER: usize = 16 << 10;

/// Longest time until a stream stands.
const CONNECTING: Duration = Duration::from_secs(10);

/// Longest time without a sign of life: a server sends a ping every 15 s.
const SILENCE: Duration = Duration::from_secs(60);

/// Longest time that a goodbye takes.
const FAREWELL: Duration = Duration::from_secs(2);

/// Code of a close frame that says none.
const NO_CODE: u16 = 1005;

/// A message as it came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Raw {
    /// JSON.
    Text(Utf8Bytes),
    /// Heights as packed bytes, for [`firn_protocol::heights::decode`].
    Binary(Bytes),
}

impl Raw {
    /// Its length \[bytes\].
    pub fn len(&self) -> usize {
        match self {
            Raw::Text(text) => text.len(),
            Raw::Binary(bytes) => bytes.len(),
        }
    }

    /// Whether nothing is in it.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A height stream: it receives heights and events, and sends changes.
#[derive(Debug)]
pub struct Stream {
    socket: WebSocketStream<TcpStream>,
    welcome: Welcome,
    /// Of each subscription the step that heights are rounded to \[m\].
    quanta: HashMap<i64, f64>,
    /// Subscriptions so far.
    subscriptions: i64,
}

impl Stream {
    /// Opens a stream of a session, and reads its welcome.
    ///
    /// # Errors
    /// [`Error::Refused`] where the server says why there is none.
    pub(crate) async fn open(
        client: &Client,
        session: &str,
        protocol: SubProtocol,
    ) -> Result<Stream, Error> {
        let url = client.url(&format!("/v1/sessions/{session}/stream"));
        let url = url.replacen("http", "ws", 1);
        let unreachable = |why: String| Error::Unreachable { url: url.clone(), why };
        let mut request =
            url.as_str().into_client_request().map_err(|error| unreachable(error.to_string()))?;
        let headers = request.headers_mut();
        headers.insert(header::SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(protocol.name()));
        if let Some(bearer) = client.bearer() {
            headers.insert(header::AUTHORIZATION, bearer.clone());
        }
        let config = WebSocketConfig::default().read_buffer_size(READ_BUFFER);
        let connecting = async {
            let connection = TcpStream::connect(client.address()).await?;
            connection.set_nodelay(true)?;
            client_async_with_config(request, connection, Some(config)).await
        };
        let connected = timeout(CONNECTING, connecting)
            .await
            .map_err(|_| unreachable("it takes too long to connect".to_owned()))?;
        let mut socket = match connected {
            Ok((socket, _)) => socket,
            Err(SocketError::Http(response)) => {
                let what = format!("{} {url}", Method::GET);
                let told = response.body().as_deref().unwrap_or_default();
                return Err(refused(what, response.status(), told));
            }
            Err(SocketError::Io(error)) => return Err(unreachable(error.kind().to_string())),
            Err(error) => return Err(unreachable(error.to_string())),
        };
        match message::read(&receive(&mut socket).await?, |_| None)? {
            Message::Welcome(welcome) => {
                Ok(Stream { socket, welcome, quanta: HashMap::new(), subscriptions: 0 })
            }
            other => {
                let why = format!("the first message is no welcome but {other:?}");
                Err(Error::Unreadable { what: url, why })
            }
        }
    }

    /// The server's first message: the session's epoch, grid and settings.
    pub fn welcome(&self) -> &Welcome {
        &self.welcome
    }

    /// Begins a subscription and returns its id, which no other subscription of this stream has. The first
    /// heights cover the whole region; after a resume they cover what was missed.
    ///
    /// # Errors
    /// [`Error::Lost`].
    pub async fn subscribe(&mut self, wish: Subscribe) -> Result<i64, Error> {
        self.subscriptions += 1;
        let id = self.subscriptions;
        self.send(&Command::Subscribe { id, wish }).await?;
        Ok(id)
    }

    /// Sends a command. The server answers each that has an id with an ack or an error. Subscriptions are
    /// better begun by [`Stream::subscribe`]: heights of an id are read with the quantum that it was given
    /// last.
    ///
    /// # Errors
    /// [`Error::Lost`].
    pub async fn send(&mut self, command: &Command) -> Result<(), Error> {
        if let Command::Subscribe { id, wish } = command {
            self.quanta.insert(*id, wish.quantum);
        }
        let text =
            serde_json::to_string(command).map_err(|error| Error::Lost(error.to_string()))?;
        self.socket.send(Frame::text(text)).await.map_err(lost)
    }

    /// The next message. Cancel safe: no message is lost in `select!`.
    ///
    /// # Errors
    /// [`Error::Closed`] and [`Error::Lost`] where there will be none; [`Error::Unreadable`].
    pub async fn next(&mut self) -> Result<Message, Error> {
        let raw = self.next_raw().await?;
        message::read(&raw, |id| self.quanta.get(&id).copied())
    }

    /// The next message, as it came.
    ///
    /// # Errors
    /// [`Error::Closed`] and [`Error::Lost`] where there will be none.
    pub async fn next_raw(&mut self) -> Result<Raw, Error> {
        receive(&mut self.socket).await
    }

    /// Says goodbye. Whether the server hears it changes nothing any more.
    pub async fn close(mut self) {
        let _ = timeout(FAREWELL, self.socket.close(None)).await;
    }
}

/// The next message.
async fn receive(socket: &mut WebSocketStream<TcpStream>) -> Result<Raw, Error> {
    loop {
        let heard = timeout(SILENCE, socket.next())
            .await
            .map_err(|_| Error::Lost("nothing was heard for too long".to_owned()))?;
        match heard {
            Some(Ok(Frame::Text(text))) => return Ok(Raw::Text(text)),
            Some(Ok(Frame::Binary(bytes))) => return Ok(Raw::Binary(bytes)),
            Some(Ok(Frame::Close(frame))) => {
                let (code, reason) = frame.map_or((NO_CODE, String::new()), |frame| {
                    (frame.code.into(), frame.reason.as_str().to_owned())
                });
                return Err(Error::Closed { code, reason });
            }
            // Pings are answered by the socket itself.
            Some(Ok(_)) => {}
            Some(Err(error)) => return Err(lost(error)),
            None => return Err(Error::Lost("the stream has ended".to_owned())),
        }
    }
}

fn lost(error: SocketError) -> Error {
    Error::Lost(match error {
        SocketError::Io(error) => error.kind().to_string(),
        error => error.to_string(),
    })
}
