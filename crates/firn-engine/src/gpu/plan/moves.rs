//! Cycles in which objects move: step by step, each with contacts and stresses of its own.

use std::collections::{BTreeMap, BTreeSet};
use std::vec::IntoIter;

use firn_snow::Pressing;

use crate::frame::{Edit, Moves, Slot};
use crate::gpu::kernels::KernelId;
use crate::gpu::layout::{EditJob, LISTED, LoadJob, Pass, STEPPED};
use crate::gpu::resident::{Resident, Residents};

use super::Planner;
use super::edits::{ALL_ROWS, Changed, edit_pass};
use super::runs::{compaction_in, compaction_of};

/// Rows of a table after which what has been planned is submitted. Tables have to fit into a binding.
const MOST_ROWS: u32 = 1 << 18;

/// The moves of a snowpack in a frame.
#[derive(Debug)]
pub struct Moving {
    slot: Slot,
    /// Length of a cycle \[s\].
    dt: f64,
    pressing: Pressing,
    cycles: IntoIter<Moves>,
    /// Steps that may be taken in this frame.
    allowed: u32,
    /// The cycle under way.
    cycle: Option<Cycle>,
    /// Its place among the work.
    place: usize,
    /// Number of the cycle under way, or of the next one, and 1 + that of the last in which something moved.
    number: u32,
    moved_until: u32,
    /// Number of the frame's first result, and of the next edit's after it.
    first_result: u32,
    next_edit: u32,
    /// Tiles that have come under objects or are under none any more.
    marked: BTreeSet<u32>,
}

/// A cycle in which objects move.
#[derive(Debug)]
struct Cycle {
    steps: IntoIter<Vec<Edit>>,
    /// How many there were.
    count: u32,
    /// Tiles that are stepped: those under objects, and those over which some move.
    tiles: BTreeSet<u32>,
    begun: bool,
}

/// Rows of tiles, by their pages.
type Pages = BTreeMap<u32, Vec<u32>>;

/// What has to be done in a step, of all snowpacks.
#[derive(Default)]
struct Step {
    edit_jobs: Vec<(u32, EditJob)>,
    load_jobs: Vec<(u32, LoadJob)>,
    /// Tiles by pages that take a whole cycle, by its number.
    whole: BTreeMap<u32, Pages>,
    /// Tiles by pages that take a step, by the number of the cycle, their kernel, the bits of its rate, and how far loads
    /// press in it.
    stepped: BTreeMap<(u32, KernelId, u32, u32), Pages>,
}

impl Moving {
    /// The moves of a snowpack at a place among the work; the first of their edits has a number among all of its own.
    pub fn new(
        place: usize,
        slot: Slot,
        dt: f64,
        pressing: Pressing,
        moves: Vec<Moves>,
        next_edit: u32,
    ) -> Moving {
        Moving {
            slot,
            dt,
            pressing,
            cycles: moves.into_iter(),
            allowed: u32::MAX,
            cycle: None,
            place,
            number: 0,
            moved_until: 0,
            first_result: 0,
            next_edit,
            marked: BTreeSet::new(),
        }
    }

    /// Its place among the work, and 1 + the number of the last cycle so far in which something moved.
    pub fn moved(&self) -> (usize, u32) {
        (self.place, self.moved_until)
    }

    /// The snowpack.
    pub fn slot(&self) -> Slot {
        self.slot
    }

    /// Says how many steps may be taken in this frame, in which the results of edits begin at a number.
    pub fn go_on(&mut self, steps: u32, first_result: u32) {
        (self.allowed, self.first_result) = (steps, first_result);
    }

    /// The next step's edits; nothing where no more is to be taken.
    fn next_step(&mut self, resident: &mut Resident) -> Option<Vec<Edit>> {
        self.allowed = self.allowed.checked_sub(1)?;
        if let Some(edits) = self.cycle.as_mut().and_then(|cycle| cycle.steps.next()) {
            return Some(edits);
        }
        self.number += u32::from(self.cycle.is_some());
        let moves = self.cycles.next()?;
        if moves.move_something() {
            self.moved_until = self.number + 1;
        }
        let loaded = resident.loads.keys().copied();
        let tiles: BTreeSet<u32> = loaded.chain(moves.tiles(&resident.layout.grid)).collect();
        for tile in &tiles {
            resident.unweighed.remove(tile);
        }
        let count = moves.count();
        let mut steps = moves.steps.into_iter();
        let edits = steps.next().unwrap_or_default();
        self.cycle = Some(Cycle { steps, count, tiles, begun: false });
        Some(edits)
    }
}

