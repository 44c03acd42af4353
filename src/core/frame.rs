//! One frame: simulations say what they have to do, the backend does it, and they take in what came
//! of it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering;

use firn_engine::frame::{Frame, Outcome, Work};
use firn_engine::parallel::Executor;

use crate::core::record::Left;
use crate::core::session::{Bill, Charge, MOST_SAMPLES, Simulation, Turn, who_waits};
use crate::core::simulations::Simulations;
use crate::core::{Effect, Job, Now, World};

/// A frame that the backend has.
pub(crate) struct InFlight {
    /// Places of the simulations that it is for, in the order of its work.
    places: Vec<usize>,
    /// A beat came with it.
    beat: bool,
}

impl World {
    /// Has one frame carried out for everybody who has something to do.
    pub(crate) fn begin_frame(&mut self, publish: bool, beat: bool) {
        self.busy = false;
        let turn = Turn {
            frame: self.frame,
            round: self.round + 1,
            publish,
            sleep: self.config.sleep,
            slipped_us: &self.vitals.slipped_us,
            weather_steps: &self.vitals.weather_steps,
        };
        // Nobody waits where all of them come back or are saved.
        let take_turns = self.recovered && self.stop.is_none();
        let Planned { work, places, idle, failed, waiting } =
            plan(&mut self.simulations, self.executor, turn, take_turns);
        self.vitals.waits.fetch_add(waiting.over_share + waiting.for_others, Ordering::Relaxed);
        // What a share allows is a matter of time: the next beat is soon enough.
        self.busy |= waiting.for_others > 0;
        failed.into_iter().for_each(|key| self.fell(key));
        for key in idle {
            self.review(key);
        }
        if work.is_empty() {
            self.end_frame(beat);
        } else {
            self.round += 1;
            self.in_flight = Some(InFlight { places, beat });
            self.effects.push(Effect::Submit(Frame { work }));
        }
    }

    /// Takes in what a frame has done.
    pub(crate) fn conclude_frame(&mut self, outcome: Outcome) {
        let Some(InFlight { places, beat }) = self.in_flight.take() else { return };
        let part = self.simulations.at_mut(&places);
        let bill = Bill { took: outcome.took, units: units(&part, &outcome) };
        self.vitals.charge(bill.sum());
        let (mut failed, mut idle) = (Vec::new(), Vec::new());
        for done in conclude(part, self.executor, outcome, bill, self.now) {
            match done.left {
                Some(left) => self.hand_over(done.key, left),
                None => failed.push(done.key),
            }
            if done.review {
                idle.push(done.key);
            }
        }
        failed.into_iter().for_each(|key| self.fell(key));
        for key in idle {
            self.review(key);
        }
        self.end_frame(beat);
    }

    /// Hands what a frame has left of a session to the journal.
    fn hand_over(&mut self, key: u64, left: Left) {
        if let Some(append) = left.append {
            self.submit(append, Vec::new());
        }
        if let Some(simulation) = self.simulations.get(&key) {
            let ticks = simulation.log.ticks();
            self.simulations.set_ticking(key, ticks);
        }
        if let Some((life, base, taken)) = left.checkpoint {
            self.effects.push(Effect::Pack(Job { key, life, base, taken }));
        }
    }

    /// What follows each frame.
    fn end_frame(&mut self, beat: bool) {
        if self.stop.is_some() {
            return;
        }
        self.busy |= self.has_mail();
        self.advance_coming();
        if beat {
            self.saving = self.begin_checkpoint();
        }
    }
}

/// What simulations do in a frame.
struct Planned {
    work: Vec<Work>,
    /// Places of those that it is for, in the same order.
    places: Vec<usize>,
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
fn plan(
    simulations: &mut Simulations,
    executor: Executor,
    turn: Turn,
    take_turns: bool,
) -> Planned {
    let mut part = simulations.active_mut();
    let waiting = if take_turns { wait(&mut part, turn) } else { Waiting::default() };
    wait_for_room(&mut part, turn);
    let mut members =
        part.iter().map(|simulation| simulation.place).collect::<Vec<_>>().into_iter();
    let plans = executor.each(part, |simulation| caught(|| simulation.plan(turn)));
    let (mut places, mut idle, mut failed) = (Vec::with_capacity(plans.len()), vec![], vec![]);
    // Collected where the plans lie: thousands of them are megabytes.
    let work = plans.into_iter().filter_map(|plan| {
        let place = members.next()?;
        match plan {
            Some(Some(work)) => {
                places.push(place);
                return Some(work);
            }
            Some(None) => idle.push(place),
            None => failed.push(place),
        }
        None
    });
    let work = work.collect();
    let keys = |places: Vec<usize>| places.into_iter().filter_map(|at| simulations.key(at));
    Planned { work, places, idle: keys(idle).collect(), failed: keys(failed).collect(), waiting }
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

/// Takes those out for whose cells, of the fixed grid or of columns, the frame has no room. Who comes first is another one
/// in each frame.
fn wait_for_room(part: &mut Vec<&mut Simulation>, turn: Turn) {
    take_out(part, turn, |part| {
        let all = (0..).zip(part);
        let mut wanted: Vec<(usize, u64)> = all
            .map(|(place, simulation)| (place, simulation.read_cells()))
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
    executor: Executor,
    outcome: Outcome,
    bill: Bill,
    now: Now,
) -> impl Iterator<Item = Concluded> + use<> {
    let published = &outcome.published;
    let concluded = executor.each_pair(part, outcome.work, |simulation, work| {
        let left = caught(|| {
            let units = simulation.portions.units(&work);
            simulation.charge(units, bill.part(units));
            let tiles = published.tiles(work.tiles.clone());
            simulation.conclude(work, tiles, now.stored);
            simulation.leave(now.instant)
        });
        let review = simulation.has_orders() || !simulation.wants_frames();
        let nothing = !review && left.as_ref().is_some_and(Left::is_nothing);
        (!nothing).then(|| Box::new(Concluded { key: simulation.session.key, left, review }))
    });
    concluded.into_iter().flatten().map(|concluded| *concluded)
}

/// The value, or nothing where there was a panic.
pub(crate) fn caught<T>(act: impl FnOnce() -> T) -> Option<T> {
    catch_unwind(AssertUnwindSafe(act)).ok()
}
