//! What the store may hold wrongly after a commit has failed is written anew, in one batch and before anything
//! else. So is the beginning of a life.

use std::collections::BTreeMap;

use tracing::info;

use crate::core::record::{Part, Record};
use crate::core::session::Simulation;
use crate::core::{Effect, World};
use crate::store::StoreError;

impl World {
    /// Has the journal try again what has failed, where it is time for that.
    pub(crate) fn retry_rewriting(&mut self) {
        let due = self.storage.next_attempt.is_some_and(|next| next <= self.now.instant);
        if due && self.storage.rewriting.is_none() {
            self.rewrite();
        }
    }

    /// Has the beginning of this life written: where each session stands.
    pub(crate) fn begin_record(&mut self, begun: Vec<(u64, Vec<Part>)>) {
        self.storage.rewriting = Some(begun.iter().map(|(key, _)| (*key, None)).collect());
        self.have_written(begun);
    }

    /// Has everything written anew that the store may hold wrongly.
    pub(crate) fn rewrite(&mut self) {
        self.storage.next_attempt = None;
        let (mut sessions, mut rewriting) = (Vec::new(), BTreeMap::new());
        for key in std::mem::take(&mut self.storage.spoiled) {
            let lives = |record: &&Record| record.exists && !record.is_leaving();
            let Some(record) = self.records.get(&key).filter(lives) else {
                sessions.push((key, vec![Part::Delete]));
                rewriting.insert(key, None);
                continue;
            };
            // What is on its way is written before this, or this is not written either.
            let mut stored = record.present();
            let before = stored.anchor;
            let here = |sim: &&Simulation| sim.log.next() == stored.next() && sim.replay.is_none();
            if let Some(simulation) = self.simulations.get(&key).filter(here) {
                stored.anchor = simulation.anchor();
            }
            sessions.push((key, stored.parts()));
            rewriting.insert(key, Some([before, stored.anchor]));
        }
        self.storage.rewriting = Some(rewriting);
        self.have_written(sessions);
    }

    fn have_written(&mut self, sessions: Vec<(u64, Vec<Part>)>) {
        let (heartbeat, heard) = (self.heartbeat(), self.storage.heard);
        self.effects.push(Effect::Rewrite { sessions, heartbeat, heard });
    }

    pub(super) fn rewritten(&mut self, result: Result<(), StoreError>) {
        let rewriting = self.storage.rewriting.take().unwrap_or_default();
        if let Err(failure) = result {
            self.storage.spoiled.extend(rewriting.into_keys());
            self.fail(&failure);
            return;
        }
        for (key, anchors) in rewriting {
            if let Some([before, written]) = anchors
                && let Some(record) = self.records.get_mut(&key)
                && record.stored.anchor == before
            {
                record.stored.anchor = written;
            }
        }
        // What has come meanwhile is written next.
        let more = !self.storage.spoiled.is_empty();
        self.storage.next_attempt = more.then_some(self.now.instant);
        if self.storage.failure.take().is_some() {
            info!("the store can be written to again; changes are taken");
            self.vitals.store.set_gone(false);
            self.vitals.store.set_healthy(true);
        }
    }
}