impl Planner<'_> {
    /// Plans the next step of each snowpack in which objects move. Returns whether there was any.
    pub fn step(&mut self, residents: &mut Residents, moving: &mut [Moving]) -> bool {
        let first_collider = self.tables.orders.colliders.len();
        let mut step = Step::default();
        let mut any = false;
        for moving in moving {
            if let Some(resident) = residents.get_mut(moving.slot) {
                any |= self.step_of(resident, moving, &mut step);
            }
        }
        self.change_snow(KernelId::Snowfall, step.edit_jobs);
        let count = self.tables.orders.colliders.len() - first_collider;
        let pass = Pass { first: first_collider, count, ..edit_pass() };
        self.dispatch(KernelId::Contact, 0, pass, count);
        self.stresses(step.load_jobs);
        for (cycle, pages) in step.whole {
            let whole = Pass { cycle, cycles: 1, flags: LISTED, ..Pass::default() };
            self.compact_listed(KernelId::Compact, pages, whole);
        }
        for ((cycle, kernel, rate, press), pages) in step.stepped {
            let (rate, flags) = (f32::from_bits(rate), LISTED | STEPPED);
            let pass = Pass { cycle, cycles: 1, flags, rate, press, ..Pass::default() };
            self.compact_listed(kernel, pages, pass);
        }
        any
    }

    /// Whether what has been planned is to be submitted before the next step.
    pub fn is_full(&self) -> bool {
        let orders = &self.tables.orders;
        let rows = [
            orders.colliders.len(),
            orders.spans.len(),
            orders.lifts.len(),
            orders.load_jobs.len(),
            orders.loads.len(),
            orders.edit_jobs.len(),
            orders.operation_lists.len(),
        ];
        rows.into_iter().any(|rows| rows > MOST_ROWS)
    }

    /// Tells the device which tiles of a snowpack are under objects now, as far as steps have changed that.
    pub fn mark_moved(&mut self, residents: &Residents, moving: &mut Moving) {
        let Some(resident) = residents.get(moving.slot) else { return };
        for tile in std::mem::take(&mut moving.marked) {
            self.mark_tile(moving.slot, resident, tile);
        }
    }

    fn step_of(&mut self, resident: &mut Resident, moving: &mut Moving, step: &mut Step) -> bool {
        let Some(edits) = moving.next_step(resident) else { return false };
        self.move_objects(resident, moving, edits, step);
        let slot = moving.slot;
        let first = self.collider_rows(slot, resident, true);
        resident.bodies.values_mut().for_each(|body| body.placed = false);
        let Some(cycle) = &mut moving.cycle else { return true };
        self.load_jobs(first, resident, cycle.tiles.iter().copied(), &mut step.load_jobs);
        let row = |tile: &u32| (resident.page(*tile), resident.lot.tiles.start + tile);
        if !std::mem::replace(&mut cycle.begun, true) {
            let whole = step.whole.entry(moving.number).or_default();
            for tile in resident.may_move().filter(|tile| !cycle.tiles.contains(tile)) {
                let (page, row) = row(&tile);
                whole.entry(page).or_default().push(row);
            }
        }
        let dt = moving.dt / f64::from(cycle.count);
        let (rate, press) = compaction_in(dt, moving.pressing);
        let kernel = compaction_of(moving.pressing);
        let pages = (moving.number, kernel, rate.to_bits(), press);
        let pages = step.stepped.entry(pages).or_default();
        for (page, row) in cycle.tiles.iter().map(row) {
            pages.entry(page).or_default().push(row);
        }
        resident.wake(cycle.tiles.iter().copied());
        true
    }

    /// Carries out the edits of a step.
    fn move_objects(
        &mut self,
        resident: &mut Resident,
        moving: &mut Moving,
        edits: Vec<Edit>,
        step: &mut Step,
    ) {
        let mut changed = Changed::default();
        let mut stressed = BTreeSet::new();
        let mut moved = false;
        for edit in edits {
            let result = moving.first_result + moving.next_edit;
            moving.next_edit += 1;
            match edit {
                Edit::Lay(_) => {
                    self.operate(resident, &edit, result, ALL_ROWS, &mut changed);
                }
                other => moved |= self.alter(moving.slot, resident, other, &mut stressed),
            }
        }
        changed.snowed.sort_unstable();
        self.edit_jobs(resident, changed.snowed, &mut step.edit_jobs);
        if moved {
            moving.marked.extend(resident.list_loads());
        }
    }
}
