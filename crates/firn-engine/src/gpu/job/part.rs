//! What a frame does of a job.

use std::ops::Range;

use crate::frame::{Run, Work};

/// Something that a frame does of a job.
#[derive(Debug)]
pub enum Step {
    /// Cells of some tiles are replaced by those that were saved, or the ground under them by another.
    Write(Range<u32>),
    /// Snow falls or is cleared on some rows of tiles.
    Snow(Range<u32>),
    /// Steps of weather are taken on some rows of tiles.
    Weather(Range<u32>),
    /// All other edits of a round.
    Objects,
    /// Contacts of some objects are evaluated, by their rows: after edits, or before a cycle.
    Touch(Range<u32>, When),
    /// Stresses of some tiles are.
    Press(Vec<u32>, When),
    /// Stresses of tiles without objects on which snow fell.
    Weigh(u32),
    /// Some tiles under no objects are compacted.
    Free(Vec<u32>),
    /// Some tiles under objects are compacted in a cycle.
    Loaded(Vec<u32>, u32),
}

/// What an evaluation is for.
#[derive(Clone, Copy, Debug)]
pub struct When {
    /// It follows edits.
    pub after_edits: bool,
    /// A cycle follows.
    pub runs: bool,
    /// Which.
    pub cycle: u32,
}

/// What a frame does of a job.
#[derive(Debug, Default)]
pub struct Part {
    /// In this order.
    pub steps: Vec<Step>,
    /// Steps that follow them, of cycles in which objects move.
    pub moves: u32,
    /// What is reported after them, as if that were all.
    pub work: Work,
    /// The cycles that the steps are of.
    pub run: Run,
    /// Cycles before those.
    pub done: u32,
    /// Units of all of it.
    pub units: u64,
}

/// A part of a job that is in a frame in flight.
#[derive(Clone, Copy, Debug)]
pub struct Flown {
    /// Cycles before those of the part.
    pub done: u32,
    /// Units of all of it.
    pub units: u64,
    /// Something of the job is left after it.
    pub unfinished: bool,
}

impl Part {
    /// Adds a step of so many units.
    pub fn add(&mut self, units: u64, step: Step) {
        self.units += units;
        self.steps.push(step);
    }
}
