//! One frame: simulations say what they have to do, the backend does it, and they take in what came
//! of it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crate::engine::frame::{EngineError, Frame, Outcome, Work};
use crate::parallel;
use crate::session::error::SessionError;
use crate::session::gather::MOST_SAMPLES;
use crate::session::journal::Left;
use crate::session::simulation::Simulation;
use crate::session::turn::Turn;
use crate::session::vitals::FrameTime;

use super::engine::Engine;
use super::simulations::Simulations;

/// Longest wait for the device at a time.
const PATIENCE: Duration = Duration::from_millis(100);

impl Engine {
    /// Submits one frame for everybody who has something to do, concludes it, and says what it
    /// took.
    pub(super) fn carry_out_frame(&mut self, publish: bool) -> Result<FrameTime, EngineError> {
        self.busy = false;
        let mut lap = Lap(Instant::now());
        let turn = Turn {
            frame: self.frame,
            publish,
            sleep: self.config.sleep,
            samples: &AtomicU64::new(MOST_SAMPLES),
            slipped_us: &self.vitals.slipped_us,
        };
        let Planned { work, part, mut idle, mut failed } =
            plan(&mut self.simulations, |simulation| simulation.plan(turn));
        let mut time = FrameTime { sessions: part.len() as u32, ..FrameTime::default() };
        time.parts.planning = lap.next();
        if !part.is_empty() {
            self.backend.submit(Frame { work })?;
            time.parts.submitting = lap.next();
            let outcome = loop {
                if let Some(outcome) = self.backend.poll(PATIENCE)? {
                    break outcome;
                }
            };
            time.parts.waiting = lap.next();
            time.published_tiles = outcome.published.count();
            let refusal = self.journal.refusal();
            for done in conclude(part, outcome, time.parts.backend(), refusal.as_ref()) {
                match done.left {
                    Some(left) => {
                        time.checkpoints += u32::from(left.checkpoint.is_some());
                        self.hand_over(done.key, left);
                    }
                    None => failed.push(done.key),
                }
                if done.review {
                    idle.push(done.key);
                }
            }
            self.vitals.memory.store(self.backend.memory(), Ordering::Relaxed);
            self.vitals.note_stages(&self.backend.stage_times()?);
        }
        self.journal.send();
        failed.into_iter().for_each(|key| self.fell(key));
        idle.into_iter().for_each(|key| self.review(key));
        time.parts.concluding = lap.next();
        Ok(time)
    }
}

/// What simulations do in a frame.
struct Planned<'s> {
    work: Vec<Work>,
    /// Those that it is for, in the same order.
    part: Vec<&'s mut Simulation>,
    /// Keys of those with nothing to do.
    idle: Vec<u64>,
    /// Keys of those that panicked.
    failed: Vec<u64>,
}

/// Asks the active simulations what they do in a frame.
fn plan(
    simulations: &mut Simulations,
    ask: impl Fn(&mut Simulation) -> Option<Work> + Sync + Send,
) -> Planned<'_> {
    let mut part = simulations.active_mut();
    let plans = parallel::each(part.iter_mut().collect(), |simulation| caught(|| ask(simulation)));
    let (mut idle, mut failed) = (Vec::new(), Vec::new());
    let mut members = std::mem::take(&mut part).into_iter();
    part.reserve(plans.len());
    let work = plans.into_iter().filter_map(|plan| {
        let simulation = members.next()?;
        match plan {
            Some(Some(work)) => {
                part.push(simulation);
                return Some(work);
            }
            Some(None) => idle.push(simulation.session.key),
            None => failed.push(simulation.session.key),
        }
        None
    });
    Planned { work: work.collect(), part, idle, failed }
}

/// What has to be done after a simulation has taken in its outcome.
struct Concluded {
    key: u64,
    /// What goes to the journal; nothing where it panicked.
    left: Option<Left>,
    /// Whether it has orders, or nothing more to do.
    review: bool,
}

/// Lets simulations take in their outcomes, in the order of the frame's work; changes that have waited
/// for that are made, or refused. For most of them there is nothing to be done after that.
fn conclude(
    part: Vec<&mut Simulation>,
    outcome: Outcome,
    took: Duration,
    refusal: Option<&SessionError>,
) -> impl Iterator<Item = Concluded> + use<> {
    let published = &outcome.published;
    let concluded = parallel::each_pair(part, outcome.work, |simulation, work| {
        let left = caught(|| {
            simulation.fit_portions(took);
            let tiles = published.tiles(work.tiles.clone());
            simulation.conclude(work, tiles);
            let left = simulation.leave();
            match refusal {
                Some(why) => simulation.refuse_held(why),
                None => simulation.release_held(),
            }
            left
        });
        let review = simulation.has_orders() || !simulation.wants_frames();
        let nothing = !review && left.as_ref().is_some_and(Left::is_nothing);
        (!nothing).then(|| Box::new(Concluded { key: simulation.session.key, left, review }))
    });
    concluded.into_iter().flatten().map(|concluded| *concluded)
}

/// Takes the times from one moment to the next.
struct Lap(Instant);

impl Lap {
    fn next(&mut self) -> Duration {
        let now = Instant::now();
        now.duration_since(std::mem::replace(&mut self.0, now))
    }
}

/// The value, or nothing where there was a panic.
pub(super) fn caught<T>(act: impl FnOnce() -> T) -> Option<T> {
    catch_unwind(AssertUnwindSafe(act)).ok()
}
