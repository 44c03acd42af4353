//! Bringing sessions back to the state that is stored, several at a time.

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use firn_engine::frame::{EngineError, Slot};
use firn_engine::made::{Made, Maker};
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use tracing::{error, info, warn};

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

use super::engine::{Beginning, Engine};
use super::requests::gone;

/// Cells that are brought back at a time, unless one session has more.
const WAVE: u64 = 16 << 20;

/// A session that is to be brought back.
pub(super) struct Revival {
    session: Arc<Session>,
    stored: Stored,
    /// The server has just been started: the mirror knows no heights.
    at_start: bool,
    /// What has to be written before it comes back, beside its mark.
    first: Vec<Part>,
}

impl Revival {
    /// Of a session that was stored when the server was started.
    pub fn at_start(session: Arc<Session>, stored: Stored, first: Vec<Part>) -> Revival {
        Revival { session, stored, at_start: true, first }
    }

    /// Of a session that has lost its memory on the device.
    pub fn anew(session: Arc<Session>, stored: Stored) -> Revival {
        Revival { session, stored, at_start: false, first: Vec::new() }
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
    fn begin(&mut self) -> (u64, Vec<Part>) {
        let mut parts = std::mem::take(&mut self.first);
        parts.push(self.mark());
        (self.session.key, parts)
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
    pub fn new(session: &Session, stored: &Stored, maker: Maker) -> Result<Decoded, SessionError> {
        let checkpoint = stored.checkpoint.as_ref();
        let snapshot = checkpoint.map(|saved| Snapshot::decode(&saved.snapshot, &Limits::NONE));
        let snapshot = snapshot.transpose()?;
        let made = maker.make(Simulation::layout(&session.spec))?;
        Ok(Decoded { snapshot, made })
    }
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
    /// Writes where this life begins, and whether that is on disk: seqs that anybody is told from here on are
    /// never given out again, nor is the time since the last heartbeat ever counted.
    pub(super) fn has_begun(&mut self) -> bool {
        if self.beginning == Beginning::Unwritten {
            let begun = self.comebacks.values_mut().map(Revival::begin).collect();
            self.begin_record(begun);
            self.beginning = Beginning::HandedOver;
        }
        // What could not be written is written as soon as the store can be.
        if self.beginning == Beginning::HandedOver && self.storage.is_settled() {
            self.beginning = Beginning::OnDisk;
        }
        self.beginning == Beginning::OnDisk
    }

    /// Refuses what is asked before this life has begun. False means that it was told to stop.
    pub(super) fn turn_away(&mut self, first: Option<Message>) -> bool {
        let why = SessionError::Unavailable(
            "sessions come back as soon as the data directory can be written to".to_owned(),
        );
        let waiting = std::iter::from_fn(|| self.inbox.try_recv().ok());
        for message in first.into_iter().chain(waiting) {
            if let Message::Stop(until) = message {
                self.stop = Some(until);
                return false;
            }
            message.refuse(&why);
        }
        true
    }

    /// Brings back everything that has to be, before anything else is done.
    ///
    /// # Errors
    /// Those of the backend; what has not been brought back is still to be then.
    pub(super) fn bring_back(&mut self) -> Result<(), EngineError> {
        if self.comebacks.is_empty() && self.vitals.is_recovered() {
            return Ok(());
        }
        let (count, began) = (self.comebacks.len(), machine::now());
        let mut done = 0;
        while !self.comebacks.is_empty() {
            let wave = self.next_wave();
            let sessions: Vec<Arc<Session>> =
                wave.iter().map(|revival| revival.session.clone()).collect();
            // They stay in the list until they are whole: the device may fail meanwhile.
            let result = self.revive(wave);
            result?;
            done += sessions.len();
            for session in sessions {
                self.is_back(session);
            }
            if count > 1 || !self.vitals.is_recovered() {
                info!("{done} of {count} sessions are back after {:.1?}", machine::since(began));
            }
        }
        if !self.vitals.recovered.load(Ordering::Relaxed) {
            self.vitals.store.recovered(machine::since(began));
            self.vitals.recovered.store(true, Ordering::Release);
            // That was no lag: nobody's time passed.
            self.next_beat = machine::now();
        }
        Ok(())
    }

    fn is_back(&mut self, session: Arc<Session>) {
        let key = session.key;
        let lives = self.simulations.contains_key(&key) || self.hibernating.contains_key(&key);
        if self.comebacks.remove(&key).is_some_and(|revival| revival.at_start) && lives {
            self.names.recover(session);
        }
    }

    fn next_wave(&mut self) -> Vec<Revival> {
        let mut cells = 0;
        let fits = |revival: &&mut Revival| {
            let first = cells == 0;
            cells += revival.session.spec.grid.padded_cells();
            first || cells <= WAVE
        };
        let copy = |revival: &mut Revival| Revival {
            session: revival.session.clone(),
            stored: revival.stored.clone(),
            first: Vec::new(),
            ..*revival
        };
        self.comebacks.values_mut().take_while(fits).map(copy).collect()
    }

    /// Brings sessions back; nothing else happens meanwhile.
    ///
    /// # Errors
    /// Those of the backend.
    fn revive(&mut self, wave: Vec<Revival>) -> Result<(), EngineError> {
        let others = self.simulations.take_active();
        self.reviving = true;
        let maker = self.backend.maker();
        let decoded: Vec<(Revival, Result<Decoded, SessionError>)> = wave
            .into_par_iter()
            .map(|revival| {
                let decoded = Decoded::new(&revival.session, &revival.stored, maker);
                (revival, decoded)
            })
            .collect();
        let mut keys = HashSet::new();
        for (revival, decoded) in decoded {
            let key = revival.session.key;
            if self.begin_life(revival, decoded, Portions::for_replay())?.is_ok() {
                keys.insert(key);
            }
        }
        let replayed = self.replay(&keys);
        self.reviving = false;
        others.into_iter().for_each(|key| self.simulations.set_active(key, true));
        replayed
    }

    /// Makes room for a session and begins its replay. Where there is no room it goes on hibernating, and
    /// where it can't be read it is set aside; whoever waits for it is told why.
    ///
    /// # Errors
    /// Those of the backend.
    pub(super) fn begin_life(
        &mut self,
        revival: Revival,
        decoded: Result<Decoded, SessionError>,
        portions: Portions,
    ) -> Result<Result<(), SessionError>, EngineError> {
        let room = match decoded {
            Ok(Decoded { snapshot, made }) => {
                self.take_in(snapshot.as_ref(), made).map(|room| (room, snapshot))
            }
            Err(SessionError::OutOfMemory(why) | SessionError::NoMemory(why)) => {
                Err(EngineError::OutOfMemory(why))
            }
            Err(why) => return Ok(Err(self.set_aside(revival, &why))),
        };
        let (Room { slot, object_rows, units }, snapshot) = match room {
            Ok(room) => room,
            Err(EngineError::OutOfMemory(why)) => return Ok(Err(self.hibernate_on(revival, why))),
            Err(failure) => return Err(failure),
        };
        let Revival { session, stored, at_start, .. } = revival;
        let key = session.key;
        session.hibernating.store(false, Ordering::Relaxed);
        let Some(record) = self.records.get(&key) else { return Ok(Err(gone())) };
        let mut log = Log::resumed(record, &stored);
        if !at_start {
            // What was published after the last mark is a future that will not be.
            let lost = log.lose(stored.mark.seq + 1, session.mirror().seq);
            session.set_lost_seqs(lost);
        }
        let mut simulation = Simulation::new(session, slot, self.frame, log, object_rows);
        simulation.brought_back = !at_start;
        simulation.portions = portions;
        simulation.portions.furnish(units);
        self.simulations.insert(key, simulation);
        self.simulations.set_active(key, true);
        self.guard(key, |simulation| {
            simulation.begin_replay(snapshot.as_ref(), Replay::new(&stored, at_start));
        });
        Ok(Ok(()))
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
    fn hibernate_on(&mut self, revival: Revival, why: String) -> SessionError {
        let mark = revival.mark();
        let Revival { session, .. } = revival;
        warn!(session = session.id, "it goes on hibernating: {why}");
        session.hibernating.store(true, Ordering::Relaxed);
        let why = SessionError::OutOfMemory(why);
        let key = session.key;
        self.refuse_mail(key, &why);
        self.hibernating.insert(key, session);
        self.count_hibernating();
        self.submit_parts(key, vec![mark], None);
        self.schedule(key);
        why
    }

    /// Gives up a session that can't be brought back.
    fn set_aside(&mut self, revival: Revival, why: &SessionError) -> SessionError {
        let Revival { session, at_start, .. } = revival;
        let why = reasons(why);
        error!(session = session.id, "its checkpoint can't be read, and stays stored: {why}");
        self.vitals.store.lost(1);
        let why = SessionError::Internal(why);
        self.refuse_mail(session.key, &why);
        if !at_start {
            self.forget(session.key, &session);
        }
        why
    }

    /// Carries out frames until sessions have gone through everything again, and publishes them.
    fn replay(&mut self, keys: &HashSet<u64>) -> Result<(), EngineError> {
        let mut left: Vec<u64> = keys.iter().copied().collect();
        while !left.is_empty() {
            for &key in &left {
                self.guard(key, Simulation::feed_replay);
                self.simulations.set_active(key, true);
            }
            self.carry_out_frame(false)?;
            left.retain(|&key| self.guard(key, Simulation::advance_replay) == Some(false));
            // Those that are through wait for the others.
            self.simulations.take_active();
        }
        let frame = self.frame;
        for &key in keys {
            self.guard(key, |simulation| simulation.frame = frame);
        }
        keys.iter().for_each(|&key| self.simulations.set_active(key, true));
        self.carry_out_frame(true).map(drop)
    }
}

/// All that is wrong with what is stored.
fn reasons(why: &SessionError) -> String {
    let SessionError::Invalid(parts) = why else { return why.to_string() };
    let parts = parts.iter().map(|Invalid { pointer, detail }| format!("{pointer} {detail}"));
    parts.collect::<Vec<_>>().join("; ")
}
