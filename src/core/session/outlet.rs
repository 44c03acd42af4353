//! What others see of a session: its mirror, the events that streams send, and how many clients it has.

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};
use std::time::Duration;

use firn_engine::frame::device_bytes;
use firn_protocol::{Progress, SessionSpec};
use firn_snow::Grid;
use tokio::sync::{broadcast, watch};
use tokio_util::sync::CancellationToken;
use ulid::Ulid;

use crate::core::record::{Epochs, Identity, RestorePoints, Weight};
use crate::core::session::{
    Clock, FRAME_RATE, Ground, Happening, Invalid, Limits, Mirror, Publication, Receipts,
    SessionError, TokenHashes,
};
use crate::core::snapshot::Snapshot;
use crate::core::tenant::Tenant;

/// Frames with events that a stream may lie behind by before it loses the oldest.
pub(crate) const EVENT_BACKLOG: usize = 64;

/// What the core shows of a session, for who reads and watches it from other threads.
#[derive(Debug)]
pub struct Outlet {
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
    pub(crate) epochs: Epochs,
    /// When it was created, RFC 3339.
    pub created_at: String,
    /// Hashes of its tokens; who may stay watches them.
    pub(crate) tokens: watch::Sender<TokenHashes>,
    /// The snapshot that it was made from, where it was.
    pub(crate) origin: Option<Arc<[u8]>>,
    /// Key in the world; never used twice.
    pub(crate) key: u64,
    pub(crate) mirror: RwLock<Mirror>,
    pub(crate) published: watch::Sender<Publication>,
    pub(crate) events: broadcast::Sender<Arc<[Happening]>>,
    pub(crate) gone: CancellationToken,
    /// Its memory is freed, and its time stands still.
    pub(crate) hibernating: AtomicBool,
    /// It takes no changes until an administrator unlocks it.
    pub(crate) locked: AtomicBool,
    /// The ground that it was created with.
    pub(crate) ground: Ground,
    /// Requests under way and streams.
    pub(crate) visitors: AtomicU32,
    /// Frame in which somebody was last known to be with it.
    pub(crate) last_used: AtomicU64,
    /// Where requests wait for it to be durable.
    pub(crate) receipts: Arc<Receipts>,
    /// Its restore points.
    pub(crate) points: watch::Sender<Arc<RestorePoints>>,
    /// Device time that it has taken \[ns\].
    pub(crate) device_ns: AtomicU64,
    /// Frames so far, of all sessions.
    pub(crate) frames: Arc<AtomicU64>,
    /// Memory that the journal holds of it.
    pub(crate) journal_weight: Weight,
}

impl Outlet {
    /// Of a session that has an identity, and belongs to a tenant where it says so; `frames` counts those of all
    /// sessions.
    ///
    /// # Errors
    /// [`SessionError::NoMemory`].
    pub(crate) fn new(
        key: u64,
        identity: Identity,
        tenant: Option<Arc<Tenant>>,
        epochs: Epochs,
        origin: Option<Arc<[u8]>>,
        frames: Arc<AtomicU64>,
    ) -> Result<Outlet, SessionError> {
        let Identity { sid, id, created_at, owner: _, weight, tokens, mut spec } = identity;
        // A list that was read has room to grow.
        spec.initial_snow.shrink_to_fit();
        let clock = Clock::new(spec.tick_rate, spec.time_scale);
        let ground = Ground::of(spec.terrain.as_ref());
        let mirror = Mirror::new(&spec, ground.clone(), clock);
        let mirror = mirror.map_err(|error| {
            let columns = spec.grid.columns();
            SessionError::NoMemory(format!(
                "there is no memory for the heights of {columns} columns: {error}"
            ))
        })?;
        Ok(Outlet {
            id,
            sid,
            epoch: epochs.name(),
            epochs,
            created_at,
            tenant,
            origin,
            tokens: watch::Sender::new(tokens),
            key,
            published: watch::Sender::new(Publication { number: 0, tick: clock.tick() }),
            mirror: RwLock::new(mirror),
            events: broadcast::Sender::new(EVENT_BACKLOG),
            gone: CancellationToken::new(),
            hibernating: AtomicBool::new(false),
            locked: AtomicBool::new(false),
            ground,
            visitors: AtomicU32::new(0),
            device_ns: AtomicU64::new(0),
            last_used: AtomicU64::new(frames.load(Ordering::Relaxed)),
            receipts: Arc::default(),
            points: watch::Sender::default(),
            frames,
            journal_weight: weight,
            spec,
        })
    }

