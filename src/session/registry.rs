//! All sessions of the server, by name.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use tokio::sync::{Semaphore, mpsc};

use crate::engine::frame::DeviceInfo;

use super::error::{Check, SessionError};
use super::handle::Session;
use super::idempotency::RequestKey;
use super::message::{self, Message};
use super::names::{Names, Place};
use super::once::{Answered, Done, DoneResult, Once};
use super::requests::blocking;
use super::snapshot::Snapshot;
use super::spec::{Limits, SessionSpec};
use super::token::Tokens;
use super::visit::Visit;
use super::vitals::Vitals;
use super::world::Fault;

/// Snapshots that are decoded at the same time: each may take as much memory as a whole session.
const DECODED_AT_ONCE: usize = 2;

/// Sums over all sessions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Tiles in which snow moves.
    pub active_tiles: u64,
    /// Tiles.
    pub tiles: u64,
    /// Device memory that their cells take \[bytes\].
    pub device_memory: u64,
}

/// Every session of the server. Clones are handles to the same.
#[derive(Clone, Debug)]
pub struct Sessions {
    names: Arc<Names>,
    pub(super) world: mpsc::Sender<Message>,
    vitals: Arc<Vitals>,
    pub(super) frames: Arc<AtomicU64>,
    limits: Limits,
    /// The next session's key.
    pub(super) keys: Arc<AtomicU64>,
    /// No more sessions are made.
    closed: Arc<AtomicBool>,
    /// Snapshots that may still be decoded at the same time.
    pub(super) decoding: Arc<Semaphore>,
    /// Requests that are not carried out again.
    pub(super) answered: Arc<Answered>,
}

impl Sessions {
    pub(super) fn new(
        names: Arc<Names>,
        world: mpsc::Sender<Message>,
        vitals: Arc<Vitals>,
        frames: Arc<AtomicU64>,
        answered: Arc<Answered>,
        limits: Limits,
    ) -> Sessions {
        let (keys, closed) = (Arc::default(), Arc::default());
        let decoding = Arc::new(Semaphore::new(DECODED_AT_ONCE));
        Sessions { names, world, vitals, frames, limits, keys, closed, decoding, answered }
    }

    /// Breaks something, for tests of what happens then.
    #[doc(hidden)]
    pub async fn sabotage(&self, fault: Fault) {
        // The world may have ended.
        let _ = self.world.send(Message::Break(fault)).await;
    }

    /// Makes no more sessions: the server is about to stop.
    pub fn close(&self) {
        self.closed.store(true, Ordering::Relaxed);
    }

    /// Creates a session; returns when its first state is published.
    ///
    /// # Errors
    /// [`SessionError::Invalid`], [`SessionError::Conflict`] where the name is taken,
    /// [`SessionError::ServerFull`], [`SessionError::OutOfMemory`], and
    /// [`SessionError::Unavailable`] while the server starts or stops.
    pub async fn create(&self, spec: SessionSpec) -> Result<(Arc<Session>, Tokens), SessionError> {
        self.create_once(spec, None).await
    }

    /// As [`Sessions::create`]; where the request was carried out before, the session that it made.
    ///
    /// # Errors
    /// As [`Sessions::create`].
    pub async fn create_once(
        &self,
        spec: SessionSpec,
        once: Option<Once>,
    ) -> Result<(Arc<Session>, Tokens), SessionError> {
        self.admit()?;
        if let Some(made) = self.made_before(once.as_ref()) {
            return made;
        }
        spec.check(&self.limits)?;
        let place = Place::reserve(self.names.clone(), spec.id.clone(), &spec, &self.limits)?;
        self.make(place, spec, None, once).await
    }

    /// Creates a session from a snapshot, under a name or a new ULID; where the request was
    /// carried out before, the session that it made.
    ///
    /// # Errors
    /// As [`Sessions::create`]; a snapshot that is damaged or foreign is invalid.
    pub async fn restore(
        &self,
        bytes: Arc<[u8]>,
        id: Option<String>,
        once: Option<Once>,
    ) -> Result<(Arc<Session>, Tokens), SessionError> {
        self.admit()?;
        if let Some(made) = self.made_before(once.as_ref()) {
            return made;
        }
        let mut check = Check::default();
        if let Some(id) = &id {
            check.id("id", id);
        }
        check.finish()?;
        let permit = self.decoding.clone().acquire_owned().await;
        let (copy, limits, names) = (bytes.clone(), self.limits, self.names.clone());
        let (snapshot, place) = blocking(move || {
            let _permit = permit;
            Snapshot::decode_admitted(&copy, &limits, |spec| {
                Place::reserve(names, id, spec, &limits)
            })
        })
        .await?;
        self.make(place, snapshot.spec().clone(), Some((bytes, Box::new(snapshot))), once).await
    }

