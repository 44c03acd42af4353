//! Recovery of sessions whose snow is not on the device: after a start, a lost device, a panic, a change that
//! could not be stored, and when a session wakes. All of them take the same path.
//!
//! Another thread reads the stored sessions, several at a time. Each session then replays the changes since
//! its checkpoint, a part in each frame, while all other sessions go on, and publishes the result. Requests
//! for it wait meanwhile.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use tracing::{error, info, warn};

use crate::core::making::{Of, Room};
use crate::core::reading::{Decoded, Read};
use crate::core::record::{Anchor, Exact, Log, Part, Replay, Stored};
use crate::core::session::{Invalid, Outlet, Portions, SessionError, Simulation};
use crate::core::snapshot::Snapshot;
use crate::core::{Effect, World};

/// A session on its way back.
pub(crate) struct Coming {
    session: Arc<Outlet>,
    pub stored: Stored,
    pub stage: Stage,
    /// The server has just been started: the mirror knows no heights, and nobody the session.
    at_start: bool,
    /// What has to be written before it comes back.
    first: Vec<Part>,
    /// A request waits for it.
    pub asked: bool,
}

/// How far it has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    /// Its turn will come.
    Queued,
    /// What is stored of it is being read.
    Reading,
    /// The backend takes it in.
    Making,
    /// It goes through what has happened since its checkpoint.
    Replaying,
    /// The coming frame shows what has come of that.
    Publishing,
}

impl Coming {
    /// Of a session that was stored when the server was started; `first` has to be written before it comes
    /// back.
    pub fn at_start(session: Arc<Outlet>, stored: Stored, first: Vec<Part>) -> Coming {
        Coming { session, stored, stage: Stage::Queued, at_start: true, first, asked: false }
    }

    /// The session.
    pub fn session(&self) -> &Arc<Outlet> {
        &self.session
    }

    /// What has to be written before it comes back.
    pub fn begin(&mut self) -> (u64, Vec<Part>) {
        (self.session.key, std::mem::take(&mut self.first))
    }

    /// Tick that it comes back at.
    pub fn tick(&self) -> u64 {
        self.stored.anchor.tick
    }

    /// Cells that it has.
    pub fn cells(&self) -> u64 {
        self.session.spec.grid.padded_cells()
    }
}

impl World {
    /// Has a session come back to what is stored of it. What its earlier life still does is void.
    pub(crate) fn come_back(&mut self, session: Arc<Outlet>) {
        let key = session.key;
        let Some(record) = self.records.get_mut(&key) else {
            // It was still being made.
            self.forget(key, &session);
            return;
        };
        record.life += 1;
        let stored = record.present();
        let before = self.coming.remove(&key);
        let (at_start, first) = before.map_or((false, Vec::new()), |it| (it.at_start, it.first));
        let (stage, asked) = (Stage::Queued, false);
        self.coming.insert(key, Coming { session, stored, stage, at_start, first, asked });
        self.queue.push_back(key);
    }

    /// Has a session come back that has reached a tick and may have published states that are lost now. Until
    /// its next checkpoint is stored, a client that resumes after a restart is only believed up to the newest
    /// seq that is stored now.
    pub(crate) fn go_back_from(&mut self, session: Arc<Outlet>, tick: u64) {
        let frame = self.frame;
        let clock = session.mirror().clock_at(frame);
        session.stand_still(clock);
        if let Some(record) = self.records.get(&session.key) {
            let anchor = record.anchor();
            let exact = match anchor.exact {
                Exact::Fixed(seq) => Exact::Fixed(seq),
                Exact::Runs | Exact::Stands(_) => Exact::Fixed(record.stored.newest_seq()),
            };
            // After a pause or a reset that is taken back, the session's own tick says nothing.
            let latest = record.tick_at(frame);
            let tick = if (anchor.tick..=latest).contains(&tick) { tick } else { latest };
            self.submit_anchor(session.key, Anchor { tick, frame, rate: 0.0, exact, ..anchor });
        }
        self.come_back(session);
    }

    /// Takes in sessions that were read, and has the backend make room for them. Where there is none they go on
    /// hibernating, and where they can't be read they are set aside. Waiting requests are refused, with the
    /// reason.
    pub(crate) fn take_in_all(&mut self, read: Vec<Read>) {
        for Read { key, life, decoded } in read {
            if !self.comes_back(key, life, Stage::Reading) {
                continue;
            }
            match decoded {
                Ok(Decoded { snapshot, made }) => {
                    if let Some(coming) = self.coming.get_mut(&key) {
                        coming.stage = Stage::Making;
                    }
                    self.make(made, Of::Return { key, life, snapshot });
                }
                // After a start nothing else tells the session's heights.
                Err(SessionError::NoMemory(why)) if !self.is_at_start(key) => {
                    self.hibernate_on(key, None, why);
                }
                Err(why) => self.set_aside(key, &why),
            }
        }
        self.busy = true;
    }

    /// Begins the replay of a session that there is room for.
    pub(crate) fn begin_replay(&mut self, key: u64, snapshot: Option<Box<Snapshot>>, room: Room) {
        let Room { slot, object_rows, units } = room;
        let (Some(coming), Some(record)) = (self.coming.get_mut(&key), self.records.get(&key))
        else {
            return self.free(slot);
        };
        coming.stage = Stage::Replaying;
        let (session, stored, at_start) =
            (coming.session.clone(), coming.stored.clone(), coming.at_start);
        session.hibernating.store(false, Ordering::Relaxed);
        let log = Log::resumed(record, &stored, self.now.instant);
        let mut simulation = Simulation::new(session, slot, self.frame, log, object_rows);
        simulation.brought_back = !at_start;
        if !self.recovered {
            simulation.portions = Portions::for_replay();
        }
        simulation.portions.furnish(units);
        self.simulations.insert(key, simulation);
        self.guard(key, |simulation| {
            simulation.begin_replay(snapshot.as_deref(), Replay::new(&stored, at_start));
        });
    }

