//! A viewer: watches a region and counts what it is told.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use firn_client::{Client, Raw, Stream};
use firn_protocol::stream::SubProtocol;
use firn_protocol::{ColumnRegion, Subscribe};

use super::api::cause;
use super::message::{self, Content, Told};
use super::tally::Tally;
use super::{Plan, Shared};

/// Opens a stream.
///
/// # Errors
/// Why there is none.
pub async fn open(client: &Client, id: &str, protocol: SubProtocol) -> Result<Stream, String> {
    let opened = async { client.session(id)?.stream(protocol).await };
    opened.await.map_err(|error| cause(&error))
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
        let mut stream = tokio::select! {
            biased;
            () = shared.end.cancelled() => return Ok(()),
            stream = self.enter(plan, number, id) => stream?,
        };
        loop {
            let message = tokio::select! {
                biased;
                () = shared.end.cancelled() => break,
                message = stream.next_raw() => message.map_err(|error| cause(&error))?,
            };
            self.take(&message, number >= plan.slow_clients)?;
        }
        stream.close().await;
        Ok(())
    }

    /// Subscribes; a slow client stalls then, and catches up.
    async fn enter(&mut self, plan: &Plan, number: usize, id: &str) -> Result<Stream, String> {
        let arrived = Arrival(self.shared.clone());
        let mut stream = self.subscribe(plan, number, id).await?;
        self.shared.connected.fetch_add(1, Ordering::Relaxed);
        drop(arrived);
        if number < plan.slow_clients {
            self.shared.begin.clone().cancelled().await;
            tokio::time::sleep(plan.stall).await;
            self.catch_up(&mut stream).await?;
        }
        Ok(stream)
    }

    /// Connects, and waits for the first heights.
    async fn subscribe(&mut self, plan: &Plan, number: usize, id: &str) -> Result<Stream, String> {
        let shared = self.shared.clone();
        let turn = shared.connecting.acquire().await;
        let _turn = turn.map_err(|_| "not connected".to_owned())?;
        let mut stream = open(&shared.client, id, plan.protocol).await?;
        // Scattered evenly: multiples of the golden ratio and its square leave no gaps.
        let place =
            |ratio: f64, room: u32| ((number as f64 * ratio).fract() * f64::from(room)) as i64;
        let region = ColumnRegion {
            column_x: place(0.618_033_988_7, plan.grid.width - plan.region.width + 1),
            column_z: place(0.754_877_666_2, plan.grid.depth - plan.region.depth + 1),
            width: plan.region.width.into(),
            depth: plan.region.depth.into(),
        };
        let (region, max_rate) = (Some(region), plan.max_rate);
        let wish = Subscribe { region, max_rate, ..Subscribe::default() };
        stream.subscribe(wish).await.map_err(|error| cause(&error))?;
        loop {
            let message = stream.next_raw().await.map_err(|error| cause(&error))?;
            if self.take(&message, false)?.is_some_and(|told| !told.more) {
                return Ok(stream);
            }
        }
    }

    /// Reads until the newest state that anybody had seen when it began.
    async fn catch_up(&mut self, stream: &mut Stream) -> Result<(), String> {
        let newest = self.shared.newest[self.tally.session].load(Ordering::Relaxed);
        let mut messages = 0;
        loop {
            let message = stream.next_raw().await.map_err(|error| cause(&error))?;
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
    fn take(&mut self, message: &Raw, timed: bool) -> Result<Option<Told>, String> {
        let arrival = Instant::now();
        let told = match message::read(message) {
            Some(Content::Heights(told)) => told,
            Some(Content::Refused(status)) => {
                return Err(format!("refused with {status}"));
            }
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
