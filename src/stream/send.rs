//! The half of a stream that speaks: answers, events, heights, and pings.
//!
//! Heights wait nowhere: a subscription knows what its client has seen, and copies the newest state
//! when the client can take it. Of events, one of each kind waits. So a slow client costs next to no
//! memory and delays nobody.

use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::extract::ws::Message;
use firn_protocol::Event;
use firn_protocol::stream::{Cause, SubProtocol};
use futures_util::future::FutureExt;
use futures_util::sink::{Sink, SinkExt};
use tokio::sync::{broadcast, mpsc};
use tokio::time::{Instant, MissedTickBehavior, interval_at, sleep_until, timeout};

use crate::budget::Budget;
use crate::metrics::Carried;
use crate::session::{Applied, Happening, Publication, Session};

use super::answer::{self, Answer};
use super::cache::EncodedTiles;
use super::cause::cause_of;
use super::interest::Interest;
use super::memory::OpenStream;
use super::receive::Next;
use super::request::Control;
use super::subscription::Cost;

/// Time between pings.
const PING_EVERY: Duration = Duration::from_secs(15);

/// Time until heights are tried again that found no memory.
const NO_ROOM: Duration = Duration::from_millis(100);

/// How a client is spoken to.
#[derive(Debug)]
pub struct Manner<'a> {
    /// The sub-protocol.
    pub protocol: SubProtocol,
    /// Longest time that one message may take to be written.
    pub patience: Duration,
    /// Set while a message is being written.
    pub writing: &'a AtomicBool,
    /// Counts what heights it is sent.
    pub carried: Carried,
    /// Memory of what clients have not taken yet.
    pub unsent: &'a Budget,
}

/// Speaks to a client until the stream ends.
pub async fn send<W>(
    sink: &mut W,
    session: &Session,
    mut answers: mpsc::Receiver<Next>,
    manner: Manner<'_>,
) -> Cause
where
    W: Sink<Message, Error = axum::Error> + Unpin,
{
    // What happens after the client was greeted is not missed.
    let events = session.events();
    let mut publications = session.publications();
    let mut pings = interval_at(Instant::now() + PING_EVERY, PING_EVERY);
    pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let encoded: Arc<EncodedTiles> = session.companion();
    let (stamp, settings) = {
        let mirror = session.mirror();
        (mirror.stamp_at(session.frame()), mirror.settings)
    };
    let mut speaker = Speaker {
        sink,
        session,
        memory: encoded.open(),
        events,
        interest: Interest::new(session, manner.protocol, encoded, settings),
        manner,
        marked: publications.borrow_and_update().number,
    };
    if let Err(cause) = speaker.say(answer::welcome(session, stamp, settings)).await {
        return cause;
    }
    loop {
        let unasked = speaker.interest.unasked();
        if let Err(cause) = speaker.tell(&unasked).await {
            return cause;
        }
        let due = speaker.interest.due();
        let said = tokio::select! {
            next = answers.recv() => match next {
                Some(Next::Text(text)) => speaker.say(text).await,
                Some(Next::Read(text, _leave)) => speaker.say(text).await,
                Some(Next::Control(control)) => speaker.control(control).await,
                None => Err(Cause::Broken),
            },
            happened = speaker.events.recv() => speaker.interest.hear(happened),
            _ = pings.tick() => speaker.write(Message::Ping(Vec::new().into())).await,
            changed = publications.changed() => {
                speaker.mark(*publications.borrow_and_update());
                changed.map_err(|_| Cause::Deleted)
            }
            () = sleep_until(due.unwrap_or_else(Instant::now)), if due.is_some() => {
                speaker.update().await
            }
        };
        if let Err(cause) = said {
            return cause;
        }
    }
}

struct Speaker<'a, W> {
    sink: &'a mut W,
    session: &'a Session,
    manner: Manner<'a>,
    memory: OpenStream,
    events: broadcast::Receiver<Arc<[Happening]>>,
    interest: Interest<'a>,
    /// Number of the newest publication that was noted.
    marked: u64,
}