    /// Whether a session is on its way back in one of its lives, and so far.
    pub(super) fn comes_back(&self, key: u64, life: u64, stage: Stage) -> bool {
        self.records.get(&key).is_some_and(|record| record.life == life)
            && self.coming.get(&key).is_some_and(|coming| coming.stage == stage)
    }

    /// Leaves a session hibernating for which there is no room.
    pub(crate) fn hibernate_on(&mut self, key: u64, saved: Option<&Snapshot>, why: String) {
        let Some(coming) = self.coming.get(&key) else { return };
        let session = coming.session.clone();
        if let Some(saved) = saved.filter(|_| coming.at_start) {
            session.show_saved(saved);
        }
        warn!(session = session.id, "it goes on hibernating: {why}");
        session.hibernating.store(true, Ordering::Relaxed);
        self.refuse_mail(key, &SessionError::OutOfMemory(why));
        self.hibernating.insert(key, session);
        self.count_hibernating();
        self.is_back(key);
    }

    /// Gives up a session that can't be brought back.
    fn set_aside(&mut self, key: u64, why: &SessionError) {
        let Some(Coming { session, .. }) = self.coming.remove(&key) else { return };
        let why = reasons(why);
        error!(session = session.id, "its checkpoint can't be read, and stays stored: {why}");
        self.vitals.store.lost(1);
        self.refuse_mail(key, &SessionError::Internal(why));
        self.forget(key, &session);
        self.tell_of_taken_back(key);
    }

    /// Has sessions that are being restored do so in the next frame.
    pub(crate) fn feed_coming(&mut self) {
        for key in self.coming_at(Stage::Replaying) {
            if self.guard(key, Simulation::feed_replay).is_some() {
                self.simulations.set_active(key, true);
            }
        }
    }

    /// Takes in what a frame has done of sessions that are being restored.
    pub(crate) fn advance_coming(&mut self) {
        for key in self.coming_at(Stage::Publishing) {
            if self.guard(key, |simulation| !simulation.unpublished) == Some(true) {
                self.is_back(key);
                self.review(key);
            }
        }
        let frame = self.frame;
        for key in self.coming_at(Stage::Replaying) {
            // Where it had to wait for another frame, nothing of it is done.
            let advance = |sim: &mut Simulation| {
                let done = sim.next.edits.is_empty() && sim.advance_replay();
                if done {
                    sim.show(frame);
                }
                done
            };
            if self.guard(key, advance) == Some(true)
                && let Some(coming) = self.coming.get_mut(&key)
            {
                coming.stage = Stage::Publishing;
                self.simulations.set_active(key, true);
            }
        }
        // A session that waits because its tenant has had its share is looked at again with the next beat.
        let waits = |coming: &Coming| {
            let tenant = coming.session.tenant.as_ref();
            tenant.is_some_and(|tenant| tenant.is_over_its_share(frame))
        };
        let moves = |coming: &Coming| matches!(coming.stage, Stage::Replaying | Stage::Publishing);
        let mut coming = self.coming.values();
        self.busy |= coming.any(|coming| moves(coming) && !waits(coming)) || self.has_mail();
        self.recover();
    }

    fn is_at_start(&self, key: u64) -> bool {
        self.coming.get(&key).is_some_and(|coming| coming.at_start)
    }

    /// Notes that a request waits for a session that is queued: it comes back before those without requests.
    pub(crate) fn ask_for(&mut self, key: u64) {
        let waits = |coming: &&mut Coming| coming.stage == Stage::Queued && !coming.asked;
        if let Some(coming) = self.coming.get_mut(&key).filter(waits) {
            coming.asked = true;
            self.asked.push_back(key);
        }
    }

    fn coming_at(&self, stage: Stage) -> Vec<u64> {
        let there = self.coming.iter().filter(|(_, coming)| coming.stage == stage);
        there.map(|(&key, _)| key).collect()
    }

    /// A session is back.
    fn is_back(&mut self, key: u64) {
        let Some(Coming { session, at_start, .. }) = self.coming.remove(&key) else { return };
        if at_start {
            self.names.recover(&session);
        }
        self.tell_of_taken_back(key);
        self.schedule(key);
    }

    /// Notes that all are back that outlived the last stop, once they are.
    fn recover(&mut self) {
        if self.recovered || self.coming.values().any(|coming| coming.at_start) {
            return;
        }
        let took = self.now.instant.saturating_duration_since(self.began);
        info!("{} sessions are back after {took:.1?}", self.records.len());
        self.vitals.store.recovered(took);
        self.recovered = true;
        self.vitals.recovered.store(true, Ordering::Release);
        self.effects.push(Effect::Recovered);
    }

    /// Gives up bringing a session back. Waiting requests are refused, with the reason.
    pub(crate) fn give_up_coming(&mut self, key: u64, why: &SessionError) -> Option<Arc<Outlet>> {
        let Coming { session, .. } = self.coming.remove(&key)?;
        self.refuse_mail(key, why);
        self.tell_of_taken_back(key);
        Some(session)
    }
}

/// All that is wrong with what is stored.
fn reasons(why: &SessionError) -> String {
    let SessionError::Invalid(parts) = why else { return why.to_string() };
    let parts = parts.iter().map(|Invalid { pointer, detail }| format!("{pointer} {detail}"));
    parts.collect::<Vec<_>>().join("; ")
}
