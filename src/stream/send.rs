//! The half of a stream that speaks: answers, events, heights, and pings.
//!
//! Heights wait nowhere: a subscription knows what its client has seen, and copies the newest state
//! when the client can take it. So a slow client costs no memory and delays nobody.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::extract::ws::Message;
use firn_protocol::stream::{Cause, SubProtocol};
use firn_protocol::{Event, Stamp, Subscribe, Update};
use futures_util::sink::{Sink, SinkExt};
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{broadcast, mpsc};
use tokio::time::{Instant, MissedTickBehavior, interval_at, sleep_until, timeout};

use crate::budget::Budget;
use crate::metrics::Carried;
use crate::session::{Applied, Invalid, Publication, Session, SessionError};

use super::answer::{self, Answer};
use super::cache::EncodedTiles;
use super::cause::cause_of;
use super::memory::OpenStream;
use super::receive::Next;
use super::request::Control;
use super::subscription::{Cost, Source, Subscription};

/// Time between pings.
const PING_EVERY: Duration = Duration::from_secs(15);

/// Time until heights are tried again that found no memory.
const NO_ROOM: Duration = Duration::from_millis(100);

/// Subscriptions of one client.
const MOST_SUBSCRIPTIONS: usize = 64;

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
    let mut events = session.events();
    let mut publications = session.publications();
    let mut pings = interval_at(Instant::now() + PING_EVERY, PING_EVERY);
    pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let encoded: Arc<EncodedTiles> = session.companion();
    let mut speaker = Speaker {
        sink,
        session,
        manner,
        memory: encoded.open(),
        encoded,
        subscriptions: Vec::new(),
        marked: publications.borrow_and_update().number,
    };
    if let Err(cause) = speaker.say(answer::welcome(session)).await {
        return cause;
    }
    loop {
        let due = speaker.subscriptions.iter().filter_map(Subscription::due).min();
        let said = tokio::select! {
            next = answers.recv() => match next {
                Some(Next::Text(text)) => speaker.say(text).await,
                Some(Next::Read(text, _leave)) => speaker.say(text).await,
                Some(Next::Control(control)) => speaker.control(control).await,
                None => Err(Cause::Broken),
            },
            event = events.recv() => speaker.tell(event).await,
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
    encoded: Arc<EncodedTiles>,
    memory: OpenStream,
    subscriptions: Vec<Subscription>,
    /// Number of the newest publication that was noted.
    marked: u64,
}

impl<W: Sink<Message, Error = axum::Error> + Unpin> Speaker<'_, W> {
    async fn write(&mut self, message: Message) -> Result<(), Cause> {
        self.memory.writes(payload(&message));
        self.manner.writing.store(true, Ordering::Relaxed);
        let written = timeout(self.manner.patience, self.sink.send(message)).await;
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

    async fn tell(&mut self, event: Result<Event, RecvError>) -> Result<(), Cause> {
        match event {
            Ok(event) => self.say(Answer::Event(&event).encode()).await,
            // The client was too slow for some events. They are told live only.
            Err(broadcast::error::RecvError::Lagged(_)) => Ok(()),
            Err(broadcast::error::RecvError::Closed) => Err(Cause::Deleted),
        }
    }

    /// Carries out a request about the stream itself.
    async fn control(&mut self, control: Control) -> Result<(), Cause> {
        let (id, done) = match control {
            Control::Ping(id) => return self.say(Answer::Pong { id }.encode()).await,
            Control::Subscribe(id, wish) => match self.subscribe(id, &wish) {
                // The snapshot is the answer.
                Ok(()) => return Ok(()),
                Err(error) => (id, Err(error)),
            },
            Control::Update(id, update) => (id, self.move_view(id, update)),
            Control::Unsubscribe(id) => (id, self.unsubscribe(id)),
        };
        let done = done.map(|()| Applied::Stamp(self.stamp()));
        self.say(answer::outcome(id, "", done)).await
    }

    /// Notes a publication. Those since the one before came and went while the client, or the
    /// server, was busy.
    fn mark(&mut self, newest: Publication) {
        if !self.subscriptions.is_empty() {
            self.manner.carried.conflated(newest.number.saturating_sub(self.marked + 1));
        }
        self.marked = newest.number;
        for subscription in &mut self.subscriptions {
            subscription.mark(newest.tick);
        }
    }

    fn stamp(&self) -> Stamp {
        self.session.mirror().stamp_at(self.session.frame())
    }

    fn subscribe(&mut self, id: i64, wish: &Subscribe) -> Result<(), SessionError> {
        let known = self.subscriptions.iter().position(|subscription| subscription.id() == id);
        if known.is_none() && self.subscriptions.len() >= MOST_SUBSCRIPTIONS {
            let detail = format!(
                "the stream has {MOST_SUBSCRIPTIONS} subscriptions already, the most it may"
            );
            return Err(SessionError::Invalid(vec![Invalid::new("/id", detail)]));
        }
        let source = Source {
            grid: self.session.spec.grid,
            recovers: &|resume| self.session.recovers(&resume.epoch, resume.seq),
            protocol: self.manner.protocol,
            encoded: &self.encoded,
        };
        let new = Subscription::new(id, wish, source, Instant::now())?;
        match known {
            Some(place) => self.subscriptions[place] = new,
            None => self.subscriptions.push(new),
        }
        Ok(())
    }

    fn move_view(&mut self, id: i64, update: Update) -> Result<(), SessionError> {
        let place = self.known(id)?;
        self.subscriptions[place].move_to(update.region)
    }

    fn unsubscribe(&mut self, id: i64) -> Result<(), SessionError> {
        let place = self.known(id)?;
        self.subscriptions.remove(place);
        Ok(())
    }

    fn known(&self, id: i64) -> Result<usize, SessionError> {
        self.subscriptions
            .iter()
            .position(|subscription| subscription.id() == id)
            .ok_or_else(|| SessionError::NotFound { kind: "subscription", id: id.to_string() })
    }

    /// Sends what is due.
    async fn update(&mut self) -> Result<(), Cause> {
        for place in 0..self.subscriptions.len() {
            let now = Instant::now();
            let subscription = &mut self.subscriptions[place];
            if subscription.due().is_none_or(|due| due > now) {
                continue;
            }
            let frame = self.session.frame();
            let unsent = self.manner.unsent;
            let Some(copied) = subscription.copy(&self.session.mirror(), frame, unsent) else {
                subscription.put_off(now + NO_ROOM);
                continue;
            };
            let Some(parts) = subscription.message(copied, now) else { continue };
            let Cost { tiles, encoded } = subscription.cost();
            self.manner.carried.tiles(tiles, encoded);
            for part in parts {
                let bytes = payload(&part);
                self.write(part).await?;
                self.manner.carried.message(bytes);
            }
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
