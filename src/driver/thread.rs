//! What drives the core: it tells it the time and what has happened, and carries out what it wants done. The
//! channel, the device, the journal and the clock are here.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use firn_engine::frame::{Backend, EngineError, Outcome};
use tokio::sync::mpsc;
use tracing::{error, warn};

use crate::core::device::{DEVICE_FAILED, stopped};
use crate::core::session::FRAME_RATE;
use crate::core::vitals::{FrameTime, Vitals};
use crate::core::{Effect, Fault, Input, Now, World};
use crate::driver::OpenBackend;
use crate::driver::effects::Lap;
use crate::driver::pace::Pace;
use crate::journal::Journal;
use crate::journal::keyed::KeyedRequests;
use crate::machine;
use crate::store::StoreClock;

/// Requests that are taken in before a frame, so that beats are not missed.
const TAKEN_AT_ONCE: usize = 4096;

/// Time between two looks at the core while there are no beats.
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);

const ENGINE_FAILED: &str = "the engine has failed and is started anew";

/// What drives the core.
pub(crate) struct Thread {
    pub world: World,
    pub backend: Box<dyn Backend + Send>,
    pub open: OpenBackend,
    pub inbox: mpsc::Receiver<Input>,
    /// Where others put what they have to tell.
    pub mailbox: mpsc::WeakSender<Input>,
    /// Waits for a request or for the next beat, and decodes what is stored of sessions that come back.
    pub runtime: tokio::runtime::Runtime,
    pub journal: Journal,
    pub journal_died: bool,
    pub keyed: Arc<KeyedRequests>,
    pub clock: StoreClock,
    pub vitals: Arc<Vitals>,
    pub pace: Pace,
    pub next_beat: Instant,
    pub inputs: VecDeque<Input>,
    pub effects: VecDeque<Effect>,
    /// What the last frame has done, and what it took.
    pub outcome: Option<(Outcome, FrameTime)>,
    pub end: Option<End>,
}

/// How everything comes to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    /// It was told to stop, and is not there yet.
    Stopping,
    /// Nothing more is to be done.
    Over,
}

/// Why no request came.
#[derive(Clone, Copy, Debug)]
enum Silence {
    /// The time is over.
    Time,
    /// There is nobody left to send one.
    Nobody,
}

impl Thread {
    /// Runs until it is told to stop or nothing helps any more.
    pub fn run(mut self) {
        while self.end != Some(End::Over) {
            match self.wait() {
                Ok(first) => self.turn(Some(first)),
                Err(Silence::Time) => self.turn(None),
                Err(Silence::Nobody) => self.end = Some(End::Over),
            }
        }
        self.close();
    }

    /// Does what there is to do, up to the end of a frame. Where that fails the device is opened anew.
    pub fn turn(&mut self, first: Option<Input>) {
        let why = match catch_unwind(AssertUnwindSafe(|| self.work(first))) {
            Ok(Ok(())) => return,
            Ok(Err(failure)) => {
                error!("{failure}");
                DEVICE_FAILED
            }
            Err(_) => ENGINE_FAILED,
        };
        error!("{why}");
        self.effects.retain(|effect| !effect.needs_device());
        self.outcome = None;
        self.inputs.push_back(Input::Lost(why));
    }

    fn work(&mut self, first: Option<Input>) -> Result<(), EngineError> {
        let mut lap = Lap(machine::now());
        let mut ended = None;
        if let Some((outcome, mut frame)) = self.outcome.take() {
            frame.published_tiles = outcome.published.count();
            self.inputs.push_front(Input::Done(outcome));
            self.world.take(self.now(), &mut self.inputs, &mut self.effects);
            let is_pack = |effect: &&Effect| matches!(effect, Effect::Pack(_));
            frame.checkpoints = self.effects.iter().filter(is_pack).count() as u32;
            frame.parts.concluding = lap.next();
            ended = Some(frame);
        }
        self.carry_out()?;
        if let Some(frame) = ended {
            self.vitals.note_stages(&self.backend.stage_times()?);
            let parts = frame.parts;
            let took = parts.planning + parts.submitting + parts.waiting + parts.concluding;
            self.vitals.note(FrameTime { took, ..frame });
        }
        self.listen(first);
        let beats = self.beat();
        lap.next();
        self.world.step(self.now(), &mut self.inputs, &mut self.effects);
        let planning = lap.next();
        self.carry_out()?;
        match &mut self.outcome {
            Some((_, frame)) => frame.parts.planning = planning,
            None if beats => self.vitals.note(FrameTime { took: planning, ..FrameTime::default() }),
            None => {}
        }
        Ok(())
    }

