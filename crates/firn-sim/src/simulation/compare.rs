//! Everything is healed, everybody has to get an answer, and what is there has to be what was told.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use firn::session::{Change, Session, SessionError, Sessions};
use firn_protocol::{SettingsPatch, StepSpec};
use rand::Rng;

use crate::client::{self, wait_for};
use crate::machine::Worker;
use crate::model::{Fate, Found, Operation, quanta};
use crate::panics;

use super::{NAMES, Simulation};

/// Longer than a comparison takes.
const LONG: Duration = Duration::from_secs(1000);

impl Simulation {
    /// Lets everything work.
    fn round(&mut self) -> Result<(), String> {
        self.machine.begin();
        self.machine.advance(Duration::from_millis(17));
        if !self.life.as_mut().is_some_and(|life| life.world.turn()) {
            return Err("the server gives up although nothing fails".to_owned());
        }
        if let Some(why) = self.wrong.take().or_else(panics::unexpected) {
            return Err(why);
        }
        self.work(Worker::Reads);
        self.work(Worker::Packs);
        self.work(Worker::Commits);
        Ok(())
    }

    /// Has nothing fail any more, waits until everybody has an answer, and compares what is there with what
    /// was told.
    pub(super) fn compare(&mut self) -> Result<(), String> {
        self.report.checks += 1;
        self.disk.fail(None);
        self.disk.cut_at(None);
        self.device.heal();
        self.machine.heal();
        // With no checkpoint another server has to go through everything again.
        if self.dice.random_bool(0.5) {
            self.machine.stall(Worker::Packs, LONG);
        }
        // What has just failed is heard of in the next one.
        self.round()?;
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
            if !viewer.is_open()
                && let Some(life) = &self.life
            {
                viewer.connect(&life.sessions, &mut self.dice);
            }
            viewer.check().map_err(|why| format!("session '{}': {why}", viewer.session()))?;
        }
        self.compare_twin()?;
        self.machine.heal();
        for name in NAMES {
            if self.models[name].found().is_some_and(|state| !state.paused) {
                self.set_paused(name, false)?;
            }
        }
        NAMES.into_iter().try_for_each(|name| self.serve(name))
    }

    /// Where nothing fails nothing is refused: a session can be made, snow falls, and states are kept and come
    /// back.
    fn serve(&mut self, name: &'static str) -> Result<(), String> {
        let model = &self.models[name];
        let missing = model.found().is_none();
        if missing && self.dice.random_bool(0.5) {
            return Ok(());
        }
        let kept = model.found().and_then(|state| state.kept.keys().next().copied());
        let operation = match (self.dice.random_range(0..10), kept) {
            _ if missing => Operation::Create(0),
            (0, Some(name)) => Operation::GoBack(name),
            (1, _) => Operation::Keep(self.dice.random_range(0..4)),
            _ => Operation::Snowfall(1),
        };
        let Some(life) = &self.life else { return Err("there is no server".to_owned()) };
        let sent =
            client::send(life.sessions.clone(), name.to_owned(), operation.clone(), None, model);
        let answer = self.wait("a request while nothing fails", async move |_| sent.await)?;
        if let Err(why) = &answer {
            return Err(format!("session '{name}': {operation:?} is refused: {why}"));
        }
        let model = self.models.get_mut(name).expect("each has one");
        let place = model.ask(operation);
        model.learn(place, Fate::Done, &answer);
        Ok(())
    }

    fn is_calm(&self) -> bool {
        let Some(life) = &self.life else { return false };
        let vitals = life.sessions.vitals();
        let well = vitals.is_healthy() && vitals.store.is_healthy();
        self.waiting.is_empty() && vitals.is_recovered() && well
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
            let token = session.tokens().token.to_hex().to_string();
            let kept = session.checkpoints().into_iter();
            let kept = kept.map(|point| point.name.parse().unwrap_or(u8::MAX)).collect();
            Ok((session.view(), mass, session.mirror().colliders.clone(), token, kept))
        };
        let found =
            match self.wait("masses", look).map_err(|why| format!("session '{name}': {why}"))? {
                Ok((view, mass, objects, token, kept)) => {
                    if mass.imbalance_quanta != 0 {
                        return Err(format!("session '{name}' is out of balance: {mass:?}"));
                    }
                    let objects = objects.iter();
                    Some(Found {
                        fallen: self.models[name]
                            .let_fall(quanta(mass.fallen, &grid), mass.stamp.tick),
                        cleared: quanta(mass.cleared, &grid),
                        air: view.settings.air_temperature as i32,
                        paused: view.settings.paused,
                        objects: objects
                            .map(|object| {
                                (object.id.parse().unwrap_or(u8::MAX), object.body.mass as u32)
                            })
                            .collect(),
                        token,
                        tick: view.tick,
                        kept,
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
                let snapshot = session.snapshot().await?;
                let kept = kept(&session).await?;
                Ok((session.view().tick, snapshot.digest()?, kept, snapshot.encode()?))
            })?;
            let (tick, digest, kept, snapshot) =
                digest.map_err(|why| format!("session '{name}': {why}"))?;
            digests.insert(name, (tick, digest, kept));
            if self.dice.random_bool(0.1)
                && let Some(model) = self.models.get_mut(name)
            {
                model.keep(snapshot.into());
            }
        }
        for _ in 0..20 {
            self.round()?;
        }
        let copy = self.disk.cut(0);
        let ours = (self.disk.clone(), self.life.take(), self.machine.journal().take());
        let aside = self.machine.swap(VecDeque::new());
        self.disk = copy;
        self.start()?;
        for (name, (tick, digest, kept_here)) in &digests {
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
                Ok((session.view().tick, digest, kept(&session).await?))
            })?;
            let theirs = theirs.map_err(|why| format!("session '{name}' of a twin: {why}"))?;
            if (theirs.0, &theirs.1) != (*tick, digest) {
                return Err(format!(
                    "session '{name}' has come to {:?}, and another server to {:?}",
                    (tick, digest),
                    (theirs.0, theirs.1)
                ));
            }
            if theirs.2 != *kept_here {
                return Err(format!("another server keeps other states of session '{name}'"));
            }
        }
        drop(self.life.take());
        self.machine.journal().take();
        let (disk, life, journal) = ours;
        (self.disk, self.life) = (disk, life);
        self.machine.journal().replace(journal);
        self.machine.swap(aside);
        Ok(())
    }
}

/// The names under which states of a session are kept, and their snapshots.
async fn kept(session: &Session) -> Result<Vec<(String, Vec<u8>)>, SessionError> {
    let mut kept = Vec::new();
    for point in session.checkpoints() {
        let snapshot = session.checkpoint_snapshot(&point.name).await?;
        kept.push((point.name, snapshot));
    }
    Ok(kept)
}