impl<W: Sink<Message, Error = axum::Error> + Unpin> Speaker<'_, W> {
    /// Writes a message. What happens meanwhile is noted, so that a slow client misses no event.
    async fn write(&mut self, message: Message) -> Result<(), Cause> {
        self.memory.writes(payload(&message));
        self.manner.writing.store(true, Ordering::Relaxed);
        let mut writing = pin!(timeout(self.manner.patience, self.sink.send(message)));
        let written = loop {
            tokio::select! {
                biased;
                written = &mut writing => break written,
                happened = self.events.recv() => self.interest.hear(happened)?,
            }
        };
        self.manner.writing.store(false, Ordering::Relaxed);
        self.memory.writes(0);
        match written {
            Ok(written) => written.map_err(cause_of),
            Err(_) => Err(Cause::TooSlow),
        }
    }

    async fn say(&mut self, text: String) -> Result<(), Cause> {
        self.write(Message::Text(text.into())).await
    }

    async fn tell(&mut self, events: &[Event]) -> Result<(), Cause> {
        for event in events {
            self.say(Answer::Event(event).encode()).await?;
        }
        Ok(())
    }

    /// Carries out a request about the stream itself.
    async fn control(&mut self, control: Control) -> Result<(), Cause> {
        let (id, done) = match control {
            Control::Ping(id) => return self.say(Answer::Pong { id }.encode()).await,
            Control::Subscribe(id, wish) => match self.interest.subscribe(id, &wish) {
                // The snapshot is the answer.
                Ok(()) => return Ok(()),
                Err(error) => (id, Err(error)),
            },
            Control::Update(id, update) => (id, self.interest.update(id, update)),
            Control::Unsubscribe(id) => (id, self.interest.unsubscribe(id)),
        };
        let stamp = self.session.mirror().stamp_at(self.session.frame());
        self.say(answer::outcome(id, "", done.map(|()| Applied::Stamp(stamp)))).await
    }

    /// Notes a publication. Those since the one before came and went while the client, or the
    /// server, was busy.
    fn mark(&mut self, newest: Publication) {
        if !self.interest.subscriptions.is_empty() {
            self.manner.carried.conflated(newest.number.saturating_sub(self.marked + 1));
        }
        self.marked = newest.number;
        for subscription in &mut self.interest.subscriptions {
            subscription.mark(newest.tick);
        }
    }

    /// Sends what is due, with events that are there already.
    async fn update(&mut self) -> Result<(), Cause> {
        while let Some(happened) = self.events.recv().now_or_never() {
            self.interest.hear(happened)?;
        }
        for place in 0..self.interest.subscriptions.len() {
            let now = Instant::now();
            let subscription = &mut self.interest.subscriptions[place];
            if subscription.due().is_none_or(|due| due > now) {
                continue;
            }
            let frame = self.session.frame();
            let unsent = self.manner.unsent;
            let Some(mut copied) = subscription.copy(&self.session.mirror(), frame, unsent) else {
                subscription.put_off(now + NO_ROOM);
                continue;
            };
            let mut events = self.interest.waiting.take(|happening| subscription.wants(happening));
            events.append(&mut copied.crossings);
            let Some(parts) = subscription.message(copied, now) else {
                if !events.is_empty() {
                    subscription.take_turn(now);
                    self.tell(&events).await?;
                }
                continue;
            };
            let Cost { tiles, encoded } = subscription.cost();
            self.manner.carried.tiles(tiles, encoded);
            for part in parts {
                let bytes = payload(&part);
                self.write(part).await?;
                self.manner.carried.message(bytes);
            }
            self.tell(&events).await?;
        }
        Ok(())
    }
}

/// Length of what a message tells \[bytes\].
fn payload(message: &Message) -> usize {
    match message {
        Message::Text(text) => text.len(),
        Message::Binary(bytes) => bytes.len(),
        Message::Ping(_) | Message::Pong(_) | Message::Close(_) => 0,
    }
}