    fn now(&self) -> Now {
        Now { instant: machine::now(), stored: self.clock.now() }
    }

    /// Takes in what has arrived.
    fn listen(&mut self, first: Option<Input>) {
        if self.journal.is_dead() && !std::mem::replace(&mut self.journal_died, true) {
            self.inputs.push_back(Input::JournalDied);
        }
        while let Some(verdict) = self.journal.told() {
            self.inputs.push_back(Input::Journal(verdict));
        }
        let mut next = first;
        for _ in 0..TAKEN_AT_ONCE {
            if self.end.is_some() {
                break;
            }
            let Some(input) = next.take().or_else(|| self.inbox.try_recv().ok()) else { break };
            match input {
                Input::Nudge => {}
                Input::Break(Fault::LoseDevice) => self.backend.lose(),
                Input::Break(Fault::Panic) => panic!("a test asked for this"),
                Input::Stop(_) => {
                    self.end = Some(End::Stopping);
                    self.journal.refuse_errands();
                    self.inputs.push_back(input);
                }
                input => self.inputs.push_back(input),
            }
        }
    }

    /// Tells of a beat where one is due. Returns whether that was so.
    fn beat(&mut self) -> bool {
        let now = machine::now();
        let takes_it = self.world.has_beats() && !self.world.owes_a_beat() && self.end.is_none();
        if now < self.next_beat || !takes_it {
            return false;
        }
        let beat = Duration::from_secs_f64(1.0 / FRAME_RATE);
        self.next_beat += beat;
        // Behind that, the machine can't keep up, or has just begun: time slips, ticks don't pile up.
        let slipped = now.saturating_duration_since(self.next_beat);
        self.next_beat += slipped;
        self.vitals.slipped_us.fetch_add(slipped.as_micros() as u64, Ordering::Relaxed);
        let overloaded = self.pace.note(beat + slipped, slipped);
        self.vitals.overloaded.store(overloaded, Ordering::Relaxed);
        self.inputs.push_back(Input::Beat);
        true
    }

    /// When there is something to do at the latest.
    pub fn due(&self) -> Instant {
        let look = machine::now() + BETWEEN_LOOKS;
        match self.world.next_attempt() {
            _ if self.world.has_beats() => self.next_beat,
            Some(next) => next.min(look),
            None => look,
        }
    }

    /// Waits for a request, as long as there is nothing else to do.
    ///
    /// # Errors
    /// Where none came.
    fn wait(&mut self) -> Result<Input, Silence> {
        if self.outcome.is_some() || !self.inputs.is_empty() || self.world.is_busy() {
            return Err(Silence::Time);
        }
        if self.end == Some(End::Stopping) {
            self.hear_the_last();
            return Err(Silence::Time);
        }
        let deadline = self.due();
        let (inbox, runtime) = (RefCell::new(&mut self.inbox), &self.runtime);
        let look = || match inbox.borrow_mut().try_recv() {
            Ok(input) => Some(Ok(input)),
            Err(mpsc::error::TryRecvError::Empty) => None,
            Err(mpsc::error::TryRecvError::Disconnected) => Some(Err(Silence::Nobody)),
        };
        let block = || {
            let mut inbox = inbox.borrow_mut();
            let next = async { tokio::time::timeout_at(deadline.into(), inbox.recv()).await };
            match runtime.block_on(next) {
                Ok(Some(input)) => Ok(input),
                Ok(None) => Err(Silence::Nobody),
                Err(_) => Err(Silence::Time),
            }
        };
        machine::wait(deadline, look, block).unwrap_or(Err(Silence::Time))
    }

    /// Waits for the journal while everything comes to its end.
    fn hear_the_last(&mut self) {
        if let Some(verdict) = self.journal.wait(BETWEEN_LOOKS) {
            self.inputs.push_back(Input::Journal(verdict));
        }
    }

    /// Has all come to its end by some time.
    pub fn stop(mut self, until: Instant) {
        self.inputs.push_back(Input::Stop(until));
        self.end = Some(End::Stopping);
        self.run();
    }

    /// Refuses everything from here on, and writes what is left to be written.
    fn close(mut self) {
        self.vitals.healthy.store(false, Ordering::Relaxed);
        // Who still waits learns that nobody answers any more.
        self.inbox.close();
        self.world.finish(&mut self.effects);
        if let Err(failure) = self.carry_out() {
            warn!("at the end: {failure}");
        }
        self.journal.stop();
        self.world.end_receipts(&stopped());
    }
}
