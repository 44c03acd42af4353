//! A running world without a server in front of it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use firn_protocol::{SessionSpec, SettingsPatch, SnowLayer};
use firn_snow::Preset;
use tokio::runtime::Runtime;
use tokio::task::JoinSet;

use crate::backend;
use crate::config::EngineConfig;
use crate::driver::{Driver, WorldConfig};
use crate::session::{Change, FrameTime, Limits, Session, SessionError, Sessions};

use super::{BenchError, Plan};

/// Longest time to wait for anything.
const PATIENCE: Duration = Duration::from_secs(120);

/// Requests under way at a time.
const AT_A_TIME: usize = 256;

/// A running world and a runtime to talk to it.
pub(super) struct Host {
    pub sessions: Sessions,
    world: Option<Driver>,
    pub runtime: Runtime,
}

impl Host {
    /// Starts a world that publishes at a rate \[Hz\].
    pub fn start(plan: &Plan, publish_rate: f64) -> Result<Host, BenchError> {
        let engine = EngineConfig { backend: plan.backend, device_memory: None };
        let limits = Limits {
            sessions: 1 << 20,
            columns_per_session: 1 << 40,
            columns: 1 << 40,
            cells_per_session: 1 << 40,
            cells: 1 << 50,
            colliders_per_session: 256,
        };
        let config = WorldConfig { limits, publish_rate, sleep: true };
        let (sessions, world) = Driver::start(backend::open(&engine)?, config)?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build()?;
        Ok(Host { sessions, world: Some(world), runtime })
    }

    /// Creates a session.
    pub fn create(&self, spec: SessionSpec) -> Result<Arc<Session>, BenchError> {
        let (session, _tokens) = self.runtime.block_on(self.sessions.create(spec))?;
        Ok(session)
    }

    /// Creates many sessions, telling how many there are.
    pub fn create_many(
        &self,
        specs: impl Iterator<Item = SessionSpec>,
        mut tell: impl FnMut(usize),
    ) -> Result<Vec<Arc<Session>>, BenchError> {
        let create = |spec| {
            let sessions = self.sessions.clone();
            async move { sessions.create(spec).await.map(|(session, _tokens)| session) }
        };
        self.runtime.block_on(all(specs.map(create), &mut tell))
    }

    /// Changes the settings of many sessions.
    pub fn set_all(
        &self,
        sessions: &[Arc<Session>],
        patch: SettingsPatch,
    ) -> Result<(), BenchError> {
        let change = |session: &Arc<Session>| {
            let session = session.clone();
            async move { session.change(Change::Settings(patch)).await }
        };
        self.runtime.block_on(all(sessions.iter().map(change), &mut |_| {}))?;
        Ok(())
    }

    /// Lets the world run until it has made some frames of a kind, and returns those.
    pub fn watch(
        &self,
        case: &'static str,
        count: usize,
        wanted: impl Fn(&FrameTime) -> bool,
    ) -> Result<Vec<FrameTime>, BenchError> {
        let mut seen = self.newest_frame();
        let mut found = Vec::new();
        let end = Instant::now() + PATIENCE;
        while found.len() < count {
            if Instant::now() > end || !self.sessions.vitals().is_healthy() {
                let what = format!("{} frames of {count} came", found.len());
                return Err(BenchError::Stuck { case, what });
            }
            self.sleep(Duration::from_millis(100));
            found.extend(self.frames_since(&mut seen).filter(&wanted));
        }
        Ok(found)
    }

    /// The frames after one of a number, which is then that of the last of them. Only so many are
    /// remembered.
    pub fn frames_since(&self, seen: &mut u64) -> impl Iterator<Item = FrameTime> + use<> {
        let frames = self.sessions.vitals().frame_times();
        let last = frames.last().map_or(*seen, |frame| frame.number);
        let before = std::mem::replace(seen, last);
        frames.into_iter().filter(move |frame| frame.number > before)
    }

    /// Waits until something is so.
    pub fn wait_until(
        &self,
        case: &'static str,
        what: &str,
        so: impl Fn() -> bool,
    ) -> Result<(), BenchError> {
        let end = Instant::now() + PATIENCE;
        while !so() {
            if Instant::now() > end {
                return Err(BenchError::Stuck { case, what: format!("waited in vain: {what}") });
            }
            self.sleep(Duration::from_millis(50));
        }
        Ok(())
    }

    /// Number of the newest frame.
    pub fn newest_frame(&self) -> u64 {
        self.sessions.vitals().frame_times().last().map_or(0, |frame| frame.number)
    }

    /// Lets the world run for a while.
    pub fn sleep(&self, time: Duration) {
        std::thread::sleep(time);
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        if let Some(world) = self.world.take() {
            world.stop();
        }
    }
}

/// Carries requests out, some at a time; `tell` hears how many are done.
async fn all<T: Send + 'static>(
    requests: impl Iterator<Item = impl Future<Output = Result<T, SessionError>> + Send + 'static>,
    tell: &mut impl FnMut(usize),
) -> Result<Vec<T>, BenchError> {
    let mut under_way = JoinSet::new();
    let mut done = Vec::new();
    let mut requests = requests.peekable();
    while requests.peek().is_some() || !under_way.is_empty() {
        while under_way.len() < AT_A_TIME
            && let Some(request) = requests.next()
        {
            under_way.spawn(request);
        }
        if let Some(joined) = under_way.join_next().await {
            let failed = |error: tokio::task::JoinError| SessionError::Internal(error.to_string());
            done.push(joined.map_err(failed)??);
            tell(done.len());
        }
    }
    Ok(done)
}

/// A square session with fresh snow of the material's density at −3 °C.
pub(super) fn spec(side: u32, depth: f64) -> SessionSpec {
    let layer = SnowLayer { depth, temperature: Some(-3.0), density: Some(20.0) };
    let mut spec = SessionSpec { initial_snow: vec![layer], ..SessionSpec::default() };
    (spec.grid.width, spec.grid.depth) = (side, side);
    spec
}

/// Depth of the snow for games \[m\]: six full cells and half of one.
pub(super) const GAME_SNOW: f64 = 0.65;

/// A square of fresh snow for games, with so many columns of 0.1 m along each side.
pub(super) fn game_spec(side: u32) -> SessionSpec {
    let (material, pressing) = (Preset::Game.material(), Preset::Game.pressing());
    let mut spec = SessionSpec { material, pressing, ..spec(side, GAME_SNOW) };
    (spec.grid.height, spec.grid.cell_size) = (16, 0.1);
    let fresh = SnowLayer { depth: GAME_SNOW, temperature: Some(-3.0), density: None };
    spec.initial_snow = vec![fresh];
    spec
}