    /// Goes on from what was published before the server was started.
    pub(crate) fn go_on_from(&self, seq: u64, versions: Option<&[u64]>) {
        let mut mirror = self.mirror.write().unwrap_or_else(PoisonError::into_inner);
        mirror.go_on_from(seq, versions);
        let tick = mirror.clock.tick();
        drop(mirror);
        self.published.send_modify(|publication| publication.tick = tick);
    }

    /// Shows that time does not pass any more.
    pub(crate) fn stand_still(&self, clock: Clock) {
        let mut mirror = self.mirror.write().unwrap_or_else(PoisonError::into_inner);
        mirror.clock = clock;
        mirror.resting_since = None;
        mirror.active_tiles = 0;
        mirror.progress = None;
    }

    /// Shows how far a step has come that has just begun.
    pub(crate) fn show_progress(&self, progress: Progress) {
        let mut mirror = self.mirror.write().unwrap_or_else(PoisonError::into_inner);
        mirror.progress = Some(progress);
    }

    /// What the journal knows it by.
    pub(crate) fn identity(&self) -> Identity {
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

    pub(crate) fn set_tokens(&self, tokens: TokenHashes) {
        self.tokens.send_replace(tokens);
    }

    /// Its restore points.
    pub(crate) fn points(&self) -> Arc<RestorePoints> {
        self.points.borrow().clone()
    }

    pub(crate) fn set_points(&self, points: Arc<RestorePoints>) {
        self.points.send_replace(points);
    }

    /// Whether it takes no changes.
    pub fn is_locked(&self) -> bool {
        self.locked.load(Ordering::Relaxed)
    }

    pub(crate) fn set_locked(&self, locked: bool) {
        self.locked.store(locked, Ordering::Relaxed);
    }

    /// Whether all that has changed since a state is known.
    pub fn recovers(&self, epoch: &str, seq: u64) -> bool {
        self.epochs.recovers(epoch, seq, self.mirror().seq)
    }

    /// The snapshot that it was made from, where it was.
    pub(crate) fn origin_snapshot(&self) -> Option<Snapshot> {
        // It was decoded when the session was made.
        self.origin.as_ref().and_then(|bytes| Snapshot::decode(bytes, &Limits::NONE).ok())
    }

    /// Makes sure that the snow of a session with some specification can lie where that of this one does.
    pub(crate) fn check_place(&self, other: &SessionSpec) -> Result<(), SessionError> {
        let own = &self.spec;
        let size = |grid: &Grid| {
            let Grid { width, depth, height, cell_size } = grid;
            format!("{width} × {depth} × {height} cells of {cell_size} m")
        };
        if other.physics != own.physics {
            let detail = "the snapshot is of snow with another physics than this session's";
            return Err(SessionError::Invalid(vec![Invalid::new("", detail)]));
        }
        if other.grid == own.grid {
            return Ok(());
        }
        let (other, own) = (size(&other.grid), size(&own.grid));
        let detail = format!("the snapshot's grid has {other}; this session's has {own}");
        Err(SessionError::Invalid(vec![Invalid::new("", detail)]))
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

    /// Events from now on, those of a frame together.
    pub fn events(&self) -> broadcast::Receiver<Arc<[Happening]>> {
        self.events.subscribe()
    }

    /// Cancelled when the session is deleted.
    pub fn gone(&self) -> &CancellationToken {
        &self.gone
    }

    /// Whether its memory is freed, and its time stands still.
    pub(crate) fn is_hibernating(&self) -> bool {
        self.hibernating.load(Ordering::Relaxed)
    }

    /// Device memory that its cells take \[bytes\]: none while it hibernates.
    pub(crate) fn device_memory(&self) -> u64 {
        if self.is_hibernating() {
            return 0;
        }
        device_bytes(&self.spec.grid, !self.spec.physics.is_thesis())
    }

    /// Device time that it has taken since the server was started.
    pub fn device_time(&self) -> Duration {
        Duration::from_nanos(self.device_ns.load(Ordering::Relaxed))
    }

    /// Charges it with device time, and its tenant.
    pub(crate) fn charge(&self, took: Duration) {
        self.device_ns.fetch_add(took.as_nanos() as u64, Ordering::Relaxed);
        if let Some(tenant) = &self.tenant {
            tenant.charge(took);
        }
    }

    /// Notes that somebody wants the session now.
    pub(crate) fn touch(&self) {
        self.last_used.store(self.frame(), Ordering::Relaxed);
    }

    /// Seconds since anybody was with it: 0 while somebody is.
    pub(crate) fn idle_for(&self) -> f64 {
        // Who has left has noted when.
        if self.visitors.load(Ordering::SeqCst) > 0 {
            return 0.0;
        }
        let frames = self.frame().saturating_sub(self.last_used.load(Ordering::Relaxed));
        frames as f64 / FRAME_RATE
    }
}
