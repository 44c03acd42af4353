//! A session as the rest of the server sees it.

use std::any::Any;
use std::ops::Deref;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

use firn_engine::frame::cell_bytes;
use firn_protocol::{Reference, SessionSpec, SessionView, Settings, Stamp, State, WeatherView};
use firn_snow::CELL;
use firn_snow::weather::Site;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};

use super::memory::Companion;
use super::registry::Sessions;
use crate::core::Input;
use crate::core::record::{Epochs, Identity, Weight};
use crate::core::session::{Limits, Mirror, Outlet, SessionError, TokenHashes, WaitingRoom};
use crate::core::tenant::Tenant;
use crate::journal::{KeyedRequests, StoreKeeper};
use crate::machine;

/// A session. Reads are served from its outlet; changes go to the world's thread.
#[derive(Debug)]
pub struct Session {
    pub(crate) outlet: Arc<Outlet>,
    pub(crate) limits: Limits,
    pub(crate) decoding: Arc<Semaphore>,
    pub(crate) waiting: WaitingRoom,
    /// The one place for a large answer that the world has to find.
    finding: Arc<Semaphore>,
    pub(crate) world: mpsc::Sender<Input>,
    /// Steps that it was asked for.
    pub(crate) steps: AtomicU64,
    pub(crate) keyed: Arc<KeyedRequests>,
    /// Where its restore points are read.
    pub(crate) store: StoreKeeper,
    companion: OnceLock<Arc<dyn Companion>>,
}

impl Deref for Session {
    type Target = Outlet;

    fn deref(&self) -> &Outlet {
        &self.outlet
    }
}

impl Session {
    /// A new session.
    ///
    /// # Errors
    /// As [`Session::identified`].
    pub(crate) fn new(
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
    pub(crate) fn identified(
        sessions: &Sessions,
        key: u64,
        identity: Identity,
        epochs: Epochs,
        origin: Option<Arc<[u8]>>,
    ) -> Result<Session, SessionError> {
        let tenant = identity.owner.as_ref().map(|name| sessions.tenants().named(name));
        let frames = sessions.frames.clone();
        Ok(Session {
            outlet: Arc::new(Outlet::new(key, identity, tenant, epochs, origin, frames)?),
            limits: *sessions.limits(),
            decoding: sessions.decoding.clone(),
            waiting: WaitingRoom::default(),
            finding: Arc::new(Semaphore::new(1)),
            world: sessions.world.clone(),
            steps: AtomicU64::new(0),
            keyed: sessions.keyed.clone(),
            store: sessions.store.clone(),
            companion: OnceLock::new(),
        })
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
    pub(crate) fn companion_bytes(&self) -> u64 {
        self.companion.get().map_or(0, |companion| companion.bytes())
    }

    /// The session: configuration, clock and summary.
    pub fn view(&self) -> SessionView {
        let mirror = self.mirror();
        let clock = mirror.clock_at(self.frame());
        SessionView {
            id: self.id.clone(),
            tenant: self.tenant.as_ref().map(|tenant| tenant.name.clone()),
            physics: self.spec.physics,
            weather_step: mirror.alpine.as_ref().map(|alpine| alpine.step),
            site: mirror.alpine.as_ref().map(|alpine| alpine.site.clone()),
            grid: mirror.grid,
            material: mirror.material,
            settings: mirror.settings,
            terrain: !mirror.ground.is_level(),
            state: self.state(&mirror),
            progress: mirror.progress,
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

    /// Waits for the one place for a large answer that the world has to find.
    pub async fn finding(&self) -> OwnedSemaphorePermit {
        let place = self.finding.clone().acquire_owned().await;
        place.expect("the semaphore is never closed")
    }

    /// Memory that a snapshot of it takes until it is written, at the most \[bytes\].
    pub fn snapshot_bytes(&self) -> u64 {
        // What it says of each object, and of the ground, as it was and as it is.
        let objects = self.mirror().colliders.len() as u64;
        let mirror = self.mirror();
        let weather = mirror.alpine.as_ref().map_or(0, |alpine| alpine.weather.heap_bytes() as u64);
        let columns = self.spec.grid.columns();
        let surfaces = if self.spec.physics.is_thesis() { 0 } else { 64 * columns };
        cell_bytes(&self.spec.grid) + 16 * columns + 512 * objects + surfaces + 8 * weather
    }

    /// The weather of alpine snow: what was told, and what holds now.
    ///
    /// # Errors
    /// [`SessionError::Conflict`] where the session's snow feels none.
    pub fn weather(&self) -> Result<WeatherView, SessionError> {
        let mirror = self.mirror();
        let alpine = mirror.alpine.as_ref().ok_or_else(SessionError::feels_no_weather)?;
        let clock = mirror.clock_at(self.frame());
        let stamp = Stamp { tick: clock.tick(), seq: mirror.seq };
        Ok(alpine.view(stamp, clock.sim_time()))
    }

    /// The simulated time of a tick near the present one \[s\], and where and when the snow is.
    ///
    /// # Errors
    /// [`SessionError::Conflict`] where the session's snow feels no weather.
    pub fn time_and_site(&self, tick: u64) -> Result<(f64, Arc<Site>), SessionError> {
        let mirror = self.mirror();
        let alpine = mirror.alpine.as_ref().ok_or_else(SessionError::feels_no_weather)?;
        let clock = mirror.clock_at(self.frame());
        let Settings { time_scale, tick_rate, .. } = mirror.settings;
        let behind = clock.tick().saturating_sub(tick) as f64 * time_scale / tick_rate;
        Ok(((clock.sim_time() - behind).max(0.0), alpine.site.clone()))
    }

    fn state(&self, mirror: &Mirror) -> State {
        match mirror.settings.paused {
            _ if self.is_hibernating() => State::Hibernating,
            true if mirror.progress.is_some() => State::Stepping,
            true => State::Paused,
            false => State::Running,
        }
    }

    /// Cells of the fixed grid along y: the slots of a column, on the highest ground.
    pub fn sampled_height(&self, reference: Reference) -> u32 {
        let ground = match reference {
            Reference::Lowest => {
                let mirror = self.mirror();
                mirror.ground.highest() - mirror.ground.lowest()
            }
            Reference::Ground => 0.0,
        };
        let ground = self.spec.grid.thickness_quanta(ground);
        self.spec.grid.height + ground.div_ceil(u64::from(CELL)) as u32
    }
}
