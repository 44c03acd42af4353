//! The way back of sessions whose snow is not on the device: at a start, when the device was lost, when
//! something in them panicked or could not be stored, and when they wake. There is one for all of them.
//!
//! What is stored of some sessions is read on another thread, a wave of them at a time. Then they go through
//! what has happened since their checkpoints, in parts of frames, beside all others, and show what has come of
//! it. What is asked of them waits meanwhile.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use firn_engine::frame::{EngineError, Slot};
use firn_engine::made::{Made, Maker};
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use tracing::{debug, error, info, warn};

use crate::machine;
use crate::session::error::{Invalid, SessionError};
use crate::session::handle::Session;
use crate::session::journal::{Log, Part, Replay, Stored};
use crate::session::message::Message;
use crate::session::object_rows::ObjectRows;
use crate::session::portion::Portions;
use crate::session::simulation::Simulation;
use crate::session::snapshot::Snapshot;
use crate::session::spec::Limits;

use super::engine::Engine;
use super::frame::caught;

/// Cells that are on their way back at a time, unless one session has more.
const WAVE: u64 = 16 << 20;

/// A session on its way back.
pub(super) struct Coming {
    session: Arc<Session>,
    stored: Stored,
    stage: Stage,
    /// The server has just been started: the mirror knows no heights, and nobody the session.
    at_start: bool,
    /// What has to be written before it comes back, beside its mark.
    first: Vec<Part>,
}

/// How far it has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Its turn will come.
    Waits,
    /// What is stored of it is being read.
    IsRead,
    /// It goes through what has happened since its checkpoint.
    Replays,
    /// The coming frame shows what has come of that.
    Shows,
}

impl Coming {
    /// Of a session that was stored when the server was started; `first` has to be written before it comes
    /// back.
    pub fn at_start(session: Arc<Session>, stored: Stored, first: Vec<Part>) -> Coming {
        Coming { session, stored, stage: Stage::Waits, at_start: true, first }
    }

    /// The session.
    pub fn session(&self) -> &Arc<Session> {
        &self.session
    }

    /// How far it has come, for the journal: its time stands still from there.
    fn mark(&self) -> Part {
        Part::Mark(self.stored.mark.clone())
    }

    /// The same, with what has to be written before it comes back.
    pub fn begin(&mut self) -> (u64, Vec<Part>) {
        let mut parts = std::mem::take(&mut self.first);
        parts.push(self.mark());
        (self.session.key, parts)
    }

    fn cells(&self) -> u64 {
        self.session.spec.grid.padded_cells()
    }
}

/// A session as it was stored, ready to be taken in.
pub(in crate::session) struct Decoded {
    snapshot: Option<Snapshot>,
    made: Made,
}

impl Decoded {
    /// Reads what is stored of a session. That takes memory and a while; any thread does it.
    ///
    /// # Errors
    /// Where it can't be read, or there is no memory for it.
    fn new(session: &Session, stored: &Stored, maker: Maker) -> Result<Decoded, SessionError> {
        let checkpoint = stored.checkpoint.as_ref();
        let snapshot = checkpoint.map(|saved| Snapshot::decode(&saved.snapshot, &Limits::NONE));
        let snapshot = snapshot.transpose()?;
        let made = maker.make(Simulation::layout(&session.spec))?;
        Ok(Decoded { snapshot, made })
    }
}

/// What was read of a session, in the life that it is of.
pub(in crate::session) struct Read {
    pub key: u64,
    pub life: u64,
    pub decoded: Result<Decoded, SessionError>,
}

/// What a session takes of the device.
pub(super) struct Room {
    pub slot: Slot,
    /// In the tables of objects.
    pub object_rows: ObjectRows,
    /// Units that furnishing its memory costs.
    pub units: u64,
}

impl Engine {
    /// Has a session come back to what is stored of it, at a tick or later. What its earlier life still does
    /// is void.
    pub(super) fn come_back(&mut self, session: Arc<Session>, tick: u64) {
        let key = session.key;
        let Some(record) = self.records.get_mut(&key) else {
            // It was still being made.
            self.forget(key, &session);
            return;
        };
        record.life += 1;
        let mut stored = record.present();
        // Its time stands still until it is back.
        stored.mark.rest = None;
        stored.mark.tick = stored.mark.tick.max(tick);
        let before = self.coming.remove(&key);
        let (at_start, first) = before.map_or((false, Vec::new()), |it| (it.at_start, it.first));
        self.coming.insert(key, Coming { session, stored, stage: Stage::Waits, at_start, first });
        self.queue.push_back(key);
    }

