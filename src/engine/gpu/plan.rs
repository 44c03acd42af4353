//! The dispatches of a submit, and the rows they work on.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;
use std::sync::Arc;

use crate::engine::frame::{Contents, Deposit, Edit, Placement, Slot, Work};
use crate::snow::{ColumnRect, Contact, REFERENCE_CELL_SIZE};

use super::arena::Arena;
use super::device::Device;
use super::due::Due;
use super::kernels::KernelId;
use super::layout::{
    ALWAYS_AWAKE, CLEAR, DEPOSIT, EDITED, EditJob, LoadJob, Operation, PUBLISH, Pass, Run,
    SampleJob, Tile, WAKE,
};
use super::resident::{Body, Resident, Residents};
use super::tables::Tables;

/// Tiles that the host lists at the most, whether they are awake or not.
const FEW_TILES: usize = 512;

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
    /// Snowpacks whose contacts have been evaluated in this frame.
    pub evaluated: &'a mut BTreeSet<Slot>,
    /// Whether every cycle is a dispatch of its own.
    pub one_by_one: bool,
    /// Passes over the lists of due tiles so far. Each second one goes backwards: it begins where
    /// the one before has ended, with cells that the device's cache still has.
    pub turns: &'a mut u32,
    /// What has been planned so far.
    pub dispatches: Vec<Dispatch>,
}

/// Edits of one snowpack in one round, each with its row in the table of results.
pub type Round = Vec<(u32, Edit)>;

/// What edits leave to be done in one round.
#[derive(Default)]
struct Edited {
    /// Tiles with operations, by page.
    edit_jobs: Vec<(u32, EditJob)>,
    /// Tiles whose stress is to be evaluated, by page.
    load_jobs: Vec<(u32, LoadJob)>,
    colliders: u32,
}

