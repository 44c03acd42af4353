//! One frame: simulations say what they have to do, the backend does it, and they take in what came
//! of it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use firn_engine::frame::{EngineError, Frame, Outcome, Work};
use firn_engine::parallel;

use crate::machine;
use crate::session::charge::{Bill, Charge, who_waits};
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
        let mut lap = Lap(machine::now());
        let turn = Turn {
            frame: self.frame,
            round: self.round + 1,
            publish,
            sleep: self.config.sleep,
            slipped_us: &self.vitals.slipped_us,
        };
        // Nobody waits where all of them come back or are saved.
        let take_turns = self.vitals.is_recovered() && self.stop.is_none();
        let Planned { work, part, mut idle, mut failed, waiting } =
            plan(&mut self.simulations, turn, take_turns);
        self.vitals.waits.fetch_add(waiting.over_share + waiting.for_others, Ordering::Relaxed);
        // What a share allows is a matter of time: the next beat is soon enough.
        self.busy |= waiting.for_others > 0;
        let mut time = FrameTime { sessions: part.len() as u32, ..FrameTime::default() };
        time.parts.planning = lap.next();
        if !part.is_empty() {
            self.round = turn.round;
            self.backend.submit(Frame { work })?;
            time.parts.submitting = lap.next();
            let outcome = loop {
                if let Some(outcome) = self.backend.poll(PATIENCE)? {
                    break outcome;
                }
            };
            time.parts.waiting = lap.next();
            time.published_tiles = outcome.published.count();
            let bill = Bill { took: outcome.took, units: units(&part, &outcome) };
            self.vitals.charge(bill.sum());
            for done in conclude(part, outcome, bill) {
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
        for key in idle {
            self.review(key);
        }
        self.busy |= self.has_mail();
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
    waiting: Waiting,
}

/// How many wait for another frame.
#[derive(Default)]
struct Waiting {
    /// Because their tenant has had its share of the device.
    over_share: u64,
    /// Because others have had less of the device.
    for_others: u64,
}

/// Asks the active simulations what they do in a frame. Those that take long may have to wait.
fn plan<'s>(simulations: &'s mut Simulations, turn: Turn, take_turns: bool) -> Planned<'s> {
    let mut part = simulations.active_mut();
    let waiting = if take_turns { wait(&mut part, turn) } else { Waiting::default() };
    wait_for_room(&mut part, turn);
    let plans =
        parallel::each(part.iter_mut().collect(), |simulation| caught(|| simulation.plan(turn)));
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
    Planned { work: work.collect(), part, idle, failed, waiting }
}

/// Takes those out that wait for another frame.
fn wait(part: &mut Vec<&mut Simulation>, turn: Turn) -> Waiting {
    let claims = |simulation: &Simulation| simulation.claims(turn);
    let over_share = take_out(part, turn, |part| {
        let over = |simulation: &Simulation| {
            let tenant = simulation.session.tenant.as_ref();
            tenant.is_some_and(|tenant| tenant.is_over_its_share(turn.frame))
        };
        let all = (0..).zip(part);
        all.filter(|(_, sim)| over(sim) && claims(sim)).map(|(place, _)| place).collect()
    });
    let for_others = take_out(part, turn, |part| {
        let all = (0..).zip(part);
        let heavy = all.filter(|(_, sim)| sim.charge.is_heavy(turn.frame) && claims(sim));
        let (places, charges): (Vec<usize>, Vec<Charge>) =
            heavy.map(|(place, sim)| (place, sim.charge)).unzip();
        who_waits(&charges, turn.frame).into_iter().map(|claim| places[claim]).collect()
    });
    Waiting { over_share, for_others }
}

/// Takes those out for whose cells of the fixed grid the frame has no room. Who comes first is another one
/// in each frame.
fn wait_for_room(part: &mut Vec<&mut Simulation>, turn: Turn) {
    take_out(part, turn, |part| {
        let all = (0..).zip(part);
        let mut wanted: Vec<(usize, u64)> = all
            .map(|(place, simulation)| (place, simulation.sampled_cells()))
            .filter(|(_, cells)| *cells > 0)
            .collect();
        let first = turn.frame as usize % wanted.len().max(1);
        wanted.rotate_left(first);
        let mut room = MOST_SAMPLES;
        wanted.retain(|(_, cells)| {
            let fits = *cells <= room;
            room -= if fits { *cells } else { 0 };
            !fits
        });
        wanted.into_iter().map(|(place, _)| place).collect()
    });
}

/// Has some simulations wait for another frame. Returns how many.
fn take_out(
    part: &mut Vec<&mut Simulation>,
    turn: Turn,
    who: impl FnOnce(&[&mut Simulation]) -> Vec<usize>,
) -> u64 {
    let mut waits = vec![false; part.len()];
    who(part).into_iter().for_each(|place| waits[place] = true);
    let (before, mut waits) = (part.len(), waits.into_iter());
    part.retain_mut(|simulation| {
        let waits = waits.next() == Some(true);
        if waits {
            simulation.wait(turn);
        }
        !waits
    });
    (before - part.len()) as u64
}

/// What has to be done after a simulation has taken in its outcome.
struct Concluded {
    key: u64,
    /// What goes to the journal; nothing where it panicked.
    left: Option<Left>,
    /// Whether it has orders, or nothing more to do.
    review: bool,
}

/// Units that a frame had.
fn units(part: &[&mut Simulation], outcome: &Outcome) -> u64 {
    let each = part.iter().zip(&outcome.work);
    each.map(|(simulation, work)| simulation.portions.units(work)).sum()
}

/// Lets simulations take in their outcomes, in the order of the frame's work. For most of them there is nothing to be done after that.
fn conclude(
    part: Vec<&mut Simulation>,
    outcome: Outcome,
    bill: Bill,
) -> impl Iterator<Item = Concluded> + use<> {
    let published = &outcome.published;
    let concluded = parallel::each_pair(part, outcome.work, |simulation, work| {
        let left = caught(|| {
            let units = simulation.portions.units(&work);
            simulation.charge(units, bill.part(units));
            let tiles = published.tiles(work.tiles.clone());
            simulation.conclude(work, tiles);
            simulation.leave()
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
        let now = machine::now();
        now.duration_since(std::mem::replace(&mut self.0, now))
    }
}

/// The value, or nothing where there was a panic.
pub(super) fn caught<T>(act: impl FnOnce() -> T) -> Option<T> {
    catch_unwind(AssertUnwindSafe(act)).ok()
}
