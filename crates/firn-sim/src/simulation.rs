//! One thread, one seed: what happens next is drawn, done, and compared with what clients were told.

mod ask;
mod compare;
mod fault;
mod life;

use std::collections::BTreeMap;
use std::rc::Rc;
use std::time::{Duration, Instant};

use firn::driver::{ManualJournal, ManualWorld, WorldConfig};
use firn::machine::Simulated;
use firn::session::{Limits, Sessions};
use firn_protocol::stream::SubProtocol;
use firn_protocol::{SessionSpec, SnowLayer};
use firn_snow::{Grid, Pressing};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

use crate::client::Request;
use crate::device::Switches;
use crate::disk::Disk;
use crate::machine::{Machine, Worker};
use crate::model::{Model, metres};
use crate::panics;
use crate::report::Report;
use crate::viewer::Viewer;

/// Names of sessions.
const NAMES: [&str; 4] = ["a", "b", "c", "d"];

/// Requests of one session in doubt, from which on everything is compared.
const MOST_DOUBTS: usize = 10;

/// Steps between two comparisons, about.
const PERIOD: u64 = 400;

/// Time between checkpoints.
const CHECKPOINTS: Duration = Duration::from_millis(400);

const CONFIG: WorldConfig = WorldConfig {
    limits: Limits {
        sessions: 100,
        columns_per_session: 1 << 16,
        columns: 1 << 20,
        cells_per_session: 1 << 20,
        cells: 1 << 24,
        colliders_per_session: 100,
    },
    publish_rate: 20.0,
    sleep: true,
};

/// A server that runs.
struct Life {
    world: ManualWorld,
    sessions: Sessions,
}

/// A server on a machine that fails, and its clients.
pub struct Simulation {
    dice: SmallRng,
    machine: Rc<Machine>,
    disk: Disk,
    device: Switches,
    life: Option<Life>,
    waiting: Vec<Request>,
    models: BTreeMap<&'static str, Model>,
    viewers: Vec<Viewer>,
    keys: u64,
    /// Sessions that hibernated when that was last looked at.
    asleep: u64,
    /// Something that was told and can't be right.
    wrong: Option<String>,
    /// Whether answers are told.
    tells: bool,
    report: Report,
}

impl Simulation {
    /// Runs a number of steps, and `tells` what clients are answered.
    pub fn run(seed: u64, steps: u64, tells: bool) -> (Report, Result<(), String>) {
        let machine = Rc::new(Machine::new(seed));
        let _simulated = firn::machine::simulate(machine.clone());
        let mut simulation = Simulation { tells, ..Simulation::new(seed, machine) };
        let result = simulation.go(steps);
        let Simulation { mut report, viewers, disk, .. } = simulation;
        report.fingerprint = disk.fingerprint();
        report.recovered = viewers.iter().map(|viewer| viewer.recovered).sum();
        (report, result)
    }

    fn new(seed: u64, machine: Rc<Machine>) -> Simulation {
        let mut dice = SmallRng::seed_from_u64(!seed);
        let models = NAMES.map(|name| (name, Model::new(spec(name, &mut dice))));
        let protocols = [SubProtocol::Json, SubProtocol::Binary];
        let watch = |name: &str| protocols.map(|protocol| Viewer::new(name.to_owned(), protocol));
        Simulation {
            dice,
            machine,
            disk: Disk::default(),
            device: Switches::default(),
            life: None,
            waiting: Vec::new(),
            models: BTreeMap::from(models),
            viewers: NAMES[..2].iter().flat_map(|name| watch(name)).collect(),
            keys: 0,
            asleep: 0,
            wrong: None,
            tells: false,
            report: Report::new(),
        }
    }

    fn go(&mut self, steps: u64) -> Result<(), String> {
        self.start()?;
        for step in 1..=steps {
            self.machine.begin();
            self.step()?;
            self.look()?;
            if step % PERIOD == 0 || self.models.values().any(|model| model.doubts() > MOST_DOUBTS)
            {
                self.compare().map_err(|why| format!("at step {step}: {why}"))?;
            }
        }
        self.compare()
    }

