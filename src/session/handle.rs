//! A session as the rest of the server sees it.

use std::any::Any;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock, PoisonError, RwLock, RwLockReadGuard};
use std::time::Duration;

use firn_engine::frame::cell_bytes;
use firn_protocol::{Event, SessionSpec, SessionView, State};
use firn_snow::CELL;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, broadcast, mpsc, watch};
use tokio_util::sync::CancellationToken;
use ulid::Ulid;

use crate::machine;

use super::answer::WaitingRoom;
use super::clock::Clock;
use super::error::SessionError;
use super::journal::{Epochs, Identity, Weight};
use super::keyed::KeyedRequests;
use super::memory::Companion;
use super::message::Message;
use super::mirror::Mirror;
use super::publish::Publication;
use super::receipt::Receipts;
use super::registry::Sessions;
use super::snapshot::Snapshot;
use super::spec::Limits;
use super::tenant::Tenant;
use super::token::TokenHashes;

/// Events a stream client that is slower than this many of them loses the oldest.
pub(super) const EVENT_BACKLOG: usize = 64;

/// A session. Reads are served from its mirror; changes go to the world's thread.
#[derive(Debug)]
pub struct Session {
    /// Its name.
    pub id: String,
    /// Whom it belongs to: the operator where there is none.
    pub tenant: Option<Arc<Tenant>>,
    /// What it was created with.
    pub spec: SessionSpec,
    /// Names it in whatever outlives a server; fixed when it is created.
    pub sid: Ulid,
    /// Names what was published since the server was started: with `seq` it names one state.
    pub epoch: String,
    /// That epoch, and those before it.
    pub(super) epochs: Epochs,
    /// When it was created, RFC 3339.
    pub created_at: String,
    /// Hashes of its tokens; who may stay watches them.
    pub(super) tokens: watch::Sender<TokenHashes>,
    /// The snapshot that it was made from, where it was.
    pub(super) origin: Option<Arc<[u8]>>,
    pub(super) limits: Limits,
    pub(super) decoding: Arc<Semaphore>,
    /// Key in the world; never used twice.
    pub(super) key: u64,
    pub(super) mirror: RwLock<Mirror>,
    pub(super) published: watch::Sender<Publication>,
    pub(super) events: broadcast::Sender<Event>,
    pub(super) gone: CancellationToken,
    /// Its memory is freed, and its time stands still.
    pub(super) hibernating: AtomicBool,
    /// It takes no changes: see `lock.rs`.
    pub(super) locked: AtomicBool,
    /// Lowest and highest elevation of the ground \[m\].
    pub(super) ground: (f64, f64),
    /// Requests under way and streams.
    pub(super) visitors: AtomicU32,
    /// Frame in which somebody was last known to be with it.
    pub(super) last_used: AtomicU64,
    pub(super) waiting: WaitingRoom,
    /// Where requests wait for it to be durable.
    pub(super) receipts: Arc<Receipts>,
    /// The one place for a large answer that the world has to find.
    finding: Arc<Semaphore>,
    pub(super) world: mpsc::Sender<Message>,
    /// Device time that it has taken \[ns\].
    pub(super) device_ns: AtomicU64,
    /// Frames so far, of all sessions.
    pub(super) frames: Arc<AtomicU64>,
    pub(super) keyed: Arc<KeyedRequests>,
    /// Memory that the journal holds of it.
    pub(super) journal_weight: Weight,
    companion: OnceLock<Arc<dyn Companion>>,
}

impl Session {
    pub(super) fn new(
        sessions: &Sessions,
        id: String,
        tenant: Option<&Tenant>,
        spec: SessionSpec,
        origin: Option<Arc<[u8]>>,
        tokens: TokenHashes,
    ) -> Result<Session, SessionError> {
        let key = sessions.keys.fetch_add(1, Ordering::Relaxed);
        let identity = Identity {
            id,
            sid: machine::ulid(),
            created_at: humantime::format_rfc3339_millis(machine::date()).to_string(),
            owner: tenant.map(|tenant| tenant.name.clone()),
            weight: Weight::default(),
            tokens,
            spec,
        };
        let epochs = Epochs::first(machine::ulid(), 1);
        Session::identified(sessions, key, identity, epochs, origin)
    }

