//! The loop of the world's thread: beats, frames and what came of them.

use std::collections::{HashMap, HashSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use tokio::sync::mpsc;
use tracing::{error, info};

use crate::engine::frame::{Backend, EngineError, Frame, Outcome};
use crate::session::clock::FRAME_RATE;
use crate::session::error::SessionError;
use crate::session::gather::MOST_SAMPLES;
use crate::session::message::Message;
use crate::session::registry::Names;
use crate::session::simulation::Simulation;
use crate::session::vitals::{FrameTime, Vitals};

use super::slots::Slots;
use super::{INBOX, WorldConfig};

/// Longest wait for the device at a time.
const PATIENCE: Duration = Duration::from_millis(100);

/// What lives on the world's thread.
pub(super) struct Engine {
    pub(super) backend: Box<dyn Backend + Send>,
    pub(super) config: WorldConfig,
    pub(super) inbox: mpsc::Receiver<Message>,
    pub(super) clock: tokio::runtime::Runtime,
    pub(super) names: Arc<Names>,
    pub(super) vitals: Arc<Vitals>,
    pub(super) frames: Arc<AtomicU64>,
    pub(super) frame: u64,
    /// A session has as many edits for the next frame as one frame should carry.
    pub(super) full: bool,
    /// Frame of the next look for sessions that nobody wants.
    pub(super) next_inspection: u64,
    pub(super) next_beat: Instant,
    pub(super) simulations: HashMap<u64, Simulation>,
    /// Keys of the simulations that want to be in the coming frames.
    pub(super) active: HashSet<u64>,
    pub(super) slots: Slots,
}

impl Engine {
    /// Works until it is told to stop.
    ///
    /// # Errors
    /// Those of the backend, after which nothing can go on.
    pub(super) fn run(&mut self) -> Result<(), EngineError> {
        loop {
            if !self.take_messages() {
                return Ok(());
            }
            let (begun, beat) = (Instant::now(), self.frame);
            let publish = self.beat();
            self.delete_forsaken();
            let frame = self.carry_out_frame(publish)?;
            if frame.sessions > 0 || self.frame > beat {
                self.vitals.note(FrameTime { took: begun.elapsed(), ..frame });
            }
        }
    }

    /// Waits for a request or the next beat, and takes in what has arrived. False means stop.
    fn take_messages(&mut self) -> bool {
        let busy = self.active.iter().any(|key| self.simulations[key].has_orders());
        if !busy {
            let deadline = tokio::time::Instant::from_std(self.next_beat);
            let inbox = &mut self.inbox;
            let wait = async { tokio::time::timeout_at(deadline, inbox.recv()).await };
            match self.clock.block_on(wait) {
                Ok(Some(message)) => {
                    if !self.take_message(message) {
                        return false;
                    }
                }
                Ok(None) => return false,
                Err(_) => {}
            }
        }
        // No more than one inbox full at a time, so that beats are not missed.
        self.full = false;
        for _ in 0..INBOX {
            if self.full {
                break;
            }
            match self.inbox.try_recv() {
                Ok(message) => {
                    if !self.take_message(message) {
                        return false;
                    }
                }
                Err(mpsc::error::TryRecvError::Empty) => break,
                Err(mpsc::error::TryRecvError::Disconnected) => return false,
            }
        }
        true
    }

    /// Counts the frame where one is due. Returns whether publications are due with it.
    fn beat(&mut self) -> bool {
        let now = Instant::now();
        if now < self.next_beat {
            return false;
        }
        self.frame += 1;
        self.frames.store(self.frame, Ordering::Relaxed);
        self.next_beat += Duration::from_secs_f64(1.0 / FRAME_RATE);
        if self.next_beat < now {
            // The machine can't keep up, or has just begun: time slips, ticks don't pile up.
            let slipped = (now - self.next_beat).as_micros() as u64;
            self.vitals.slipped_us.fetch_add(slipped, Ordering::Relaxed);
            self.next_beat = now;
        }
        let publications =
            |frame: u64| (frame as f64 * self.config.publish_rate / FRAME_RATE + 1e-9) as u64;
        publications(self.frame) > publications(self.frame - 1)
    }

    /// Deletes, once a second, the sessions that nobody has asked for as long as they are kept.
    fn delete_forsaken(&mut self) {
        if self.frame < self.next_inspection {
            return;
        }
        self.next_inspection = self.frame + FRAME_RATE as u64;
        let mut forsaken = Vec::new();
        for (&key, simulation) in &self.simulations {
            let session = &simulation.session;
            // A request under way and a stream hold the session as well as we and its name do.
            if Arc::strong_count(session) > 2 {
                session.touch();
            }
            let kept = simulation.settings.delete_after_s;
            if kept.is_some_and(|seconds| session.idle_for() > seconds) {
                forsaken.push((key, session.id.clone()));
            }
        }
        for (key, id) in forsaken {
            info!(session = id, "deleted: nobody has asked for it");
            self.remove(key, &SessionError::NotFound { kind: "session", id });
        }
    }

    /// Submits one frame for everybody who has something to do, and concludes it.
    /// Says what was in it.
    fn carry_out_frame(&mut self, publish: bool) -> Result<FrameTime, EngineError> {
        let (number, sleep) = (self.frame, self.config.sleep);
        let mut frame = Frame::default();
        let mut keys = Vec::new();
        let mut samples = MOST_SAMPLES;
        let active: Vec<u64> = self.active.iter().copied().collect();
        for key in active {
            let plan =
                self.guard(key, |simulation| simulation.plan(number, publish, sleep, &mut samples));
            if let Some(work) = plan.flatten() {
                frame.work.push(work);
                keys.push(key);
            } else {
                self.review(key);
            }
        }
        if keys.is_empty() {
            return Ok(FrameTime::default());
        }
        let begun = Instant::now();
        self.backend.submit(frame)?;
        let outcome = loop {
            if let Some(outcome) = self.backend.poll(PATIENCE)? {
                break outcome;
            }
        };
        let took = begun.elapsed();
        let frame = FrameTime {
            sessions: keys.len() as u32,
            published_tiles: outcome.tiles.len() as u32,
            backend: took,
            ..FrameTime::default()
        };
        self.conclude(&keys, outcome, took);
        Ok(frame)
    }

    fn conclude(&mut self, keys: &[u64], mut outcome: Outcome, took: Duration) {
        outcome.tiles.sort_unstable_by_key(|tile| (tile.slot, tile.tile));
        for (&key, work) in keys.iter().zip(outcome.work) {
            let first = outcome.tiles.partition_point(|tile| tile.slot < work.slot);
            let end = outcome.tiles.partition_point(|tile| tile.slot <= work.slot);
            let tiles = &outcome.tiles[first..end];
            self.guard(key, |simulation| {
                if let Some(job) = &mut simulation.step {
                    job.fit(took);
                }
                simulation.conclude(work, tiles);
            });
            self.review(key);
        }
        self.vitals.memory.store(self.backend.memory(), Ordering::Relaxed);
    }

    /// Keeps a simulation among the active ones where it has more to do.
    pub(super) fn review(&mut self, key: u64) {
        match self.simulations.get(&key) {
            Some(simulation) if simulation.wants_frames() => self.active.insert(key),
            _ => self.active.remove(&key),
        };
    }

    /// Does something with one simulation. A panic ends that session and no other.
    pub(super) fn guard<T>(
        &mut self,
        key: u64,
        act: impl FnOnce(&mut Simulation) -> T,
    ) -> Option<T> {
        let simulation = self.simulations.get_mut(&key)?;
        match catch_unwind(AssertUnwindSafe(|| act(simulation))) {
            Ok(value) => Some(value),
            Err(_) => {
                let id = simulation.session.id.clone();
                error!(session = id, "handling this session panicked; it is ended");
                self.remove(key, &SessionError::Internal(format!("session '{id}' failed")));
                None
            }
        }
    }
}
