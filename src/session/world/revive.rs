//! Bringing sessions back to the state that is stored, several at a time.

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use rayon::iter::{IntoParallelIterator, ParallelIterator};
use tracing::{error, info, warn};

use crate::engine::frame::EngineError;
use crate::session::error::{Invalid, SessionError};
use crate::session::handle::Session;
use crate::session::journal::{Log, Replay, Stored, Submission};
use crate::session::object_rows::ObjectRows;
use crate::session::orders::Orders;
use crate::session::simulation::Simulation;
use crate::session::snapshot::Snapshot;
use crate::session::spec::Limits;

use super::engine::Engine;

/// Cells that are brought back at a time, unless one session has more.
const WAVE: u64 = 16 << 20;

/// A session that is to be brought back.
pub(super) struct Revival {
    session: Arc<Session>,
    stored: Stored,
    /// The server has just been started: the mirror knows no heights.
    at_start: bool,
    /// Reads that wait for it.
    reads: Orders,
}

impl Revival {
    /// Of a session that was stored when the server was started.
    pub fn at_start(session: Arc<Session>, stored: Stored) -> Revival {
        Revival { session, stored, at_start: true, reads: Orders::default() }
    }

    /// Of a session that has lost its memory on the device.
    pub fn anew(session: Arc<Session>, stored: Stored) -> Revival {
        Revival { session, stored, at_start: false, reads: Orders::default() }
    }

    /// How far it has come, for the journal: its time stands still from there.
    pub fn mark(&self) -> Submission {
        let Stored { generation, mark, .. } = &self.stored;
        Submission::of_mark(self.session.key, *generation, mark.clone())
    }

    /// With reads that wait for it.
    pub fn with(self, reads: Orders) -> Revival {
        Revival { reads, ..self }
    }
}

impl Engine {
    /// Brings back everything that has to be, before anything else is done.
    ///
    /// # Errors
    /// Those of the backend; what has not been brought back is still to be then.
    pub(super) fn bring_back(&mut self) -> Result<(), EngineError> {
        let (count, began) = (self.comebacks.len(), Instant::now());
        let mut done = 0;
        if !self.vitals.is_recovered() {
            // Seqs that anybody is told from here on are never given out again, nor is the time
            // since the last heartbeat ever counted.
            self.comebacks.values().for_each(|revival| self.journal.add(revival.mark()));
            self.journal.beat(self.frame);
            self.journal.flush();
        }
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
                info!("{done} of {count} sessions are back after {:.1?}", began.elapsed());
            }
        }
        if !self.vitals.recovered.load(Ordering::Relaxed) {
            self.vitals.store.recovered(began.elapsed());
            self.vitals.recovered.store(true, Ordering::Release);
            // That was no lag: nobody's time passed.
            self.next_beat = Instant::now();
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
            cells += revival.session.spec.grid.cells();
            first || cells <= WAVE
        };
        let copy = |revival: &mut Revival| Revival {
            session: revival.session.clone(),
            stored: revival.stored.clone(),
            reads: std::mem::take(&mut revival.reads),
            ..*revival
        };
        self.comebacks.values_mut().take_while(fits).map(copy).collect()
    }

    /// Brings sessions back; nothing else happens meanwhile.
    ///
    /// # Errors
    /// Those of the backend.
    pub(super) fn revive(&mut self, wave: Vec<Revival>) -> Result<(), EngineError> {
        let others = self.simulations.take_active();
        self.reviving = true;
        let decoded: Vec<(Revival, Result<Option<Snapshot>, SessionError>)> =
            wave.into_par_iter()
                .map(|revival| {
                    let snapshot =
                        revival.stored.checkpoint.as_ref().map(|checkpoint| {
                            Snapshot::decode(&checkpoint.snapshot, &Limits::NONE)
                        });
                    (revival, snapshot.transpose())
                })
                .collect();
        let mut keys = HashSet::new();
        for (revival, snapshot) in decoded {
            let (key, id) = (revival.session.key, revival.session.id.clone());
            match snapshot {
                Ok(snapshot) => {
                    if self.begin_revival(revival, snapshot)? {
                        keys.insert(key);
                    }
                }
                Err(why) => {
                    let why = reasons(&why);
                    error!(session = id, "its checkpoint can't be read, and stays stored: {why}");
                    self.vitals.store.lost(1);
                    self.set_aside(revival, why);
                }
            }
        }
        let replayed = self.replay(&keys);
        self.reviving = false;
        others.into_iter().for_each(|key| self.simulations.set_active(key, true));
        replayed
    }

    /// Gives up a session that can't be brought back.
    fn set_aside(&mut self, revival: Revival, why: String) {
        let Revival { session, at_start, reads, .. } = revival;
        reads.refuse(&SessionError::Internal(why));
        if !at_start {
            self.forget(session.key, &session);
        }
    }

    /// Makes room for a session and begins its replay. Returns whether there was room.
    fn begin_revival(
        &mut self,
        revival: Revival,
        snapshot: Option<Snapshot>,
    ) -> Result<bool, EngineError> {
        let mark = revival.mark();
        let Revival { session, stored, at_start, reads } = revival;
        let (key, slot) = (session.key, self.slots.take());
        let mut rows = ObjectRows::new(self.object_rows.clone());
        let room = rows.try_take(snapshot.as_ref().map_or(0, Snapshot::object_rows));
        let made = match room {
            Ok(()) => self.backend.create(slot, &Simulation::layout(&session.spec)),
            Err(why) => Err(EngineError::OutOfMemory(why.to_string())),
        };
        match made {
            Ok(()) => {}
            Err(EngineError::OutOfMemory(why)) => {
                warn!(session = session.id, "it goes on hibernating: {why}");
                self.slots.give_back(slot);
                session.hibernating.store(true, Ordering::Relaxed);
                reads.refuse(&SessionError::OutOfMemory(why));
                self.hibernating.insert(key, session);
                self.count_hibernating();
                self.journal.add(mark);
                self.schedule(key);
                return Ok(false);
            }
            Err(failure) => return Err(failure),
        }
        session.hibernating.store(false, Ordering::Relaxed);
        let mut log = Log::resumed(&stored);
        if !at_start {
            // What was published after the last mark is a future that will not be.
            let lost = log.lose(stored.mark.seq + 1, session.mirror().seq);
            session.set_lost_seqs(lost);
        }
        let mut simulation = Simulation::new(session, slot, self.frame, log, rows);
        simulation.brought_back = !at_start;
        self.simulations.insert(key, simulation);
        self.simulations.set_active(key, true);
        self.guard(key, |simulation| {
            simulation.begin_replay(snapshot.as_ref(), Replay::new(&stored, at_start));
            simulation.waiting_reads = reads;
        });
        Ok(true)
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
            self.guard(key, |simulation| {
                simulation.frame = frame;
                simulation.next.add_reads(std::mem::take(&mut simulation.waiting_reads));
            });
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