    /// What a request says that was carried out lately.
    pub fn asked_before(&self, key: &RequestKey) -> Option<[u8; 32]> {
        self.answered.find(key).map(|done| done.request)
    }

    /// The session that a request made when it was carried out, if it was.
    fn made_before(
        &self,
        once: Option<&Once>,
    ) -> Option<Result<(Arc<Session>, Tokens), SessionError>> {
        let once = once?;
        let done = self.answered.find(&once.key)?;
        let DoneResult::Created { id, tokens } = &done.result else { return None };
        let tokens = tokens.open(&once.secret).ok_or_else(|| {
            SessionError::Conflict(format!(
                "this request made the session '{id}' before; its tokens are only told to who has \
                 the API key that it was made with"
            ))
        });
        Some(self.get(id).and_then(|session| Ok((Arc::clone(&session), tokens?))))
    }

    /// Whether sessions may be made now.
    fn admit(&self) -> Result<(), SessionError> {
        if self.closed.load(Ordering::Relaxed) {
            return Err(SessionError::Unavailable("the server is stopping".to_owned()));
        }
        if self.vitals.is_recovered() { Ok(()) } else { Err(recovering()) }
    }

    async fn make(
        &self,
        place: Place,
        spec: SessionSpec,
        saved: Option<(Arc<[u8]>, Box<Snapshot>)>,
        once: Option<Once>,
    ) -> Result<(Arc<Session>, Tokens), SessionError> {
        let no_random = |e| SessionError::Internal(format!("no random numbers for tokens: {e}"));
        let tokens = Tokens::generate().map_err(no_random)?;
        let done = once.map(|once| Done::created(&once, &place.id, &tokens));
        let done = done.transpose().map_err(no_random)?.map(Arc::new);
        let (origin, saved) = saved.unzip();
        let id = place.id.clone();
        let session = Arc::new(Session::new(self, id, spec, origin, tokens.hashes()));
        let made = session.clone();
        message::ask(&self.world, |reply| Message::Create { session: made, saved, done, reply })
            .await?;
        place.keep(session.clone());
        Ok((session, tokens))
    }

    /// A session by its name, for who uses it.
    ///
    /// # Errors
    /// [`SessionError::NotFound`]; [`SessionError::Unavailable`] while sessions are brought back.
    pub fn get(&self, id: &str) -> Result<Visit, SessionError> {
        let unknown = || SessionError::NotFound { kind: "session", id: id.to_owned() };
        let session = Visit::begin(self.find(id)?.ok_or_else(unknown)?);
        if session.hibernating.load(Ordering::SeqCst) {
            // A queue that is full wakes it with what is asked for next.
            let _ = self.world.try_send(Message::Wake { key: session.key });
        }
        Ok(session)
    }

    /// A session by its name, without being a use of it.
    pub fn peek(&self, id: &str) -> Option<Arc<Session>> {
        self.names.get(id)
    }

    /// As [`Sessions::peek`], for who tells others that there is no such session.
    ///
    /// # Errors
    /// [`SessionError::Unavailable`] while sessions are brought back and it may be one of them.
    pub fn find(&self, id: &str) -> Result<Option<Arc<Session>>, SessionError> {
        match self.peek(id) {
            None if !self.vitals.is_recovered() => Err(recovering()),
            found => Ok(found),
        }
    }

    /// Up to `limit` sessions in ascending order of their names, those after `after`.
    pub fn list(&self, after: Option<&str>, limit: usize) -> Vec<Arc<Session>> {
        self.names.list(after, limit)
    }

    /// Deletes a session; its device memory is free when this returns.
    ///
    /// # Errors
    /// [`SessionError::NotFound`].
    pub async fn delete(&self, id: &str) -> Result<(), SessionError> {
        // It is not woken for that.
        let unknown = || SessionError::NotFound { kind: "session", id: id.to_owned() };
        let session = self.find(id)?.ok_or_else(unknown)?;
        message::ask(&self.world, |reply| Message::Delete { key: session.key, reply }).await
    }

    /// How many sessions there are.
    pub fn count(&self) -> usize {
        self.names.count()
    }

    /// Sums over all sessions.
    pub fn totals(&self) -> Totals {
        let mut totals = Totals::default();
        for session in self.names.list(None, usize::MAX) {
            totals.active_tiles += u64::from(session.mirror().active_tiles);
            totals.tiles += u64::from(session.spec.grid.tiles());
            totals.device_memory += session.device_memory();
        }
        totals
    }

    /// The server's limits.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// The device the snowpacks live on.
    pub fn device(&self) -> &DeviceInfo {
        &self.vitals.device
    }

    /// How the engine is doing.
    pub fn vitals(&self) -> &Vitals {
        &self.vitals
    }
}

fn recovering() -> SessionError {
    SessionError::Unavailable("sessions are being brought back; /readyz says when".to_owned())
}
