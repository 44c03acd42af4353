//! The dispatches of a submit, and the rows they work on.

mod edits;
mod job;
mod moves;
mod objects;
mod reports;
mod runs;
mod weather;

pub use moves::Moving;
pub use runs::FEW_TILES;

use std::collections::BTreeSet;

use firn_snow::ColumnRect;

use crate::frame::{Edit, Slot};

use super::arena::Arena;
use super::device::Device;
use super::kernels::KernelId;
use super::layout::Pass;
use super::tables::Tables;

/// One dispatch of a kernel on the cells of a page, or on none.
#[derive(Clone, Copy, Debug)]
pub struct Dispatch {
    /// The kernel.
    pub kernel: KernelId,
    /// The page; 0 for kernels that bind no cells.
    pub page: u32,
    /// What it works on.
    pub pass: Pass,
    /// Workgroups, or none where the schedule says how many.
    pub groups: Option<u32>,
}

/// Makes the dispatches of one submit.
pub struct Planner<'a> {
    /// The device.
    pub device: &'a Device,
    /// Where the cells are.
    pub arena: &'a Arena,
    /// Where the rows go.
    pub tables: &'a mut Tables,
    /// Snowpacks whose contacts have been evaluated for the first cycle of this frame.
    pub evaluated: &'a mut BTreeSet<Slot>,
    /// Whether every cycle is a dispatch of its own.
    pub one_by_one: bool,
    /// Passes over the lists of due tiles so far. Each second one goes backwards: it begins where
    /// the one before has ended, with cells that the device's cache still has.
    pub turns: &'a mut u32,
    /// What has been planned so far.
    pub dispatches: Vec<Dispatch>,
}

/// Edits of one snowpack in one round.
#[derive(Debug)]
pub struct Round {
    /// The snowpack.
    pub slot: Slot,
    /// Its place among the work.
    pub place: u32,
    /// The edits, each with its row in the table of results.
    pub edits: Vec<(u32, Edit)>,
    /// Whether cycles follow them, with no edits in between.
    pub runs: bool,
}

impl Planner<'_> {
    fn dispatch(&mut self, kernel: KernelId, page: u32, pass: Pass, groups: u32) {
        if groups > 0 {
            self.dispatches.push(Dispatch { kernel, page, pass, groups: Some(groups) });
        }
    }
}

/// Tiles that columns lie in.
fn tiles_in(columns: ColumnRect, tiles_x: u32) -> impl Iterator<Item = u32> {
    let rect = columns.tiles();
    (rect.z0..rect.z1).flat_map(move |z| (rect.x0..rect.x1).map(move |x| z * tiles_x + x))
}
