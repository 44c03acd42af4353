//! Work of a snowpack that is too much for one frame: what of it is done in each. `cpu/job.rs`
//! does the same on the reference.

mod part;
mod rows;
mod steps;

use std::collections::VecDeque;

use firn_snow::Pressing;

use crate::frame::{Edit, Moves, TileCells, Work, WorkOutcome};

use super::plan::Moving;
use super::resident::{Resident, rounds};
use super::survey::count_edits;

pub use part::{Flown, Part, Step, When};

/// Work that has begun and not ended.
#[derive(Debug)]
pub struct Job {
    /// What it is, but for its edits.
    work: Work,
    /// Edits that are left, round by round, each with its number.
    rounds: VecDeque<Vec<(u32, Edit)>>,
    stage: Stage,
    /// The first object, tile, or row of tiles that the stage still has to do.
    next: u32,
    /// Tiles whose stress is to be evaluated after a round of edits.
    pressed: Vec<u32>,
    /// Contacts and stresses of the coming cycle have been evaluated, after edits.
    evaluated: bool,
    /// Cycles that are over, those that tiles without objects take at once after them, and the one that
    /// those under objects are in.
    done: u32,
    at_once: u32,
    cycle: u32,
    /// Cycles in which objects move, before they begin.
    moves: Vec<Moves>,
    /// What is left of them.
    moving: Option<Box<Moving>>,
    /// How many steps they have, of how many units each.
    steps: u32,
    units_of_step: u64,
    /// How the results of parts of each edit are joined.
    joining: Vec<fn(u64, u64) -> u64>,
    /// The cycles have begun.
    runs: bool,
    outcome: WorkOutcome,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// What the host writes.
    Write,
    Snow,
    Weather,
    Objects,
    /// Contacts and stresses after a round of edits.
    TouchAfterEdits,
    PressAfterEdits,
    Weigh,
    Touch,
    Press,
    Free,
    Loaded,
    /// A cycle in which objects move.
    Move,
    Gather,
    Columns,
    Over,
}

impl Job {
    /// Work that is about to begin.
    pub fn new(mut work: Work) -> Job {
        let edits = (0..).zip(std::mem::take(&mut work.edits)).collect::<Vec<_>>();
        let moved = work.moves.iter().flat_map(|moves| moves.steps.iter().flatten());
        let joining = edits.iter().map(|(_, edit)| edit).chain(moved).map(Edit::joining).collect();
        let moves = std::mem::take(&mut work.moves);
        let count = edits.len() + count_edits(moves.iter()) as usize;
        let rounds = rounds(edits).into_iter().map(|(edits, _)| edits).collect();
        let outcome =
            WorkOutcome { slot: work.slot, edits: vec![0; count], ..WorkOutcome::default() };
        let mut job = Job {
            work,
            rounds,
            stage: Stage::Over,
            next: 0,
            pressed: Vec::new(),
            evaluated: false,
            done: 0,
            at_once: 0,
            cycle: 0,
            runs: false,
            steps: moves.iter().map(Moves::count).sum(),
            units_of_step: 0,
            moves,
            moving: None,
            joining,
            outcome,
        };
        job.begin_round();
        job
    }

    /// Takes what a frame says that resumes it.
    pub fn resume(&mut self, work: &Work) {
        (self.work.publish, self.work.limit) = (work.publish, work.limit);
    }

    /// Edits that it has in all.
    pub fn edits(&self) -> u32 {
        self.outcome.edits.len() as u32
    }

    /// Cycles that it has in all.
    pub fn cycles(&self) -> u32 {
        self.work.run.cycles
    }

    /// How objects move in the steps that a part ends with, if there are any; the results of its edits begin at a
    /// number.
    pub fn take_moving(&mut self, part: &Part, first_result: u32) -> Option<Moving> {
        let mut moving = match self.moving.take() {
            _ if part.moves == 0 => return None,
            Some(moving) => *moving,
            None => {
                let Work { slot, run, pressing, .. } = self.work;
                let moves = std::mem::take(&mut self.moves);
                let edits = self.edits() - count_edits(moves.iter());
                Moving::new(0, slot, run.dt, pressing, moves, edits)
            }
        };
        moving.go_on(part.moves, first_result);
        Some(moving)
    }