    /// A session that is known already.
    ///
    /// # Errors
    /// [`SessionError::NoMemory`].
    pub(super) fn identified(
        sessions: &Sessions,
        key: u64,
        identity: Identity,
        epochs: Epochs,
        origin: Option<Arc<[u8]>>,
    ) -> Result<Session, SessionError> {
        let Identity { sid, id, created_at, owner, weight, tokens, mut spec } = identity;
        // A list that was read has room to grow.
        spec.initial_snow.shrink_to_fit();
        let clock = Clock::new(spec.tick_rate, spec.time_scale);
        let mirror = Mirror::new(spec.grid, spec.material, spec.settings(), clock);
        let mirror = mirror.map_err(|error| {
            let columns = spec.grid.columns();
            SessionError::NoMemory(format!(
                "there is no memory for the heights of {columns} columns: {error}"
            ))
        })?;
        Ok(Session {
            id,
            sid,
            epoch: epochs.name(),
            epochs,
            created_at,
            tenant: owner.map(|name| sessions.tenants().named(&name)),
            origin,
            limits: *sessions.limits(),
            decoding: sessions.decoding.clone(),
            tokens: watch::Sender::new(tokens),
            key,
            published: watch::Sender::new(Publication { number: 0, tick: clock.tick() }),
            mirror: RwLock::new(mirror),
            events: broadcast::Sender::new(EVENT_BACKLOG),
            gone: CancellationToken::new(),
            hibernating: AtomicBool::new(false),
            locked: AtomicBool::new(false),
            ground: spec.ground_range(),
            visitors: AtomicU32::new(0),
            device_ns: AtomicU64::new(0),
            last_used: AtomicU64::new(sessions.frames.load(Ordering::Relaxed)),
            waiting: WaitingRoom::default(),
            receipts: Arc::default(),
            finding: Arc::new(Semaphore::new(1)),
            world: sessions.world.clone(),
            frames: sessions.frames.clone(),
            keyed: sessions.keyed.clone(),
            journal_weight: weight,
            companion: OnceLock::new(),
            spec,
        })
    }

    /// Goes on from what was published before the server was started.
    pub(super) fn go_on_from(&self, seq: u64, versions: Option<&[u64]>) {
        let mut mirror = self.mirror.write().unwrap_or_else(PoisonError::into_inner);
        mirror.go_on_from(seq, versions);
        let tick = mirror.clock.tick();
        drop(mirror);
        self.published.send_modify(|publication| publication.tick = tick);
    }

    /// Shows that time does not pass any more.
    pub(super) fn stand_still(&self, clock: Clock) {
        let mut mirror = self.mirror.write().unwrap_or_else(PoisonError::into_inner);
        mirror.clock = clock;
        mirror.resting_since = None;
        mirror.active_tiles = 0;
    }

    /// What the journal knows it by.
    pub(super) fn identity(&self) -> Identity {
        Identity {
            id: self.id.clone(),
            sid: self.sid,
            created_at: self.created_at.clone(),
            owner: self.tenant.as_ref().map(|tenant| tenant.name.clone()),
            weight: self.journal_weight.clone(),
            tokens: self.tokens(),
            spec: self.spec.clone(),
        }
    }

    /// Hashes of its tokens.
    pub fn tokens(&self) -> TokenHashes {
        *self.tokens.borrow()
    }

    /// Hashes of its tokens, as they become.
    pub fn token_changes(&self) -> watch::Receiver<TokenHashes> {
        self.tokens.subscribe()
    }

    pub(super) fn set_tokens(&self, tokens: TokenHashes) {
        self.tokens.send_replace(tokens);
    }

    /// Whether all that has changed since a state is known.
    pub fn recovers(&self, epoch: &str, seq: u64) -> bool {
        self.epochs.recovers(epoch, seq, self.mirror().seq)
    }

    /// The snapshot that it was made from, where it was.
    pub(super) fn origin_snapshot(&self) -> Option<Snapshot> {
        // It was decoded when the session was made.
        self.origin.as_ref().and_then(|bytes| Snapshot::decode(bytes, &Limits::NONE).ok())
    }

