//! The loop of the world's thread: beats, frames and what came of them.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use firn_engine::frame::{Backend, EngineError};
use tokio::sync::mpsc;
use tracing::error;

use crate::machine;
use crate::session::clock::FRAME_RATE;
use crate::session::error::SessionError;
use crate::session::handle::Session;
use crate::session::inbox::Inbox;
use crate::session::journal::{Journal, Record};
use crate::session::keyed::KeyedRequests;
use crate::session::message::Message;
use crate::session::names::Names;
use crate::session::pace::Pace;
use crate::session::simulation::Simulation;
use crate::session::vitals::{FrameTime, Vitals};

use super::back::Coming;
use super::backoff::Backoff;
use super::begin::Beginning;
use super::deadlines::Deadlines;
use super::frame::caught;
use super::simulations::Simulations;
use super::slots::Slots;
use super::storage::Storage;
use super::{OpenBackend, TAKEN_AT_ONCE, WorldConfig};

/// Why no request came.
#[derive(Clone, Copy, Debug)]
pub(super) enum Silence {
    /// The time is over.
    Time,
    /// There is nobody left to send one.
    Nobody,
}

/// What lives on the world's thread.
pub(super) struct Engine {
    pub(super) backend: Box<dyn Backend + Send>,
    pub(super) open: OpenBackend,
    pub(super) config: WorldConfig,
    pub(super) checkpoint_interval: Duration,
    pub(super) inbox: mpsc::Receiver<Message>,
    pub(super) clock: tokio::runtime::Runtime,
    pub(super) names: Arc<Names>,
    pub(super) vitals: Arc<Vitals>,
    pub(super) frames: Arc<AtomicU64>,
    pub(super) frame: u64,
    /// Frames of the device so far.
    pub(super) round: u64,
    /// Fingerprint of what carries frames out.
    pub(super) adapter: u64,
    /// Frame in which sessions were last looked after.
    pub(super) looked_after: u64,
    pub(super) next_beat: Instant,
    pub(super) pace: Pace,
    pub(super) simulations: Simulations,
    /// A simulation has orders, which no beat has to be waited for.
    pub(super) busy: bool,
    /// When it is to be seen whether sessions are to be deleted, because nobody wants them.
    pub(super) ends: Deadlines,
    /// When checkpoints are to be made of them, before they hibernate or to cut their journals short.
    pub(super) saves: Deadlines,
    /// Sessions whose memory is freed.
    pub(super) hibernating: HashMap<u64, Arc<Session>>,
    /// What waits for sessions.
    pub(super) mail: BTreeMap<u64, Inbox>,
    /// Sessions that are on their way back, and the order in which they come.
    pub(super) coming: BTreeMap<u64, Coming>,
    pub(super) queue: VecDeque<u64>,
    /// Those of them that somebody asks for.
    pub(super) asked: VecDeque<u64>,
    /// When the server was started.
    pub(super) began: Instant,
    /// What sessions come back from.
    pub(super) records: BTreeMap<u64, Record>,
    pub(super) storage: Storage,
    pub(super) keyed: Arc<KeyedRequests>,
    pub(super) slots: Slots,
    /// What the objects of all sessions take in the device's tables.
    pub(super) object_rows: Arc<AtomicU64>,
    pub(super) journal: Journal,
    /// Sessions that panicked.
    pub(super) fallen: Vec<u64>,
    /// The session of which a checkpoint is being made.
    pub(super) checkpointing: Option<u64>,
    /// Told to stop: until when checkpoints may be begun.
    pub(super) stop: Option<Instant>,
    pub(super) backoff: Backoff,
    pub(super) beginning: Beginning,
    /// The coming frame has a checkpoint.
    pub(super) saving: bool,
}

impl Engine {
    /// Does what there is to do, up to the end of a frame. False means that it was told to stop.
    ///
    /// # Errors
    /// Those of the backend, after which it has to be opened anew.
    pub(super) fn turn(&mut self, first: Option<Message>) -> Result<bool, EngineError> {
        self.hear_journal();
        if !self.has_begun() {
            return Ok(self.turn_away(first));
        }
        if !self.take_messages(first)? {
            return Ok(false);
        }
        let (begun, beat) = (machine::now(), self.frame);
        // The frame with a checkpoint takes on nothing that falls on a beat.
        let publish = !std::mem::take(&mut self.saving) && self.beat();
        self.look_after_sessions();
        self.read_next();
        self.drain_mail();
        self.feed_coming();
        let frame = self.carry_out_frame(publish)?;
        self.advance_coming();
        if frame.sessions > 0 || self.frame > beat {
            let took = machine::since(begun);
            self.vitals.note(FrameTime { took, ..frame });
        }
        if self.frame > beat {
            self.saving = self.begin_checkpoint();
        }
        Ok(true)
    }

