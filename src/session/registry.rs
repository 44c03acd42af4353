//! All sessions of the server, by name.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use firn_engine::frame::DeviceInfo;
use firn_engine::made::Maker;
use firn_protocol::SessionSpec;
use firn_snow::Grid;
use tokio::sync::{Semaphore, mpsc};

use crate::core::record::{Done, DoneResult, Once};
use crate::core::session::{Check, Limits, Receipted, SessionError, Simulation};
use crate::core::snapshot::Snapshot;
use crate::core::vitals::Vitals;
use crate::core::{Control, Creation, Fault, Input};
use crate::journal::StoreKeeper;
use crate::journal::keyed::KeyedRequests;
use crate::session::handle::Session;
use crate::session::names::{Names, Place};
use crate::session::requests::{ask, blocking};
use crate::session::tenants::Tenants;
use crate::session::token::Tokens;
use crate::session::visit::Visit;

/// Snapshots that are decoded, and large sessions that are made, at the same time: each may take as much
/// memory as a whole session.
pub(crate) const DECODED_AT_ONCE: usize = 2;

/// Columns of which a snowpack is made in no time.
const FEW_COLUMNS: u64 = 1 << 16;

/// Whether making a snowpack takes so long that it needs a thread of its own.
fn is_large(grid: &Grid) -> bool {
    grid.padded_columns() > FEW_COLUMNS
}

/// Every session of the server. Clones are handles to the same.
#[derive(Clone, Debug)]
pub struct Sessions {
    pub(crate) names: Arc<Names>,
    tenants: Tenants,
    pub(crate) world: mpsc::Sender<Input>,
    vitals: Arc<Vitals>,
    pub(crate) frames: Arc<AtomicU64>,
    limits: Limits,
    /// The next session's key.
    pub(crate) keys: Arc<AtomicU64>,
    /// No more sessions are made.
    closed: Arc<AtomicBool>,
    /// Snapshots that may still be decoded at the same time.
    pub(crate) decoding: Arc<Semaphore>,
    /// Requests that are carried out once.
    pub(crate) keyed: Arc<KeyedRequests>,
    /// Makes snowpacks, which the world takes in.
    pub(crate) maker: Maker,
    /// What is kept of all of them.
    pub(crate) store: StoreKeeper,
}

impl Sessions {
    pub(crate) fn new(
        names: Arc<Names>,
        world: mpsc::Sender<Input>,
        vitals: Arc<Vitals>,
        frames: Arc<AtomicU64>,
        keyed: Arc<KeyedRequests>,
        limits: Limits,
        maker: Maker,
    ) -> Sessions {
        let (keys, closed) = (Arc::default(), Arc::default());
        let decoding = Arc::new(Semaphore::new(DECODED_AT_ONCE));
        let tenants = Tenants::default();
        Sessions {
            names,
            tenants,
            world,
            vitals,
            frames,
            limits,
            keys,
            closed,
            decoding,
            keyed,
            maker,
            store: StoreKeeper::default(),
        }
    }

    /// Breaks something, for tests of what happens then.
    #[doc(hidden)]
    pub async fn sabotage(&self, fault: Fault) {
        // The world may have ended.
        let _ = self.world.send(Input::Break(fault)).await;
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
        self.create_once(spec, None, None).await
    }

    /// As [`Sessions::create`], for a tenant where one is named; where the request was carried out
    /// before, the session that it made.
    ///
    /// # Errors
    /// As [`Sessions::create`], and [`SessionError::QuotaReached`].
    pub async fn create_once(
        &self,
        spec: SessionSpec,
        tenant: Option<&str>,
        once: Option<Once>,
    ) -> Result<(Arc<Session>, Tokens), SessionError> {
        self.admit()?;
        if let Some(made) = self.made_before(once.as_ref()) {
            return made;
        }
        self.limits.check(&spec)?;
        let tenant = tenant.map(|name| self.tenants.named(name));
        let (names, id) = (self.names.clone(), spec.id.clone());
        let place = Place::reserve(names, id, tenant, &spec, &self.limits)?;
        self.make(place, spec, None, once).await
    }

    /// Creates a session from a snapshot, under a name or a new ULID, for a tenant where one is named;
    /// where the request was carried out before, the session that it made.
    ///
    /// # Errors
    /// As [`Sessions::create_once`]; a snapshot that is damaged or foreign is invalid.
    pub async fn restore(
        &self,
        bytes: Arc<[u8]>,
        id: Option<String>,
        tenant: Option<&str>,
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
        let tenant = tenant.map(|name| self.tenants.named(name));
        let (snapshot, place) = blocking(move || {
            let _permit = permit;
            Snapshot::decode_admitted(&copy, &limits, |spec| {
                Place::reserve(names, id, tenant, spec, &limits)
            })
        })
        .await?;
        self.make(place, snapshot.spec().clone(), Some((bytes, Box::new(snapshot))), once).await
    }