    /// The published state. Hold it only to copy out of it: publications wait meanwhile.
    pub fn mirror(&self) -> RwLockReadGuard<'_, Mirror> {
        // A mirror is only written by whole assignments: one left by a panic is still sound.
        self.mirror.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Frames so far, for [`Mirror::stamp_at`] and [`Mirror::clock_at`].
    pub fn frame(&self) -> u64 {
        self.frames.load(Ordering::Relaxed)
    }

    /// The newest publication, and a way to wait for the next.
    pub fn publications(&self) -> watch::Receiver<Publication> {
        self.published.subscribe()
    }

    /// What the streams keep beside the session for as long as it lives; made when it is first
    /// asked for.
    ///
    /// # Panics
    /// Where another type was asked for before: a session has one companion.
    pub fn companion<T: Companion + Default>(&self) -> Arc<T> {
        let companion = self.companion.get_or_init(|| Arc::new(T::default())).clone();
        let companion: Arc<dyn Any + Send + Sync> = companion;
        companion.downcast().expect("a session has one kind of companion")
    }

    /// Memory that it takes \[bytes\].
    pub(super) fn companion_bytes(&self) -> u64 {
        self.companion.get().map_or(0, |companion| companion.bytes())
    }

    /// Events from now on.
    pub fn events(&self) -> broadcast::Receiver<Event> {
        self.events.subscribe()
    }

    /// Cancelled when the session is deleted.
    pub fn gone(&self) -> &CancellationToken {
        &self.gone
    }

    /// The session: configuration, clock and summary.
    pub fn view(&self) -> SessionView {
        let mirror = self.mirror();
        let clock = mirror.clock_at(self.frame());
        SessionView {
            id: self.id.clone(),
            tenant: self.tenant.as_ref().map(|tenant| tenant.name.clone()),
            grid: mirror.grid,
            material: mirror.material,
            settings: mirror.settings,
            terrain: self.spec.terrain.clone(),
            state: self.state(mirror.settings.paused),
            locked: self.is_locked(),
            tick: clock.tick(),
            seq: mirror.seq,
            epoch: self.epoch.clone(),
            sim_time: clock.sim_time(),
            settled: mirror.settled,
            summary: mirror.summary(),
            device_memory_bytes: self.device_memory(),
            created_at: self.created_at.clone(),
            stream_url: format!("/v1/sessions/{}/stream", self.id),
        }
    }

    /// Device memory that its cells take \[bytes\]: none while it hibernates.
    pub(super) fn device_memory(&self) -> u64 {
        if self.hibernating.load(Ordering::Relaxed) { 0 } else { cell_bytes(&self.spec.grid) }
    }

    /// Waits for the one place for a large answer that the world has to find.
    pub async fn finding(&self) -> OwnedSemaphorePermit {
        let place = self.finding.clone().acquire_owned().await;
        place.expect("the semaphore is never closed")
    }

    /// Device time that it has taken since the server was started.
    pub fn device_time(&self) -> Duration {
        Duration::from_nanos(self.device_ns.load(Ordering::Relaxed))
    }

    /// Charges it with device time, and its tenant.
    pub(super) fn charge(&self, took: Duration) {
        self.device_ns.fetch_add(took.as_nanos() as u64, Ordering::Relaxed);
        if let Some(tenant) = &self.tenant {
            tenant.charge(took);
        }
    }

    /// Memory that a snapshot of it takes until it is written, at the most \[bytes\].
    pub fn snapshot_bytes(&self) -> u64 {
        // What its description says of the ground and of each object.
        let ground = self.spec.terrain.as_ref().map_or(0, |terrain| terrain.heights.len() as u64);
        let objects = self.mirror().colliders.len() as u64;
        cell_bytes(&self.spec.grid) + 32 * ground + 512 * objects
    }

    fn state(&self, paused: bool) -> State {
        match (self.hibernating.load(Ordering::Relaxed), paused) {
            (true, _) => State::Hibernating,
            (false, true) => State::Paused,
            (false, false) => State::Running,
        }
    }

    /// Cells of the fixed grid along y: the slots of a column, on the highest ground.
    pub fn sampled_height(&self) -> u32 {
        let (lowest, highest) = self.ground;
        let highest = self.spec.grid.thickness_quanta(highest - lowest);
        self.spec.grid.height + highest.div_ceil(u64::from(CELL)) as u32
    }
}
