//! Bringing a session back: what was saved, what has happened since, and the ticks in between.

use std::collections::VecDeque;
use std::sync::Arc;

use firn_engine::frame::Edit;

use crate::core::record::{Entry, Stored};
use crate::core::session::{Command, MOST_CHANGES, Simulation};
use crate::core::snapshot::Snapshot;

/// Times in one frame that snow falls after anything else, each of which begins another submit: what
/// happened after so many waits for the next frame.
const MOST_ROUNDS: usize = 64;

/// What a session still has to go through again.
#[derive(Debug)]
pub(crate) struct Replay {
    entries: VecDeque<Arc<Entry>>,
    /// Tick at which it ends.
    until: u64,
    /// The frame that restores what was saved comes first, by itself.
    restores: bool,
    /// The mirror is to show what is restored, as what was published when it was saved.
    mirrors: bool,
    /// More happened at this tick than the next frame takes.
    parted: bool,
}

impl Replay {
    /// What a session has to go through after its checkpoint, at least up to the tick that it had come to.
    /// `mirrors` says whether the mirror knows nothing better than the checkpoint.
    pub fn new(stored: &Stored, mirrors: bool) -> Replay {
        Replay {
            entries: stored.entries.clone(),
            until: stored.anchor.tick,
            restores: true,
            mirrors: mirrors && stored.checkpoint.is_some(),
            parted: false,
        }
    }

    /// Ticks to be taken after a tick.
    pub fn due(&self, tick: u64) -> u64 {
        if self.restores || self.parted {
            return 0;
        }
        let until = self.entries.front().map_or(self.until, |entry| entry.tick);
        until.saturating_sub(tick)
    }

    /// Whether what was saved is still to be restored.
    pub fn restores(&self) -> bool {
        self.restores
    }

    /// Whether the frame's outcome goes to the mirror.
    pub fn publishes(&self) -> bool {
        self.restores && self.mirrors
    }
}

impl Simulation {
    /// Begins to go through again what is stored.
    pub(crate) fn begin_replay(&mut self, saved: Option<&Snapshot>, replay: Replay) {
        match saved {
            Some(snapshot) => self.restore(snapshot),
            None => {
                let origin = self.session.origin_snapshot();
                self.begin(origin.as_ref());
            }
        }
        self.replay = Some(replay);
    }

    /// Takes what happened at this tick into the next frame, whatever frames it came in.
    pub(crate) fn feed_replay(&mut self) {
        let Some(mut replay) = self.replay.take() else { return };
        if replay.restores || self.portions.are_under_way() {
            self.replay = Some(replay);
            return;
        }
        replay.parted = false;
        let (mut rounds, mut counted, mut reset) = (0, self.next.edits.len(), false);
        while let Some(entry) = replay.entries.front().cloned() {
            if entry.tick > self.state.clock.tick() {
                break;
            }
            // Each reset may bring a whole snowpack along.
            if self.next.edits.len() >= MOST_CHANGES || rounds >= MOST_ROUNDS || reset {
                replay.parted = true;
                break;
            }
            replay.entries.pop_front();
            for command in &entry.commands {
                self.repeat(command);
                reset |= *command == Command::Reset;
            }
            let new = &self.next.edits[counted.saturating_sub(1)..];
            rounds += new.windows(2).filter(|pair| begins_a_round(&pair[0], &pair[1])).count();
            counted = self.next.edits.len();
        }
        self.replay = Some(replay);
    }

    /// Notes that a frame of the replay is done. Returns whether it was the last.
    pub(crate) fn advance_replay(&mut self) -> bool {
        if self.portions.are_under_way() {
            return false;
        }
        let Some(replay) = &mut self.replay else { return true };
        replay.restores = false;
        let done = replay.entries.is_empty() && self.state.clock.tick() >= replay.until;
        if done {
            self.replay = None;
            self.portions.begin_anew();
            self.unpublished = true;
        }
        done
    }
}

fn begins_a_round(before: &Edit, edit: &Edit) -> bool {
    let falls = |edit: &Edit| edit.columns().is_some() && !matches!(edit, Edit::Stamp(_));
    falls(edit) && !falls(before)
}