    /// Has those whose turn it is read what is stored of them.
    pub(super) fn read_next(&mut self) {
        let under_way = |coming: &&Coming| coming.stage != Stage::Waits;
        let mut cells = 0;
        if !self.queue.is_empty() {
            cells = self.coming.values().filter(under_way).map(Coming::cells).sum();
        }
        let mut wave = Vec::new();
        while let Some(&key) = self.queue.front() {
            let waits = |coming: &&mut Coming| coming.stage == Stage::Waits;
            let Some(coming) = self.coming.get_mut(&key).filter(waits) else {
                self.queue.pop_front();
                continue;
            };
            if cells > 0 && cells + coming.cells() > WAVE {
                break;
            }
            self.queue.pop_front();
            cells += coming.cells();
            coming.stage = Stage::IsRead;
            debug!(session = coming.session.id, "comes back");
            let life = self.records.get(&key).map_or(0, |record| record.life);
            wave.push((coming.session.clone(), coming.stored.clone(), life));
        }
        if !wave.is_empty() {
            self.read(wave);
        }
    }

    fn read(&self, wave: Vec<(Arc<Session>, Stored, u64)>) {
        let maker = self.backend.maker();
        let decode = move |(session, stored, life): (Arc<Session>, Stored, u64)| {
            let decoded = caught(|| Decoded::new(&session, &stored, maker)).unwrap_or_else(|| {
                Err(SessionError::Internal("reading its checkpoint failed".to_owned()))
            });
            Read { key: session.key, life, decoded }
        };
        let world = wave.first().map(|(session, ..)| session.world.clone());
        let work = move || {
            let read = wave.into_par_iter().map(decode).collect();
            if let Some(world) = world {
                // Where the world has ended, nobody waits for it.
                let _ = world.blocking_send(Message::Read(read));
            }
        };
        machine::aside(Box::new(work), |work| drop(self.clock.spawn_blocking(work)));
    }

    /// Takes in sessions that were read, and begins to restore them.
    ///
    /// # Errors
    /// Those of the backend; sessions that were not taken in are read again then.
    pub(super) fn take_in_all(&mut self, read: Vec<Read>) -> Result<(), EngineError> {
        for Read { key, life, decoded } in read {
            if self.records.get(&key).is_some_and(|record| record.life == life)
                && self.coming.get(&key).is_some_and(|coming| coming.stage == Stage::IsRead)
            {
                self.begin_life(key, decoded)?;
            }
        }
        self.busy = true;
        Ok(())
    }

    /// Makes room for a session and begins its replay. Where there is no room it goes on hibernating, and
    /// where it can't be read it is set aside; whoever waits for it is told why.
    ///
    /// # Errors
    /// Those of the backend.
    fn begin_life(
        &mut self,
        key: u64,
        decoded: Result<Decoded, SessionError>,
    ) -> Result<(), EngineError> {
        let room = match decoded {
            Ok(Decoded { snapshot, made }) => {
                self.take_in(snapshot.as_ref(), made).map(|room| (room, snapshot))
            }
            Err(SessionError::OutOfMemory(why) | SessionError::NoMemory(why)) => {
                Err(EngineError::OutOfMemory(why))
            }
            Err(why) => {
                self.set_aside(key, &why);
                return Ok(());
            }
        };
        let (Room { slot, object_rows, units }, snapshot) = match room {
            Ok(room) => room,
            Err(EngineError::OutOfMemory(why)) => {
                self.hibernate_on(key, why);
                return Ok(());
            }
            Err(failure) => return Err(failure),
        };
        let (Some(coming), Some(record)) = (self.coming.get_mut(&key), self.records.get(&key))
        else {
            return Ok(());
        };
        coming.stage = Stage::Replays;
        let (session, stored, at_start) =
            (coming.session.clone(), coming.stored.clone(), coming.at_start);
        session.hibernating.store(false, Ordering::Relaxed);
        let mut log = Log::resumed(record, &stored);
        if !at_start {
            // What was published after the last mark is a future that will not be.
            let lost = log.lose(stored.mark.seq + 1, session.mirror().seq);
            session.set_lost_seqs(lost);
        }
        let mut simulation = Simulation::new(session, slot, self.frame, log, object_rows);
        simulation.brought_back = !at_start;
        if !self.vitals.is_recovered() {
            simulation.portions = Portions::for_replay();
        }
        simulation.portions.furnish(units);
        self.simulations.insert(key, simulation);
        self.guard(key, |simulation| {
            simulation.begin_replay(snapshot.as_ref(), Replay::new(&stored, at_start));
        });
        Ok(())
    }

