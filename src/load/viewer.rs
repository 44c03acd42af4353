//! A viewer: watches a region and counts what it is told.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use futures_util::{SinkExt, StreamExt};
use serde_json::json;
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::http::{HeaderValue, header};
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{WebSocketStream, client_async_with_config};

use super::message::{self, Content, Told};
use super::tally::Tally;
use super::{Plan, Protocol, Shared};

/// A stream.
pub type Socket = WebSocketStream<TcpStream>;

/// Read buffer of a client \[bytes\]: a thousand of them live in one process.
const READ_BUFFER: usize = 16 << 10;

/// Time that a client takes to say goodbye.
const FAREWELL: Duration = Duration::from_secs(2);

/// Opens a stream.
///
/// # Errors
/// Why there is none.
pub async fn open(plan: &Plan, protocol: Protocol, session: &str) -> Result<Socket, String> {
    let base = plan.url.trim_end_matches('/');
    let authority = base.trim_start_matches("http://");
    let host = authority.split('/').next().unwrap_or(authority);
    let address = if host.rsplit(']').next().is_some_and(|end| end.contains(':')) {
        host.to_owned()
    } else {
        format!("{host}:80")
    };
    let mut request = format!("ws://{authority}/v1/sessions/{session}/stream")
        .into_client_request()
        .map_err(|error| format!("not connected: {error}"))?;
    let protocol = HeaderValue::from_static(protocol.name());
    request.headers_mut().insert(header::SEC_WEBSOCKET_PROTOCOL, protocol);
    if let Some(key) = &plan.api_key {
        let bearer = HeaderValue::try_from(format!("Bearer {}", key.secret()))
            .map_err(|_| "not connected: the API key is no visible ASCII".to_owned())?;
        request.headers_mut().insert(header::AUTHORIZATION, bearer);
    }
    let stream = TcpStream::connect(address)
        .await
        .map_err(|error| format!("not connected: {}", error.kind()))?;
    stream.set_nodelay(true).map_err(|error| format!("not connected: {}", error.kind()))?;
    let config = WebSocketConfig::default().read_buffer_size(READ_BUFFER);
    match client_async_with_config(request, stream, Some(config)).await {
        Ok((socket, _)) => Ok(socket),
        Err(Error::Http(response)) => Err(format!("refused with {}", response.status().as_u16())),
        Err(error) => Err(format!("not connected: {error}")),
    }
}

/// The next message.
///
/// # Errors
/// Why there will be none.
pub async fn next(socket: &mut Socket) -> Result<Message, String> {
    match socket.next().await {
        Some(Ok(Message::Close(Some(frame)))) => Err(format!("closed with {}", frame.code)),
        Some(Ok(Message::Close(None))) => Err("closed without a code".to_owned()),
        Some(Ok(message)) => Ok(message),
        Some(Err(Error::Io(error))) => Err(format!("connection lost: {}", error.kind())),
        Some(Err(_)) | None => Err("connection lost".to_owned()),
    }
}

/// Says goodbye.
pub async fn close(mut socket: Socket) {
    // The run is over; whether the server hears it changes nothing any more.
    let _ = tokio::time::timeout(FAREWELL, socket.close(None)).await;
}

/// Watches until the run ends.
pub async fn watch(plan: Plan, number: usize, ids: Vec<String>, shared: Arc<Shared>) -> Tally {
    let session = number % ids.len();
    let mut viewer = Viewer {
        tally: Tally { session, ..Tally::default() },
        period: 1.0 / plan.tick_rate,
        newest_tick: 0,
        shared: shared.clone(),
    };
    if let Err(cause) = viewer.live(&plan, number, &ids[session]).await {
        viewer.tally.dropped = Some(cause);
    }
    viewer.tally
}

struct Viewer {
    tally: Tally,
    /// Time from tick to tick \[s\].
    period: f64,
    newest_tick: u64,
    shared: Arc<Shared>,
}

impl Viewer {
    async fn live(&mut self, plan: &Plan, number: usize, id: &str) -> Result<(), String> {
        let shared = self.shared.clone();
        let mut socket = tokio::select! {
            biased;
            () = shared.end.cancelled() => return Ok(()),
            socket = self.enter(plan, number, id) => socket?,
        };
        loop {
            let message = tokio::select! {
                biased;
                () = shared.end.cancelled() => break,
                message = next(&mut socket) => message?,
            };
            self.take(&message, number >= plan.slow_clients)?;
        }
        close(socket).await;
        Ok(())
    }

