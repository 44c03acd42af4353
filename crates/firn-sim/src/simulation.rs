//! One thread, one seed: what happens next is drawn, done, and compared with what clients were told.

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
use firn_snow::Grid;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

use crate::client::{self, Request};
use crate::device::Switches;
use crate::disk::Disk;
use crate::machine::{Machine, Worker};
use crate::model::{Fate, Model, Operation, metres};
use crate::panics;
use crate::report::Report;
use crate::viewer::Viewer;

/// Names of sessions.
const NAMES: [&str; 4] = ["a", "b", "c", "d"];

/// Requests without an answer at a time.
const MOST_WAITING: usize = 12;

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

    /// Sends a request that waits to be sent, or looks for an answer.
    fn poll(&mut self) {
        if !self.waiting.is_empty() {
            let place = self.dice.random_range(0..self.waiting.len());
            self.poll_one(place);
        }
    }

    /// Returns whether it has an answer.
    fn poll_one(&mut self, place: usize) -> bool {
        let Some(life) = &self.life else { return false };
        let request = &mut self.waiting[place];
        let Some(model) = self.models.get_mut(&*request.session) else { return false };
        let asked = *request.place.get_or_insert_with(|| model.ask(request.operation.clone()));
        let spec = model.spec.clone();
        let Some(answer) = request.poll(&life.sessions, &spec) else { return false };
        if self.tells {
            println!("{} {:?}: {answer:?}", request.session, request.operation);
        }
        let fate = client::fate(&answer);
        let mut request = self.waiting.swap_remove(place);
        request.doubtful |= fate == Fate::Unknown;
        request.forget();
        if let Some((first, _)) = request.first {
            // A repeat that is refused says nothing.
            if answer.as_ref().is_ok_and(|again| *again != first) {
                self.wrong = Some(format!("{first:?} was told first, and then {answer:?}"));
            }
            return true;
        }
        // Who does not know, and may ask again, does.
        if fate != Fate::Done && request.once.is_some() && !self.dice.random_bool(0.1) {
            self.waiting.push(request);
            return false;
        }
        self.report.requests.1 += u64::from(fate == Fate::Done);
        // An earlier answer may have been lost that said something else.
        let fate = if request.doubtful && fate == Fate::Refused { Fate::Unknown } else { fate };
        if let Ok(Some(applied)) = &answer {
            model.learn_tick(applied.stamp().tick);
        }
        model.learn(asked, fate);
        if let (Ok(told), true, true) = (answer, request.once.is_some(), self.dice.random_bool(0.3))
        {
            request.first = Some((told, self.machine.now()));
            self.waiting.push(request);
            return false;
        }
        true
    }

    /// Forgets a request that may have been carried out, or asks again later where it has a key.
    fn give_up(&mut self, place: usize) {
        if self.waiting[place].once.is_some() {
            self.waiting[place].lose();
        } else {
            self.waiting.swap_remove(place);
        }
    }

    /// A client has a wish.
    fn ask(&mut self) {
        if self.waiting.len() >= MOST_WAITING {
            return;
        }
        let name = NAMES[self.dice.random_range(0..NAMES.len())];
        let object = self.dice.random_range(0..4);
        let missing = self.models[name].found().is_none();
        let operation = match self.dice.random_range(0..100) {
            0..50 if missing => Operation::Create,
            0..10 => Operation::Create,
            10..12 => Operation::Delete,
            12..60 => Operation::Snowfall(self.dice.random_range(1..60)),
            60..70 => Operation::Air(-self.dice.random_range(1..30)),
            70..78 => Operation::Pause(self.dice.random_bool(0.3)),
            78..82 => Operation::Step(self.dice.random_range(1..200)),
            82..90 => Operation::Put(object, self.dice.random_range(1..100)),
            90..97 => Operation::Remove(object),
            _ => Operation::Reset,
        };
        // What is sent again and comes late must make no difference to what came meanwhile.
        let repeatable = matches!(operation, Operation::Snowfall(_));
        let once = (repeatable && self.dice.random_bool(0.4)).then(|| {
            self.keys += 1;
            client::key(self.keys)
        });
        // Nobody could tell what of them came before a reset, and what after it.
        let lone = |operation: &Operation| {
            matches!(operation, Operation::Create | Operation::Delete | Operation::Reset)
        };
        let mut others = self.waiting.iter().filter(|request| request.session == name);
        if others.any(|request| lone(&operation) || lone(&request.operation)) {
            return;
        }
        self.report.requests.0 += 1;
        self.waiting.push(Request::new(name, operation, once));
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
    let grid = Grid { width: side, depth: 8, height: 6, cell_size: 0.2 };
    let mut spec = SessionSpec {
        id: Some(name.to_owned()),
        grid,
        tick_rate: [7.0, 20.0, 60.0, 144.0][dice.random_range(0..4)],
        paused: dice.random_bool(0.3),
        initial_snow: vec![SnowLayer::new(metres(dice.random_range(50..800), &grid))],
        idle_timeout_s: dice.random_bool(0.5).then_some(1.0),
        ..SessionSpec::default()
    };
    spec.air_temperature = f64::from(-dice.random_range(1..20));
    spec
}
