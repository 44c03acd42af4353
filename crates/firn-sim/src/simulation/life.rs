//! Lives of the server: how they begin, and all the ways in which they end.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use firn::driver::ManualWorld;
use firn::machine::Simulated;
use firn::session::{Sessions, StoreState};
use rand::Rng;

use crate::client;
use crate::disk::Disk;
use crate::model::Fate;
use crate::viewer::Viewer;

use super::{CHECKPOINTS, CONFIG, Life, Simulation};

impl Simulation {
    /// The process dies, and with it all that was not synced, or some of it.
    pub(super) fn crash(&mut self) -> Result<(), String> {
        let disk = self.disk.cut(self.dice.random());
        self.lose_power(disk)
    }

    /// As if the process had died when only that was on its disk.
    pub(super) fn lose_power(&mut self, disk: Disk) -> Result<(), String> {
        // What a dead process writes is nobody's business.
        self.disk.fail(None);
        self.die();
        self.disk = disk;
        self.start()
    }

    /// The server stops as it should.
    pub(super) fn stop(&mut self) -> Result<(), String> {
        let Some(Life { world, sessions }) = self.life.take() else { return self.start() };
        sessions.close();
        let deadline = self.machine.now() + Duration::from_secs(5);
        world.stop(deadline);
        if let Some(journal) = self.machine.journal().take() {
            // A disk may panic also when it is closed.
            let _ = catch_unwind(AssertUnwindSafe(|| journal.end()));
        }
        self.hear_the_last(&sessions);
        drop(sessions);
        let disk = self.disk.cut(self.dice.random());
        self.disk.fail(None);
        self.die();
        self.disk = disk;
        self.start()
    }

    /// Hears what was answered before the end.
    fn hear_the_last(&mut self, sessions: &Sessions) {
        for place in (0..self.waiting.len()).rev() {
            let request = &mut self.waiting[place];
            // What was told already is asked again in the next life.
            if request.first.is_some() {
                continue;
            }
            let (Some(asked), Some(model)) =
                (request.place, self.models.get_mut(&*request.session))
            else {
                continue;
            };
            let Some(answer) = request.poll(sessions, model) else { continue };
            let fate = client::fate(&answer);
            if request.once.is_none() || fate == Fate::Done {
                model.learn(asked, fate, &answer);
                self.waiting.swap_remove(place);
            }
        }
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

    pub(super) fn start(&mut self) -> Result<(), String> {
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
}