impl Planner<'_> {
    /// Plans the edits of one round of all snowpacks: snow falls, then contacts and stresses are
    /// evaluated.
    pub fn edits(&mut self, residents: &mut Residents, rounds: Vec<(Slot, Round)>) {
        let first_collider = self.tables.colliders.len();
        let mut edited = Edited::default();
        for (slot, round) in rounds {
            if let Some(resident) = residents.get_mut(slot) {
                self.edit(slot, resident, round, &mut edited);
            }
        }
        let jobs = by_page(edited.edit_jobs);
        for (page, jobs) in jobs {
            let (first, count) = (self.tables.edit_jobs.len(), jobs.len() as u32);
            self.tables.edit_jobs.rows.extend(jobs);
            self.dispatch(KernelId::Snowfall, page, Pass { first, count, ..edit_pass() }, count);
        }
        if edited.colliders > 0 {
            let count = edited.colliders;
            let pass = Pass { first: first_collider, count, ..edit_pass() };
            self.dispatch(KernelId::Contact, 0, pass, count);
        }
        for (page, jobs) in by_page(edited.load_jobs) {
            let (first, count) = (self.tables.load_jobs.len(), jobs.len() as u32);
            self.tables.load_jobs.rows.extend(jobs);
            self.dispatch(KernelId::Stress, page, Pass { first, count, ..edit_pass() }, count);
        }
    }

    fn edit(&mut self, slot: Slot, resident: &mut Resident, round: Round, edited: &mut Edited) {
        // Tiles with the operations that touch them.
        let mut snowed: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        let mut stressed = BTreeSet::new();
        let mut moved = false;
        let evaluates = round.iter().any(|(_, edit)| !matches!(edit, Edit::Restore(_)));
        for (result, edit) in round {
            match edit {
                Edit::Deposit(_) | Edit::Clear { .. } => {
                    let (operation, columns) = operation(&edit, result);
                    let row = self.tables.operations.push(operation);
                    for tile in tiles_in(columns, resident.row.tiles_x) {
                        snowed.entry(tile).or_default().push(row);
                    }
                }
                Edit::PutCollider { id, collider, placed } => {
                    let tiles = collider.footprint.tiles(&resident.layout.grid);
                    stressed.extend(tiles.iter().copied());
                    let old = resident.bodies.get(&id);
                    stressed.extend(old.iter().flat_map(|old| old.tiles.iter().copied()));
                    let contact = old
                        .map_or_else(|| self.tables.take_contact(self.device), |old| old.contact);
                    let placed = placed || old.is_some_and(|old| old.placed);
                    resident
                        .bodies
                        .insert(id, Body { placement: collider, contact, tiles, placed });
                    moved = true;
                }
                Edit::RemoveCollider { id } => {
                    if let Some(body) = resident.bodies.remove(&id) {
                        stressed.extend(body.tiles.iter().copied());
                        self.tables.forget_bodies(std::iter::once(&body));
                        moved = true;
                    }
                }
                Edit::SetMaterial(material) => {
                    resident.layout.material = material;
                    resident.row = resident.row.with_material(&resident.layout.grid, &material);
                    self.tables.set_session(self.device, slot, &resident.row);
                    stressed.extend(0..resident.lot.places.len() as u32);
                }
                Edit::Restore(contents) => {
                    self.tables.forget_bodies(resident.bodies.values());
                    self.arena.restore(self.device, &resident.lot, &contents.tiles);
                    resident.bodies = self.restore_bodies(resident, &contents);
                    moved = true;
                }
            }
        }
        if moved {
            self.mark_loaded(slot, resident);
        }
        if !evaluates {
            // What is restored is left as it was saved; the next cycle evaluates it.
            self.evaluated.remove(&slot);
            return;
        }
        self.evaluated.insert(slot);
        stressed.extend(snowed.keys().copied());
        self.edit_jobs(resident, snowed, &mut edited.edit_jobs);
        stressed.extend(resident.loads.keys().copied());
        edited.colliders += resident.bodies.len() as u32;
        self.load_jobs(slot, resident, stressed.into_iter(), &mut edited.load_jobs);
        resident.bodies.values_mut().for_each(|body| body.placed = false);
    }

    /// Adds jobs for tiles with the operations that touch them. Tiles that the same operations touch
    /// share a list of them.
    fn edit_jobs(
        &mut self,
        resident: &Resident,
        snowed: BTreeMap<u32, Vec<u32>>,
        jobs: &mut Vec<(u32, EditJob)>,
    ) {
        let rows = &mut self.tables.operation_lists.rows;
        let mut lists: HashMap<Vec<u32>, u32> = HashMap::new();
        for (tile, list) in snowed {
            let operations = list.len() as u32;
            let first_operation = *lists.entry(list).or_insert_with_key(|list| {
                rows.extend(list);
                rows.len() as u32 - operations
            });
            let tile_row = resident.lot.tiles.start + tile;
            let job = EditJob { tile: tile_row, first_operation, operations, padding: 0 };
            jobs.push((resident.page(tile), job));
        }
    }

    /// Writes the contacts of saved objects, as they were.
    fn restore_bodies(
        &mut self,
        resident: &Resident,
        contents: &Contents,
    ) -> BTreeMap<Arc<str>, Body> {
        let body = |(id, placement, contact): &(Arc<str>, Arc<Placement>, Contact)| {
            let row = self.tables.take_contact(self.device);
            self.tables.set_contact(self.device, row, contact);
            let tiles = placement.footprint.tiles(&resident.layout.grid);
            let body = Body { placement: placement.clone(), contact: row, tiles, placed: false };
            (id.clone(), body)
        };
        contents.colliders.iter().map(body).collect()
    }

    /// Lists the objects on each tile anew, and tells the device which tiles they stand on.
    fn mark_loaded(&mut self, slot: Slot, resident: &mut Resident) {
        for tile in resident.list_loads() {
            let place = resident.lot.places[tile as usize];
            let loaded = resident.loads.contains_key(&tile);
            let row = Tile::new(slot, place, &resident.layout.grid, tile, loaded);
            self.tables.tile_rows.push((resident.lot.tiles.start + tile, row));
        }
    }

    /// Adds a snowpack's objects to the tables, and jobs that evaluate the stress of some of its
    /// tiles under them.
    fn load_jobs(
        &mut self,
        slot: Slot,
        resident: &Resident,
        tiles: impl Iterator<Item = u32>,
        jobs: &mut Vec<(u32, LoadJob)>,
    ) {
        let first_collider = self.tables.colliders.len();
        let (colliders, spans) = resident.collider_rows(slot, self.tables.spans.len());
        self.tables.colliders.rows.extend(colliders);
        self.tables.spans.rows.extend(spans);
        for tile in tiles {
            let first_load = self.tables.loads.len();
            let ranks = resident.loads.get(&tile).map_or(&[][..], Vec::as_slice);
            self.tables.loads.rows.extend(ranks.iter().map(|rank| first_collider + rank));
            let job = LoadJob {
                tile: resident.lot.tiles.start + tile,
                first_load,
                loads: ranks.len() as u32,
                padding: 0,
            };
            jobs.push((resident.page(tile), job));
        }
    }

    /// Plans the cycles of all snowpacks on tiles without objects, which run all of theirs at once.
    pub fn runs(
        &mut self,
        residents: &Residents,
        work: &[Work],
        running_tiles: usize,
        always_awake: bool,
    ) {
        let flag = |set: bool, flag: u32| if set { flag } else { 0 };
        let run = |(tally, work): (u32, &Work)| {
            let flags = flag(work.wake, WAKE)
                | flag(work.publish, PUBLISH)
                | flag(self.evaluated.contains(&work.slot), EDITED)
                | flag(always_awake, ALWAYS_AWAKE);
            let rate = (work.run.dt / REFERENCE_CELL_SIZE) as f32;
            (work.slot, Run { cycles: work.run.cycles, flags, rate, tally })
        };
        self.tables.runs.set((0..).zip(work).map(run));
        let wakes = work.iter().any(|work| work.wake);
        if wakes || running_tiles > FEW_TILES {
            self.scheduled_runs(work);
        } else {
            self.listed_runs(residents, work, running_tiles);
        }
    }

    /// Tiles without objects, those that are due and awake listed by the device.
    fn scheduled_runs(&mut self, work: &[Work]) {
        let tile_end = self.arena.tile_end();
        let pass = Pass { count: tile_end, ..Pass::default() };
        self.dispatch(KernelId::Schedule, 0, pass, tile_end.div_ceil(64));
        let cycles = work.iter().map(|work| work.run.cycles).max().unwrap_or(0);
        for part in self.parts(cycles) {
            let backwards = *self.turns % 2;
            *self.turns = self.turns.wrapping_add(1);
            for (page, _) in (0..).zip(self.arena.pages.rows()).filter(|&(_, rows)| rows > 0) {
                let (first, length) = (self.tables.due.first_of(page), Due::length_of(page));
                let pass = Pass { first, length, backwards, ..part };
                let kernel = KernelId::Compact;
                self.dispatches.push(Dispatch { kernel, page, pass, groups: None });
            }
        }
    }

    /// The parts that a number of cycles is dispatched in: one is enough.
    fn parts(&self, cycles: u32) -> Vec<Pass> {
        if self.one_by_one {
            return (0..cycles).map(|cycle| Pass { cycle, cycles: 1, ..Pass::default() }).collect();
        }
        vec![Pass { cycles: u32::MAX, ..Pass::default() }]
    }

    /// Tiles without objects, all that are due listed by the host: where they are few, that is
    /// faster than to ask the device which of them are awake.
    fn listed_runs(&mut self, residents: &Residents, work: &[Work], count: usize) {
        let mut lists: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for work in work.iter().filter(|work| work.run.cycles > 0) {
            let Some(resident) = residents.get(work.slot) else { continue };
            for (tile, place) in (0..).zip(&resident.lot.places) {
                if !resident.loads.contains_key(&tile) {
                    let list = lists.entry(place.page).or_insert_with(|| Vec::with_capacity(count));
                    list.push(resident.lot.tiles.start + tile);
                }
            }
        }
        let cycles = work.iter().map(|work| work.run.cycles).max().unwrap_or(0);
        let parts = self.parts(cycles);
        for (page, tiles) in lists {
            let count = tiles.len() as u32;
            let length = self.tables.due.list(tiles);
            for &part in &parts {
                let pass = Pass { first: length + 1, length, ..part };
                self.dispatch(KernelId::Compact, page, pass, count);
            }
        }
    }

    /// Plans the cycles on tiles under objects: one after another, with contacts and stresses
    /// evaluated before each. `work` has all of the frame's on snowpacks with objects.
    pub fn loaded_runs<'w>(&mut self, residents: &Residents, work: impl Iterator<Item = &'w Work>) {
        let mut running: Vec<(u32, Slot, &Resident)> = work
            .filter(|work| work.run.cycles > 0)
            .filter_map(|work| Some((work.run.cycles, work.slot, residents.get(work.slot)?)))
            .filter(|(_, _, resident)| !resident.bodies.is_empty())
            .collect();
        // The longest first, so that each cycle concerns the first ones of every list.
        running.sort_by_key(|&(cycles, slot, _)| (std::cmp::Reverse(cycles), slot));
        let Some(&(most, _, _)) = running.first() else { return };

        let first_collider = self.tables.colliders.len();
        let mut colliders: Vec<u32> = Vec::new();
        let mut jobs: BTreeMap<u32, Vec<(u32, LoadJob)>> = BTreeMap::new();
        for &(cycles, slot, resident) in &running {
            let mut own = Vec::new();
            self.load_jobs(slot, resident, resident.loads.keys().copied(), &mut own);
            colliders.extend(std::iter::repeat_n(cycles, resident.bodies.len()));
            for (page, job) in own {
                jobs.entry(page).or_default().push((cycles, job));
            }
        }
        let mut lists = Vec::new();
        for (&page, jobs) in &jobs {
            let first_job = self.tables.load_jobs.len();
            self.tables.load_jobs.rows.extend(jobs.iter().map(|(_, job)| *job));
            let length = self.tables.due.list(jobs.iter().map(|(_, job)| job.tile));
            lists.push((page, first_job, length, jobs));
        }
        let edited = running.iter().all(|(_, slot, _)| self.evaluated.contains(slot));
        for cycle in 0..most {
            // Nothing has moved since the edits.
            let known = cycle == 0 && edited;
            let pass = Pass { cycle, cycles: 1, ..Pass::default() };
            let count = colliders.partition_point(|&cycles| cycles > cycle) as u32;
            if !known {
                let contact = Pass { first: first_collider, count, ..pass };
                self.dispatch(KernelId::Contact, 0, contact, count);
            }
            for &(page, first_job, length, jobs) in &lists {
                let count = jobs.partition_point(|&(cycles, _)| cycles > cycle) as u32;
                if count > 0 {
                    if !known {
                        let stress = Pass { first: first_job, count, ..pass };
                        self.dispatch(KernelId::Stress, page, stress, count);
                    }
                    let compact = Pass { first: length + 1, length, count, ..pass };
                    self.dispatch(KernelId::Compact, page, compact, count);
                }
            }
        }
    }

    /// Plans what is reported of the snowpacks.
    /// `groups` are those of 64 tiles in which there are tiles that publish.
    pub fn reports(&mut self, residents: &Residents, work: &[Work], groups: &Range<u32>) {
        let (first, count) = (groups.start, groups.len() as u32);
        self.dispatch(KernelId::Publish, 0, Pass { first, count, ..Pass::default() }, count);
        for resident in work.iter().filter(|w| w.tally).filter_map(|w| residents.get(w.slot)) {
            let pages: BTreeSet<u32> = resident.lot.places.iter().map(|place| place.page).collect();
            let (first, count) = (resident.lot.tiles.start, resident.lot.places.len() as u32);
            for page in pages {
                let pass = Pass { first, count, page, ..Pass::default() };
                self.dispatch(KernelId::Tally, page, pass, count);
            }
        }
    }

    /// Plans the boxes of the fixed grid that are asked for.
    pub fn samples(&mut self, residents: &Residents, work: &[Work]) {
        let mut first = 0;
        for (work, wanted) in work.iter().flat_map(|w| w.samples.iter().map(move |s| (w, s))) {
            let Some(resident) = residents.get(work.slot) else { continue };
            let job = self.tables.sample_jobs.push(SampleJob {
                session: work.slot,
                first,
                x0: wanted.columns.x0,
                y0: wanted.y0,
                z0: wanted.columns.z0,
                width: wanted.columns.x1 - wanted.columns.x0,
                height: wanted.height,
                depth: wanted.columns.z1 - wanted.columns.z0,
                rate: (wanted.dt / REFERENCE_CELL_SIZE) as f32,
                padding: 0,
            });
            let tiles = tiles_in(wanted.columns, resident.row.tiles_x);
            let pages: BTreeSet<u32> = tiles.map(|tile| resident.page(tile)).collect();
            let groups = wanted.columns.columns().div_ceil(64) as u32;
            for page in pages {
                let pass = Pass { first: job, page, ..Pass::default() };
                self.dispatch(KernelId::Sample, page, pass, groups);
            }
            first += wanted.cells() as u32;
        }
    }

    fn dispatch(&mut self, kernel: KernelId, page: u32, pass: Pass, groups: u32) {
        if groups > 0 {
            self.dispatches.push(Dispatch { kernel, page, pass, groups: Some(groups) });
        }
    }
}

