//! What a client wants to hear of, and what of that waits for its turn. No I/O.

use std::sync::Arc;

use firn_protocol::stream::{Cause, SubProtocol};
use firn_protocol::{Event, Settings, Subscribe, Update};
use tokio::sync::broadcast::error::RecvError;
use tokio::time::Instant;

use crate::session::{Happening, Invalid, Session, SessionError};

use super::cache::EncodedTiles;
use super::subscription::{Source, Subscription};
use super::waiting::Waiting;

/// Subscriptions of one client.
const MOST_SUBSCRIPTIONS: usize = 64;

/// A client's subscriptions, and the events that it has still to be told. An event is told once, however
/// many subscriptions want it: in the first turn of any of them.
pub struct Interest<'a> {
    session: &'a Session,
    protocol: SubProtocol,
    encoded: Arc<EncodedTiles>,
    /// Its subscriptions.
    pub subscriptions: Vec<Subscription>,
    /// Events that wait.
    pub waiting: Waiting,
    /// Settings that the client has heard of, or will.
    settings: Settings,
}

impl<'a> Interest<'a> {
    /// Of a client that has no subscription yet, and has just been told the settings.
    pub fn new(
        session: &'a Session,
        protocol: SubProtocol,
        encoded: Arc<EncodedTiles>,
        settings: Settings,
    ) -> Interest<'a> {
        let (subscriptions, waiting) = (Vec::new(), Waiting::default());
        Interest { session, protocol, encoded, subscriptions, waiting, settings }
    }

    /// When something is to be sent.
    pub fn due(&self) -> Option<Instant> {
        self.subscriptions.iter().filter_map(Subscription::due).min()
    }

    /// Takes in what has happened in a frame.
    ///
    /// # Errors
    /// Where nothing will happen any more.
    pub fn hear(&mut self, happened: Result<Arc<[Happening]>, RecvError>) -> Result<(), Cause> {
        match happened {
            Ok(happened) => happened.iter().for_each(|happening| self.note(happening.clone())),
            Err(RecvError::Lagged(_)) => self.catch_up(true),
            Err(RecvError::Closed) => return Err(Cause::Deleted),
        }
        Ok(())
    }

    fn note(&mut self, happening: Happening) {
        if !self.wants(&happening) {
            return;
        }
        if let Event::Settings { settings, .. } = happening.event {
            self.settings = settings;
        }
        let tick = happening.event.stamp().tick;
        let subscriptions = self.subscriptions.iter_mut();
        subscriptions.filter(|one| one.wants(&happening)).for_each(|one| one.mark(tick));
        self.waiting.add(happening);
    }

    /// Notes what is to be told of the present state, where events were missed: those that the server itself
    /// was too slow for, or only those that nobody wanted then.
    fn catch_up(&mut self, any: bool) {
        let (stamp, settings, settled) = {
            let mirror = self.session.mirror();
            (mirror.stamp_at(self.session.frame()), mirror.settings, mirror.settled)
        };
        if settings != self.settings {
            self.note(Event::Settings { stamp, settings }.into());
        }
        if any && settled {
            self.note(Event::Settled { stamp }.into());
        }
    }

    /// Whether the client wants to hear of something. As long as it has no subscription it hears all under
    /// `firn.v1.json`, and nothing under `firn.v1.bin`.
    fn wants(&self, happening: &Happening) -> bool {
        if self.subscriptions.is_empty() {
            self.protocol == SubProtocol::Json
        } else {
            self.subscriptions.iter().any(|subscription| subscription.wants(happening))
        }
    }

    /// Takes the events that are due without a turn: those of a client that has no subscription.
    pub fn unasked(&mut self) -> Vec<Event> {
        let all = self.subscriptions.is_empty();
        self.waiting.take(|_| all)
    }

    /// Begins a subscription, or replaces one.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn subscribe(&mut self, id: i64, wish: &Subscribe) -> Result<(), SessionError> {
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
            protocol: self.protocol,
            encoded: &self.encoded,
        };
        let new = Subscription::new(id, wish, source, Instant::now())?;
        match known {
            Some(place) => self.subscriptions[place] = new,
            None => self.subscriptions.push(new),
        }
        self.change();
        Ok(())
    }

    /// Changes a subscription.
    ///
    /// # Errors
    /// What is wrong with that.
    pub fn update(&mut self, id: i64, update: Update) -> Result<(), SessionError> {
        let place = self.known(id)?;
        self.subscriptions[place].update(update)?;
        self.change();
        Ok(())
    }

    /// Ends a subscription.
    ///
    /// # Errors
    /// Where there is no such.
    pub fn unsubscribe(&mut self, id: i64) -> Result<(), SessionError> {
        let place = self.known(id)?;
        self.subscriptions.remove(place);
        self.change();
        Ok(())
    }

    /// Drops what nobody wants any more, and has settings told that nobody wanted before.
    fn change(&mut self) {
        let mut waiting = std::mem::take(&mut self.waiting);
        waiting.keep(|happening| self.wants(happening));
        self.waiting = waiting;
        self.catch_up(false);
    }

    fn known(&self, id: i64) -> Result<usize, SessionError> {
        self.subscriptions
            .iter()
            .position(|subscription| subscription.id() == id)
            .ok_or_else(|| SessionError::NotFound { kind: "subscription", id: id.to_string() })
    }
}