    /// Looks whether something happened in a step that ends a life, or that should never happen.
    fn look(&mut self) -> Result<(), String> {
        // What is too old may be carried out again.
        let old = |at: Instant| self.machine.now() - at > Duration::from_secs(300);
        self.waiting.retain(|request| !request.first.as_ref().is_some_and(|(_, at)| old(*at)));
        if let Some(why) = self.wrong.take().or_else(panics::unexpected) {
            return Err(why);
        }
        match self.disk.left() {
            Some(disk) => self.lose_power(disk),
            None => Ok(()),
        }
    }

    /// Draws what happens next.
    fn step(&mut self) -> Result<(), String> {
        match self.dice.random_range(0..1000) {
            0..320 => self.turn()?,
            320..470 => self.work(Worker::Commits),
            470..530 => self.work(Worker::Packs),
            530..580 => self.work(Worker::Reads),
            580..760 => self.poll(),
            760..850 => self.ask(),
            850..900 => self.watch()?,
            900..920 => {
                let milliseconds = self.dice.random_range(1..200);
                self.machine.advance(Duration::from_millis(milliseconds));
            }
            _ => self.fault()?,
        }
        Ok(())
    }

    /// Has the world do a frame, at the next beat or before.
    fn turn(&mut self) -> Result<(), String> {
        let Some(life) = &mut self.life else { return Ok(()) };
        if self.dice.random_bool(0.7) {
            let left = life.world.due().saturating_duration_since(self.machine.now());
            self.machine.advance(left);
        }
        if !life.world.turn() {
            self.report.fault("gave up");
            return self.crash();
        }
        let asleep = life.sessions.vitals().hibernating();
        self.report.hibernations += asleep.saturating_sub(self.asleep);
        self.asleep = asleep;
        Ok(())
    }

    /// Has a worker do something, where it gets time.
    fn work(&self, worker: Worker) {
        match worker {
            _ if !self.machine.works(worker) => {}
            Worker::Commits => self.journal(ManualJournal::commit),
            Worker::Packs => self.journal(ManualJournal::pack),
            Worker::Reads => self.machine.read(),
        }
    }

    fn journal(&self, act: impl FnOnce(&mut ManualJournal)) {
        if let Some(journal) = self.machine.journal().borrow_mut().as_mut() {
            act(journal);
        }
    }

    /// A client takes what its stream has for it, or connects again.
    fn watch(&mut self) -> Result<(), String> {
        let Some(life) = &self.life else { return Ok(()) };
        let place = self.dice.random_range(0..self.viewers.len());
        let viewer = &mut self.viewers[place];
        if viewer.is_open() {
            viewer.take()
        } else {
            viewer.connect(&life.sessions, &mut self.dice);
            Ok(())
        }
    }
}

/// What a session is made with.
fn spec(name: &str, dice: &mut SmallRng) -> SessionSpec {
    let side = [8, 9, 16][dice.random_range(0..3)];
    let mut grid = Grid { width: side, depth: 8, height: 6, cell_size: 0.2 };
    let snowfall_rate = [0.0, 0.0, 2.0, 10.0][dice.random_range(0..4)];
    if snowfall_rate > 0.0 && dice.random_bool(0.5) {
        // Large enough to have its snow in two bands.
        grid.depth = 8192 / grid.width + 64;
    }
    let mut spec = SessionSpec {
        id: Some(name.to_owned()),
        grid,
        tick_rate: [7.0, 20.0, 60.0, 144.0][dice.random_range(0..4)],
        paused: dice.random_bool(0.3),
        initial_snow: vec![SnowLayer::new(metres(dice.random_range(50..800), &grid))],
        snowfall_rate,
        idle_timeout_s: dice.random_bool(0.5).then_some(1.0),
        pressing: [Pressing::Creep, Pressing::Within(0.0), Pressing::Within(0.25)]
            [dice.random_range(0..3)],
        ..SessionSpec::default()
    };
    spec.air_temperature = f64::from(-dice.random_range(1..20));
    spec
}