    /// Requests that are carried out once.
    pub fn keyed(&self) -> &Arc<KeyedRequests> {
        &self.keyed
    }

    /// The session that a request made when it was carried out, if it was.
    fn made_before(
        &self,
        once: Option<&Once>,
    ) -> Option<Result<(Arc<Session>, Tokens), SessionError>> {
        let once = once?;
        let done = self.keyed.find(&once.key)?;
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
        self.recovering().map_or(Ok(()), Err)
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
        let now = self.keyed.now();
        let done = once.map(|once| Done::created(&once, &place.id, &tokens, now));
        let done = done.transpose().map_err(no_random)?.map(Arc::new);
        let (origin, saved) = saved.unzip();
        let (sessions, hashes, large) = (self.clone(), tokens.hashes(), is_large(&spec.grid));
        let (id, tenant) = (place.id.clone(), place.tenant.clone());
        let make = move || {
            let session = Session::new(&sessions, id, tenant.as_deref(), spec, origin, hashes)?;
            let made = sessions.maker.make(Simulation::layout(&session.spec))?;
            Ok((Arc::new(session), made))
        };
        let (session, made) = if large {
            let permit = self.decoding.clone().acquire_owned().await;
            blocking(move || {
                let _permit = permit;
                make()
            })
            .await?
        } else {
            make()?
        };
        let create = |reply| {
            let creation = Creation { session: session.outlet.clone(), saved, done, reply };
            Input::Create { creation, made }
        };
        let Receipted { position, .. } = ask(&self.world, None, create).await?;
        session.receipts.wait(position).await?;
        place.keep(session.clone());
        Ok((session, tokens))
    }

    /// A session by its name, for who uses it.
    ///
    /// # Errors
    /// [`SessionError::NotFound`]; [`SessionError::Unavailable`] while sessions are brought back.
    pub fn get(&self, id: &str) -> Result<Visit, SessionError> {
        let session = self.peek(id).ok_or_else(|| self.absence(id))?;
        Ok(self.visit(session))
    }

    /// Begins a use of a session.
    pub fn visit(&self, session: Arc<Session>) -> Visit {
        let session = Visit::begin(session);
        if session.hibernating.load(Ordering::SeqCst) {
            // A queue that is full wakes it with what is asked for next.
            let _ =
                self.world.try_send(Input::Control { key: session.key, control: Control::Wake });
        }
        session
    }

    /// A session by its name, without being a use of it.
    pub fn peek(&self, id: &str) -> Option<Arc<Session>> {
        self.names.get(id)
    }

    /// The error for a name without a session: [`SessionError::NotFound`], or [`SessionError::Unavailable`] while
    /// sessions are brought back and this may be one of them.
    pub fn absence(&self, id: &str) -> SessionError {
        let unknown = || SessionError::NotFound { kind: "session", id: id.to_owned() };
        self.recovering().unwrap_or_else(unknown)
    }

    /// Why nobody can say yet whether there is a session, if that is so: sessions are being brought
    /// back.
    pub fn recovering(&self) -> Option<SessionError> {
        (!self.vitals.is_recovered()).then(|| {
            let why = "sessions are being brought back; /readyz says when".to_owned();
            SessionError::Unavailable(why)
        })
    }

    /// Up to `limit` sessions in ascending order of their names, those after `after`; one tenant's
    /// where one is named. No others are looked at.
    pub fn list(
        &self,
        tenant: Option<&str>,
        after: Option<&str>,
        limit: usize,
    ) -> Vec<Arc<Session>> {
        self.names.list(tenant, after, limit)
    }

    /// Deletes a session; its device memory is free when this returns.
    ///
    /// # Errors
    /// [`SessionError::NotFound`].
    pub async fn delete(&self, session: &Session) -> Result<(), SessionError> {
        // It is not woken for that.
        session.control(Control::Delete).await
    }

    /// How many sessions there are.
    pub fn count(&self) -> usize {
        self.names.count()
    }

    /// Whom sessions belong to.
    pub fn tenants(&self) -> &Tenants {
        &self.tenants
    }

    /// What is kept of all of them.
    pub fn store(&self) -> &StoreKeeper {
        &self.store
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