fn edit_pass() -> Pass {
    Pass { edited: 1, ..Pass::default() }
}

/// Sorts jobs by the page of their tile.
fn by_page<T>(jobs: Vec<(u32, T)>) -> BTreeMap<u32, Vec<T>> {
    let mut pages: BTreeMap<u32, Vec<T>> = BTreeMap::new();
    for (page, job) in jobs {
        pages.entry(page).or_default().push(job);
    }
    pages
}

/// The row of a snowfall or clearing, and the columns it is about.
fn operation(edit: &Edit, result: u32) -> (Operation, ColumnRect) {
    let (kind, columns, snow) = match *edit {
        Edit::Deposit(Deposit { columns, depth, mass, temperature }) => {
            // As in Column::deposit: the mass of a full cell of this snow.
            let share = (u64::from(mass) << 24) / u64::from(depth.max(1));
            let share = share.min(u64::from(u32::MAX)) as u32;
            (DEPOSIT, columns, [mass, depth, share, temperature.to_bits()])
        }
        Edit::Clear { columns, depth } => (CLEAR, columns, [0, depth, 0, 0]),
        _ => (CLEAR, ColumnRect { x0: 0, z0: 0, x1: 0, z1: 0 }, [0; 4]),
    };
    let ColumnRect { x0, z0, x1, z1 } = columns;
    let row = Operation { columns: [x0, z0, x1, z1], snow, kind, result, padding: [0; 2] };
    (row, columns)
}

/// Tiles that columns lie in.
fn tiles_in(columns: ColumnRect, tiles_x: u32) -> impl Iterator<Item = u32> {
    let rect = columns.tiles();
    (rect.z0..rect.z1).flat_map(move |z| (rect.x0..rect.x1).map(move |x| z * tiles_x + x))
}