    /// Keeps what is left of it for the next frame.
    pub fn keep_moving(&mut self, moving: Moving) {
        self.outcome.last_change = self.outcome.last_change.max(moving.moved().1);
        self.moving = Some(Box::new(moving));
    }

    /// How snow gives way under objects.
    pub fn pressing(&self) -> Pressing {
        self.work.pressing
    }

    /// Edits of the round that is under way.
    pub fn round(&self) -> &[(u32, Edit)] {
        self.rounds.front().map_or(&[], Vec::as_slice)
    }

    /// Ends the round that is under way.
    pub fn end_round(&mut self) -> Vec<(u32, Edit)> {
        self.rounds.pop_front().unwrap_or_default()
    }

    /// Says of which tiles the stress is to be evaluated after that.
    pub fn press_later(&mut self, tiles: Vec<u32>) {
        self.pressed = tiles;
    }

    fn enter(&mut self, stage: Stage) {
        (self.stage, self.next) = (stage, 0);
    }

    /// Begins with the next round of edits, or with the cycles.
    fn begin_round(&mut self) {
        let stage = match self.round().first() {
            Some((_, Edit::Restore(_) | Edit::SetGround(_))) => Stage::Write,
            Some((_, Edit::Weather(_))) => Stage::Weather,
            Some(_) => Stage::Snow,
            None => Stage::Weigh,
        };
        self.enter(stage);
    }

    /// What the next frame does, beside so many units that it does already: as much as its limit allows.
    pub fn next_part(&mut self, resident: &Resident, units: u64) -> Part {
        let most = self.work.limit.unwrap_or(u64::MAX);
        let mut part = Part { done: self.done, units, ..Part::default() };
        let Work { slot, pressing, .. } = self.work;
        part.work = Work { slot, pressing, ..Work::default() };
        let mut ends = resident.unfurnished.is_some();
        while self.stage != Stage::Over && part.units < most && !ends {
            let left = most - part.units;
            ends = self.step(resident, left, &mut part);
        }
        self.outcome.unfinished = self.stage != Stage::Over;
        if !self.outcome.unfinished {
            part.work.publish = self.work.publish;
            part.work.tally = self.work.tally;
            part.work.samples = std::mem::take(&mut self.work.samples);
            part.work.totals = std::mem::take(&mut self.work.totals);
        }
        part
    }

    /// What is to be known of a part when it is done.
    pub fn flown(&self, part: &Part) -> Flown {
        Flown { done: part.done, units: part.units, unfinished: self.outcome.unfinished }
    }

    /// Takes in what came of a part.
    pub fn take_in(&mut self, part: &Flown, outcome: WorkOutcome) -> WorkOutcome {
        let edits = self.outcome.edits.iter_mut().zip(&outcome.edits);
        for ((all, own), joining) in edits.zip(&self.joining) {
            *all = joining(*all, *own);
        }
        if outcome.last_change > 0 {
            let last_change = part.done + outcome.last_change;
            self.outcome.last_change = self.outcome.last_change.max(last_change);
        }
        self.outcome.exchanged.add(outcome.exchanged);
        self.outcome.gathered.extend(outcome.gathered);
        self.outcome.columns.extend(outcome.columns);
        if part.unfinished {
            let (slot, units) = (outcome.slot, part.units);
            return WorkOutcome { slot, units, unfinished: true, ..WorkOutcome::default() };
        }
        let gathered: Vec<TileCells> = std::mem::take(&mut self.outcome.gathered);
        WorkOutcome {
            units: part.units,
            edits: std::mem::take(&mut self.outcome.edits),
            last_change: self.outcome.last_change,
            gathered,
            columns: std::mem::take(&mut self.outcome.columns),
            exchanged: self.outcome.exchanged,
            ..outcome
        }
    }
}