    /// Waits for a request, up to some time.
    ///
    /// # Errors
    /// Where none came.
    pub(super) fn wait(&mut self, deadline: Instant) -> Result<Message, Silence> {
        let (inbox, clock) = (RefCell::new(&mut self.inbox), &self.clock);
        let look = || match inbox.borrow_mut().try_recv() {
            Ok(message) => Some(Ok(message)),
            Err(mpsc::error::TryRecvError::Empty) => None,
            Err(mpsc::error::TryRecvError::Disconnected) => Some(Err(Silence::Nobody)),
        };
        let block = || {
            let mut inbox = inbox.borrow_mut();
            let next = async { tokio::time::timeout_at(deadline.into(), inbox.recv()).await };
            match clock.block_on(next) {
                Ok(Some(message)) => Ok(message),
                Ok(None) => Err(Silence::Nobody),
                Err(_) => Err(Silence::Time),
            }
        };
        machine::wait(deadline, look, block).unwrap_or(Err(Silence::Time))
    }

    /// Takes in what has arrived. False means stop.
    fn take_messages(&mut self, first: Option<Message>) -> Result<bool, EngineError> {
        if let Some(message) = first
            && !self.take_message(message)?
        {
            return Ok(false);
        }
        for _ in 0..TAKEN_AT_ONCE {
            match self.inbox.try_recv() {
                Ok(message) => {
                    if !self.take_message(message)? {
                        return Ok(false);
                    }
                }
                Err(mpsc::error::TryRecvError::Empty) => break,
                Err(mpsc::error::TryRecvError::Disconnected) => return Ok(false),
            }
        }
        Ok(true)
    }

    /// Counts the frame where one is due. Returns whether publications are due with it.
    fn beat(&mut self) -> bool {
        let now = machine::now();
        // While sessions come back after a start nobody's time passes.
        if now < self.next_beat || !self.vitals.is_recovered() {
            return false;
        }
        self.frame += 1;
        self.frames.store(self.frame, Ordering::Relaxed);
        let beat = Duration::from_secs_f64(1.0 / FRAME_RATE);
        self.next_beat += beat;
        // Behind that, the machine can't keep up, or has just begun: time slips, ticks don't pile up.
        let slipped = now.saturating_duration_since(self.next_beat);
        self.next_beat += slipped;
        self.vitals.slipped_us.fetch_add(slipped.as_micros() as u64, Ordering::Relaxed);
        let overloaded = self.pace.note(beat + slipped, slipped);
        self.vitals.overloaded.store(overloaded, Ordering::Relaxed);
        let publications =
            |frame: u64| (frame as f64 * self.config.publish_rate / FRAME_RATE + 1e-9) as u64;
        publications(self.frame) > publications(self.frame - 1)
    }

    /// Keeps a simulation among the active ones where it has more to do. Where not, only time goes
    /// on in it from here.
    pub(super) fn review(&mut self, key: u64) {
        let Some(simulation) = self.simulations.get(&key) else { return };
        if self.fallen.contains(&key) || self.is_leaving(key) {
            return;
        }
        self.busy |= simulation.has_orders();
        let active = simulation.wants_frames();
        self.simulations.set_active(key, active);
        if !active {
            self.anchor(key);
            self.schedule(key);
        }
    }

    /// Does something with one simulation. A panic has it brought back, and harms no other.
    pub(super) fn guard<T>(
        &mut self,
        key: u64,
        act: impl FnOnce(&mut Simulation) -> T,
    ) -> Option<T> {
        if self.fallen.contains(&key) {
            return None;
        }
        let simulation = self.simulations.get_mut(&key)?;
        let value = caught(|| act(simulation));
        if value.is_none() {
            self.fell(key);
        }
        value
    }

    /// Sees to it that a session in which something panicked is brought back.
    pub(super) fn fell(&mut self, key: u64) {
        let Some(simulation) = self.simulations.get(&key) else { return };
        let id = simulation.session.id.clone();
        if self.coming.contains_key(&key) {
            error!(session = id, "bringing this session back panicked; it is set aside");
            let why = SessionError::Internal(format!("session '{id}' failed"));
            self.give_up_coming(key, &why);
            self.remove(key, &why);
        } else {
            error!(session = id, "handling this session panicked; it is brought back");
            self.simulations.set_active(key, false);
            self.fallen.push(key);
        }
    }
}
