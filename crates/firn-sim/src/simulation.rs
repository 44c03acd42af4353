//! One thread, one seed: what happens next is drawn, done, and compared with what clients were told.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;
use std::time::Duration;

use firn::machine::Simulated;
use firn::session::{
    Change, Limits, ManualJournal, ManualWorld, SessionError, Sessions, StoreState, WorldConfig,
};
use firn_protocol::stream::SubProtocol;
use firn_protocol::{SessionSpec, SettingsPatch, SnowLayer, StepSpec};
use firn_snow::Grid;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

use crate::client::{self, Request, wait_for};
use crate::device::Switches;
use crate::disk::{Disk, Failing};
use crate::machine::Machine;
use crate::model::{Fate, Model, Operation, State, metres};
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
    report: Report,
}

impl Simulation {
    /// Runs a number of steps.
    pub fn run(seed: u64, steps: u64) -> (Report, Result<(), String>) {
        let machine = Rc::new(Machine::new(seed));
        let _simulated = firn::machine::simulate(machine.clone());
        let mut simulation = Simulation::new(seed, machine);
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
            report: Report::new(),
        }
    }

    fn go(&mut self, steps: u64) -> Result<(), String> {
        self.start()?;
        for step in 1..=steps {
            self.step()?;
            if step % PERIOD == 0 || self.models.values().any(|model| model.doubts() > MOST_DOUBTS)
            {
                self.compare().map_err(|why| format!("at step {step}: {why}"))?;
            }
        }
        self.compare()
    }

    /// Draws what happens next.
    fn step(&mut self) -> Result<(), String> {
        match self.dice.random_range(0..1000) {
            0..320 => self.turn()?,
            320..470 => self.journal(ManualJournal::commit),
            470..530 => self.journal(ManualJournal::pack),
            530..580 => self.machine.work(),
            580..760 => self.poll()?,
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

    /// Draws what fails.
    fn fault(&mut self) -> Result<(), String> {
        match self.dice.random_range(0..100) {
            0..8 => {
                self.report.fault("device lost");
                self.device.lose();
            }
            8..12 => {
                self.report.fault("panic");
                self.device.panic();
            }
            12..18 => {
                self.report.fault("device full");
                self.device.set_full(true);
            }
            18..34 => self.device.heal(),
            34..38 => {
                self.report.fault("device absent");
                self.device.set_absent(true);
            }
            38..52 => {
                let ways = [
                    Failing::Full,
                    Failing::ReadOnly,
                    Failing::NoSync,
                    Failing::NoSyncOnce,
                    Failing::NoSyncOnce,
                    Failing::Panic,
                ];
                self.report.fault("disk");
                self.disk.fail(Some(ways[self.dice.random_range(0..ways.len())]));
            }
            52..70 => self.disk.fail(None),
            70..80 if !self.waiting.is_empty() => {
                let place = self.dice.random_range(0..self.waiting.len());
                // HTTP carries these out to their end, whoever has gone away; who asks again waits for that.
                let Request { operation, once, .. } = &self.waiting[place];
                let kept =
                    once.is_some() || matches!(operation, Operation::Create | Operation::Delete);
                if !kept {
                    self.report.fault("request abandoned");
                    self.give_up(place);
                }
            }
            80..86 => {
                self.report.fault("connection lost");
                let place = self.dice.random_range(0..self.viewers.len());
                self.viewers[place].cut();
            }
            86..89 => {
                self.report.fault("clock set");
                let ahead = self.dice.random_range(-100_000_000..100_000_000);
                self.machine.set_date(ahead);
            }
            89..92 => {
                self.report.fault("machine stalled");
                let seconds = self.dice.random_range(1..100);
                self.machine.advance(Duration::from_secs(seconds));
            }
            92..98 => {
                self.report.fault("crash");
                self.crash()?;
            }
            98..100 => {
                self.report.fault("stop");
                self.stop()?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Has the world do a frame, at the next beat or before.
    fn turn(&mut self) -> Result<(), String> {
        let Some(life) = &mut self.life else { return Ok(()) };
        if self.dice.random_bool(0.7) {
            let left = life.world.next_beat().saturating_duration_since(self.machine.now());
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

    fn journal(&self, act: impl FnOnce(&mut ManualJournal)) {
        if let Some(journal) = self.machine.journal().borrow_mut().as_mut() {
            act(journal);
        }
    }

    /// Sends a request that waits to be sent, or looks for an answer.
    fn poll(&mut self) -> Result<(), String> {
        if self.waiting.is_empty() {
            return Ok(());
        }
        let place = self.dice.random_range(0..self.waiting.len());
        self.poll_one(place);
        Ok(())
    }

    /// Returns whether it has an answer.
    fn poll_one(&mut self, place: usize) -> bool {
        let Some(life) = &self.life else { return false };
        let request = &mut self.waiting[place];
        let Some(model) = self.models.get_mut(&*request.session) else { return false };
        let asked = *request.place.get_or_insert_with(|| model.ask(request.operation.clone()));
        let spec = model.spec.clone();
        let Some(fate) = request.poll(&life.sessions, &spec) else { return false };
        let request = self.waiting.swap_remove(place);
        // Who does not know, and may ask again, does.
        if fate != Fate::Done && request.once.is_some() && !self.dice.random_bool(0.1) {
            self.waiting.push(request);
            self.waiting.last_mut().expect("it was put there").lose();
            return false;
        }
        self.report.requests.1 += u64::from(fate == Fate::Done);
        // What was sent several times may have been done, although the last answer refuses it.
        let fate =
            if request.once.is_some() && fate == Fate::Refused { Fate::Unknown } else { fate };
        model.learn(asked, fate);
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
        // Nobody can tell whether snow fell before a reset, or after it.
        let unclear = |request: &Request| request.session == name;
        if matches!(operation, Operation::Reset | Operation::Delete | Operation::Create)
            && self.waiting.iter().any(unclear)
            || self.waiting.iter().any(|request| {
                unclear(request)
                    && matches!(
                        request.operation,
                        Operation::Reset | Operation::Delete | Operation::Create
                    )
            })
        {
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

    /// The process dies, and with it all that was not synced, or some of it.
    fn crash(&mut self) -> Result<(), String> {
        let seed = self.dice.random();
        let disk = self.disk.cut(seed);
        // What a dead process writes is nobody's business.
        self.disk.fail(None);
        self.die();
        self.disk = disk;
        self.start()
    }

    /// The server stops as it should.
    fn stop(&mut self) -> Result<(), String> {
        let Some(Life { world, sessions }) = self.life.take() else { return self.start() };
        sessions.close();
        let deadline = self.machine.now() + Duration::from_secs(5);
        world.stop(deadline);
        if let Some(journal) = self.machine.journal().take() {
            // A disk may panic to the end.
            let _ = catch_unwind(AssertUnwindSafe(|| journal.end()));
        }
        // What was answered before the end was.
        for place in (0..self.waiting.len()).rev() {
            if self.waiting[place].place.is_some() {
                let model = &self.models[&*self.waiting[place].session];
                let spec = model.spec.clone();
                if let Some(fate) = self.waiting[place].poll(&sessions, &spec) {
                    let request = &self.waiting[place];
                    let asked = request.place.expect("it was sent");
                    if request.once.is_none() || fate == Fate::Done {
                        let request = self.waiting.swap_remove(place);
                        let model = self.models.get_mut(&*request.session).expect("it has one");
                        model.learn(asked, fate);
                    }
                }
            }
        }
        drop(sessions);
        let disk = self.disk.cut(self.dice.random());
        self.disk.fail(None);
        self.die();
        self.disk = disk;
        self.start()
    }

    /// Ends everything that lives in the process.
    fn die(&mut self) {
        self.life = None;
        self.machine.journal().take();
        self.machine.forget();
        for place in (0..self.waiting.len()).rev() {
            if self.waiting[place].place.is_some() {
                self.give_up(place);
            }
        }
        self.viewers.iter_mut().for_each(Viewer::cut);
        self.report.restarts += 1;
    }

    fn start(&mut self) -> Result<(), String> {
        self.device.set_absent(false);
        let durability = self.disk.durability(CHECKPOINTS);
        let opened = ManualWorld::open(self.device.open(), CONFIG, durability);
        let (sessions, world, journal) =
            opened.map_err(|why| format!("the server does not start: {why}"))?;
        let store = &sessions.vitals().store;
        let (state, lost) = (store.state(), store.lost_sessions());
        if (state, lost) != (StoreState::Sound, 0) {
            return Err(format!("the store is {state:?} at a start, and {lost} sessions are lost"));
        }
        self.machine.journal().replace(Some(journal));
        self.life = Some(Life { world, sessions });
        Ok(())
    }

    /// Lets everything work.
    fn round(&mut self) -> Result<(), String> {
        self.machine.advance(Duration::from_millis(17));
        self.turn()?;
        self.machine.work();
        self.journal(ManualJournal::pack);
        self.journal(ManualJournal::commit);
        Ok(())
    }

    /// Has nothing fail any more, waits until everybody has an answer, and compares what is there with what
    /// was told.
    fn compare(&mut self) -> Result<(), String> {
        self.report.checks += 1;
        self.disk.fail(None);
        self.device.heal();
        let mut rounds = 0;
        while !self.is_calm() {
            rounds += 1;
            if rounds > 4000 {
                let waiting: Vec<_> =
                    self.waiting.iter().map(|it| (&it.session, &it.operation)).collect();
                return Err(format!("somebody waits for ever: {waiting:?}"));
            }
            self.round()?;
            let mut place = 0;
            while place < self.waiting.len() {
                place += usize::from(!self.poll_one(place));
            }
        }
        for name in NAMES {
            self.compare_session(name)?;
        }
        for viewer in &mut self.viewers {
            viewer.check().map_err(|why| format!("session '{}': {why}", viewer.session()))?;
        }
        self.compare_twin()?;
        for name in NAMES {
            if self.models[name].found().is_some_and(|state| !state.paused) {
                self.set_paused(name, false)?;
            }
        }
        Ok(())
    }

    fn is_calm(&self) -> bool {
        let Some(life) = &self.life else { return false };
        let vitals = life.sessions.vitals();
        self.waiting.is_empty() && vitals.is_recovered() && vitals.store.is_healthy()
    }

    /// Carries out something to its end.
    fn wait<T>(
        &mut self,
        what: &str,
        ask: impl AsyncFnOnce(Sessions) -> Result<T, SessionError>,
    ) -> Result<Result<T, SessionError>, String> {
        let Some(life) = &self.life else { return Err("there is no server".to_owned()) };
        let sessions = life.sessions.clone();
        let mut failed = Ok(());
        let answer = wait_for(what, ask(sessions), || {
            if let Err(why) = self.round() {
                failed = Err(why);
            }
        });
        failed?;
        answer
    }

    fn compare_session(&mut self, name: &'static str) -> Result<(), String> {
        let grid = self.models[name].spec.grid;
        let look = async |sessions: Sessions| {
            let session = sessions.get(name)?;
            // Reads may overtake changes of which nobody waits for the end.
            session.change(Change::Settings(SettingsPatch::default())).await?;
            let mass = session.mass().await?;
            Ok((session.view(), mass, session.mirror().colliders.clone()))
        };
        let found = match self
            .wait("masses", look)
            .map_err(|why| format!("session '{name}': {why}"))?
        {
            Ok((view, mass, objects)) => {
                if mass.imbalance_quanta != 0 {
                    return Err(format!("session '{name}' is out of balance: {mass:?}"));
                }
                let fallen = (mass.fallen / grid.kilograms(1)).round() as u128;
                let objects = objects.iter();
                Some(State {
                    fallen,
                    air: view.settings.air_temperature as i32,
                    paused: view.settings.paused,
                    objects: objects
                        .map(|object| (object.id.parse().unwrap_or(u8::MAX), object.mass as u32))
                        .collect(),
                })
            }
            Err(SessionError::NotFound { .. }) => None,
            Err(why) => return Err(format!("session '{name}' can't be read: {why}")),
        };
        let model = self.models.get_mut(name).expect("each has one");
        model.find(found).map_err(|why| format!("session '{name}': {why}"))
    }

    fn set_paused(&mut self, name: &'static str, paused: bool) -> Result<(), String> {
        let patch = SettingsPatch { paused: Some(paused), ..SettingsPatch::default() };
        let pause =
            async |sessions: Sessions| sessions.get(name)?.change(Change::Settings(patch)).await;
        let answer = self.wait("a pause", pause)?;
        answer.map(drop).map_err(|why| format!("session '{name}' can't be paused: {why}"))
    }

    /// Compares with what another server makes of a copy of the disk.
    fn compare_twin(&mut self) -> Result<(), String> {
        let mut digests = BTreeMap::new();
        for name in NAMES {
            if self.models[name].found().is_none() {
                continue;
            }
            self.set_paused(name, true)?;
            let digest = self.wait("a snapshot", async |sessions: Sessions| {
                let session = sessions.get(name)?;
                let digest = session.snapshot().await?.digest()?;
                Ok((session.view().tick, digest))
            })?;
            digests.insert(name, digest.map_err(|why| format!("session '{name}': {why}"))?);
        }
        for _ in 0..20 {
            self.round()?;
        }
        let copy = self.disk.cut(0);
        let ours = (self.disk.clone(), self.life.take(), self.machine.journal().take());
        self.disk = copy;
        self.start()?;
        for (name, (tick, digest)) in &digests {
            let theirs = self.wait("a twin", async |sessions: Sessions| {
                let session = loop {
                    match sessions.get(name) {
                        Err(SessionError::Unavailable(_)) => client::later().await,
                        other => break other?,
                    }
                };
                let behind = tick.saturating_sub(session.view().tick);
                if behind > 0 {
                    session.step(StepSpec { ticks: Some(behind), ..StepSpec::default() }).await?;
                }
                let digest = session.snapshot().await?.digest()?;
                Ok((session.view().tick, digest))
            })?;
            let theirs = theirs.map_err(|why| format!("session '{name}' of a twin: {why}"))?;
            if theirs != (*tick, digest.clone()) {
                return Err(format!(
                    "session '{name}' has come to {:?}, and another server to {theirs:?}",
                    (tick, digest)
                ));
            }
        }
        drop(self.life.take());
        self.machine.journal().take();
        let (disk, life, journal) = ours;
        (self.disk, self.life) = (disk, life);
        self.machine.journal().replace(journal);
        Ok(())
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