    /// Has the backend take a snowpack in.
    ///
    /// # Errors
    /// Those of the backend.
    pub(super) fn take_in(
        &mut self,
        saved: Option<&Snapshot>,
        made: Made,
    ) -> Result<Room, EngineError> {
        let mut object_rows = ObjectRows::new(self.object_rows.clone());
        object_rows
            .try_take(saved.map_or(0, Snapshot::object_rows))
            .map_err(|why| EngineError::OutOfMemory(why.to_string()))?;
        let slot = self.slots.take();
        match self.backend.take_in(slot, made) {
            Ok(units) => Ok(Room { slot, object_rows, units }),
            Err(failure) => {
                self.slots.give_back(slot);
                Err(failure)
            }
        }
    }

    /// Leaves a session hibernating for which there is no room.
    fn hibernate_on(&mut self, key: u64, why: String) {
        let Some(coming) = self.coming.get(&key) else { return };
        let (session, mark) = (coming.session.clone(), coming.mark());
        warn!(session = session.id, "it goes on hibernating: {why}");
        session.hibernating.store(true, Ordering::Relaxed);
        self.refuse_mail(key, &SessionError::OutOfMemory(why));
        self.hibernating.insert(key, session);
        self.count_hibernating();
        self.submit_parts(key, vec![mark], None);
        self.is_back(key);
    }

    /// Gives up a session that can't be brought back.
    fn set_aside(&mut self, key: u64, why: &SessionError) {
        let Some(Coming { session, at_start, .. }) = self.coming.remove(&key) else { return };
        let why = reasons(why);
        error!(session = session.id, "its checkpoint can't be read, and stays stored: {why}");
        self.vitals.store.lost(1);
        self.refuse_mail(key, &SessionError::Internal(why));
        if !at_start {
            self.forget(key, &session);
        }
        self.tell_of_taken_back(key);
    }

    /// Has sessions that are being restored do so in the next frame.
    pub(super) fn feed_coming(&mut self) {
        for key in self.coming_at(Stage::Replays) {
            if self.guard(key, Simulation::feed_replay).is_some() {
                self.simulations.set_active(key, true);
            }
        }
    }

    /// Takes in what a frame has done of sessions that are being restored.
    pub(super) fn advance_coming(&mut self) {
        for key in self.coming_at(Stage::Shows) {
            if self.guard(key, |simulation| !simulation.unpublished) == Some(true) {
                self.is_back(key);
                self.review(key);
            }
        }
        let frame = self.frame;
        for key in self.coming_at(Stage::Replays) {
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
                coming.stage = Stage::Shows;
                self.simulations.set_active(key, true);
            }
        }
        let moves = |coming: &Coming| matches!(coming.stage, Stage::Replays | Stage::Shows);
        self.busy |= self.has_mail() || self.coming.values().any(moves);
        self.recover();
    }

    fn coming_at(&self, stage: Stage) -> Vec<u64> {
        let there = self.coming.iter().filter(|(_, coming)| coming.stage == stage);
        there.map(|(&key, _)| key).collect()
    }

    /// A session is back.
    fn is_back(&mut self, key: u64) {
        let Some(Coming { session, at_start, .. }) = self.coming.remove(&key) else { return };
        if at_start {
            self.names.recover(session);
        }
        self.tell_of_taken_back(key);
        self.schedule(key);
    }

    /// Notes that all are back that outlived the last stop, once they are.
    fn recover(&mut self) {
        if self.vitals.is_recovered() || self.coming.values().any(|coming| coming.at_start) {
            return;
        }
        let took = machine::since(self.began);
        info!("all sessions are back after {took:.1?}");
        self.vitals.store.recovered(took);
        self.vitals.recovered.store(true, Ordering::Release);
        // That was no lag: nobody's time passed.
        self.next_beat = machine::now();
    }

    /// Gives up bringing a session back. Whoever waits for it is told why.
    pub(super) fn give_up_coming(&mut self, key: u64, why: &SessionError) -> Option<Arc<Session>> {
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