    /// Subscribes; a slow client stalls then, and catches up.
    async fn enter(&mut self, plan: &Plan, number: usize, id: &str) -> Result<Socket, String> {
        let arrived = Arrival(self.shared.clone());
        let mut socket = self.subscribe(plan, number, id).await?;
        self.shared.connected.fetch_add(1, Ordering::Relaxed);
        drop(arrived);
        if number < plan.slow_clients {
            self.shared.begin.clone().cancelled().await;
            tokio::time::sleep(plan.stall).await;
            self.catch_up(&mut socket).await?;
        }
        Ok(socket)
    }

    /// Connects, and waits for the first heights.
    async fn subscribe(&mut self, plan: &Plan, number: usize, id: &str) -> Result<Socket, String> {
        let shared = self.shared.clone();
        let _turn = shared.connecting.acquire().await.map_err(|_| "not connected".to_owned())?;
        let mut socket = open(plan, plan.protocol, id).await?;
        // Scattered evenly: multiples of the golden ratio and its square leave no gaps.
        let place =
            |ratio: f64, room: u32| ((number as f64 * ratio).fract() * f64::from(room)) as u32;
        let region = json!({
            "column_x": place(0.618_033_988_7, plan.grid.width - plan.region.width + 1),
            "column_z": place(0.754_877_666_2, plan.grid.depth - plan.region.depth + 1),
            "width": plan.region.width,
            "depth": plan.region.depth,
        });
        let wish = json!({"op": "subscribe", "id": 1, "region": region, "max_rate": plan.max_rate});
        let sent = socket.send(Message::text(wish.to_string())).await;
        sent.map_err(|_| "connection lost".to_owned())?;
        loop {
            let message = next(&mut socket).await?;
            if self.take(&message, false)?.is_some_and(|told| !told.more) {
                return Ok(socket);
            }
        }
    }

    /// Reads until the newest state that anybody had seen when it began.
    async fn catch_up(&mut self, socket: &mut Socket) -> Result<(), String> {
        let newest = self.shared.newest[self.tally.session].load(Ordering::Relaxed);
        let mut messages = 0;
        loop {
            let message = next(socket).await?;
            if let Some(told) = self.take(&message, false)? {
                messages += 1;
                if told.seq >= newest && !told.more {
                    self.tally.catch_up = Some(messages);
                    return Ok(());
                }
            }
        }
    }

    /// Counts a message; `timed`, where its latency counts too.
    fn take(&mut self, message: &Message, timed: bool) -> Result<Option<Told>, String> {
        let arrival = Instant::now();
        let told = match message::read(message) {
            Some(Content::Heights(told)) => told,
            Some(Content::Refused(status)) => return Err(format!("refused with {status}")),
            Some(_) => return Ok(None),
            None => return Err("a message that can't be read".to_owned()),
        };
        let shared = &self.shared;
        shared.newest[self.tally.session].fetch_max(told.seq, Ordering::Relaxed);
        let new = told.tick > self.newest_tick && !told.more;
        self.newest_tick = self.newest_tick.max(told.tick);
        if shared.counting.load(Ordering::Relaxed) {
            let bytes = message.len() as u64;
            self.tally.messages += 1;
            shared.messages.fetch_add(1, Ordering::Relaxed);
            shared.bytes.fetch_add(bytes, Ordering::Relaxed);
            if !told.snapshot {
                self.tally.bytes += bytes;
                self.tally.columns += told.columns;
                if new && timed {
                    let at = arrival.duration_since(shared.zero).as_secs_f64();
                    self.tally.arrivals.note(at - told.tick as f64 * self.period);
                }
            }
        }
        Ok(Some(told))
    }
}

/// Counts a client as arrived when it is dropped, connected or not.
struct Arrival(Arc<Shared>);

impl Drop for Arrival {
    fn drop(&mut self) {
        self.0.arrived.fetch_add(1, Ordering::Relaxed);
    }
}
