//! Snow that falls or is cleared, objects that come, move and go, and what they press on.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use crate::engine::frame::{Contents, Deposit, Edit, Placement, Slot};
use crate::engine::gpu::kernels::KernelId;
use crate::engine::gpu::layout::{
    AFTER_EDITS, CLEAR, DEPOSIT, EditJob, LoadJob, Operation, Pass, Tile,
};
use crate::engine::gpu::resident::{Body, Resident, Residents};
use crate::snow::{ColumnRect, Contact};

use super::{Planner, Round, tiles_in};

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
    /// Plans the edits of one round of all snowpacks: snow falls, then contacts are evaluated, and
    /// stresses where loads or constants may have changed.
    pub fn edits(&mut self, residents: &mut Residents, rounds: Vec<Round>) {
        let first_collider = self.tables.orders.colliders.len();
        let mut edited = Edited::default();
        for round in rounds {
            if let Some(resident) = residents.get_mut(round.slot) {
                self.edit(resident, round, &mut edited);
            }
        }
        let jobs = by_page(edited.edit_jobs);
        for (page, jobs) in jobs {
            let (first, count) = (self.tables.orders.edit_jobs.len(), jobs.len() as u32);
            self.tables.orders.edit_jobs.extend(jobs);
            self.dispatch(KernelId::Snowfall, page, Pass { first, count, ..edit_pass() }, count);
        }
        if edited.colliders > 0 {
            let count = edited.colliders;
            let pass = Pass { first: first_collider, count, ..edit_pass() };
            self.dispatch(KernelId::Contact, 0, pass, count);
        }
        self.stresses(edited.load_jobs);
    }

    /// Plans that stresses are evaluated that edits have left for when something needs them.
    pub fn weigh(&mut self, residents: &mut Residents, slots: impl Iterator<Item = Slot>) {
        let mut jobs = Vec::new();
        for slot in slots {
            let Some(resident) = residents.get_mut(slot) else { continue };
            for tile in std::mem::take(&mut resident.unweighed) {
                let row = resident.lot.tiles.start + tile;
                jobs.push((resident.page(tile), LoadJob { tile: row, ..LoadJob::default() }));
            }
        }
        self.stresses(jobs);
    }

    fn stresses(&mut self, jobs: Vec<(u32, LoadJob)>) {
        for (page, jobs) in by_page(jobs) {
            let (first, count) = (self.tables.orders.load_jobs.len(), jobs.len() as u32);
            self.tables.orders.load_jobs.extend(jobs);
            self.dispatch(KernelId::Stress, page, Pass { first, count, ..edit_pass() }, count);
        }
    }

    fn edit(&mut self, resident: &mut Resident, round: Round, edited: &mut Edited) {
        let Round { slot, edits, runs } = round;
        // Tiles with the operations that touch them.
        let mut snowed: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        let mut stressed = BTreeSet::new();
        let mut moved = false;
        let evaluates = edits.iter().any(|(_, edit)| !matches!(edit, Edit::Restore(_)));
        for (result, edit) in edits {
            match edit {
                Edit::Deposit(deposit) => {
                    let snow = deposited(&deposit);
                    self.operate(resident, (DEPOSIT, deposit.columns, snow), result, &mut snowed);
                }
                Edit::Clear { columns, depth } => {
                    let left = [0, depth, 0, 0];
                    self.operate(resident, (CLEAR, columns, left), result, &mut snowed);
                }
                Edit::PutCollider { id, collider, placed } => {
                    let tiles = collider.footprint.tiles(&resident.layout.grid);
                    stressed.extend(tiles.iter().copied());
                    let old = resident.bodies.get(&id);
                    stressed.extend(old.iter().flat_map(|old| old.tiles.iter().copied()));
                    let contact = old
                        .map_or_else(|| self.tables.take_contact(self.device), |old| old.contact);
                    let placed = placed || old.is_none_or(|old| old.placed);
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
                    resident.unweighed.clear();
                    moved = true;
                }
            }
        }
        if moved {
            self.mark_loaded(slot, resident);
        }
        if !evaluates {
            // What is restored is left as it was saved; the next cycle evaluates it.
            return;
        }
        if runs {
            self.evaluated.insert(slot);
        }
        resident.unweighed.extend(snowed.keys().copied());
        self.edit_jobs(resident, snowed, &mut edited.edit_jobs);
        stressed.extend(resident.loads.keys().copied());
        for tile in &stressed {
            resident.unweighed.remove(tile);
        }
        edited.colliders += resident.bodies.len() as u32;
        self.load_jobs(slot, resident, runs, stressed.into_iter(), &mut edited.load_jobs);
        resident.bodies.values_mut().for_each(|body| body.placed = false);
    }

    /// Adds a snowfall or clearing of some columns, the result of which has a number, and lists it for
    /// their tiles.
    fn operate(
        &mut self,
        resident: &Resident,
        (kind, columns, snow): (u32, ColumnRect, [u32; 4]),
        result: u32,
        snowed: &mut BTreeMap<u32, Vec<u32>>,
    ) {
        let ColumnRect { x0, z0, x1, z1 } = columns;
        let columns_row = [x0, z0, x1, z1];
        let row = Operation { columns: columns_row, snow, kind, result, padding: [0; 2] };
        let row = self.tables.orders.operations.push(row);
        for tile in tiles_in(columns, resident.row.tiles_x) {
            snowed.entry(tile).or_default().push(row);
        }
    }

    /// Adds jobs for tiles with the operations that touch them. Tiles that the same operations touch
    /// share a list of them.
    fn edit_jobs(
        &mut self,
        resident: &Resident,
        snowed: BTreeMap<u32, Vec<u32>>,
        jobs: &mut Vec<(u32, EditJob)>,
    ) {
        let rows = &mut self.tables.orders.operation_lists;
        let mut lists: HashMap<Vec<u32>, u32> = HashMap::new();
        for (tile, list) in snowed {
            let operations = list.len() as u32;
            let first_operation = *lists.entry(list).or_insert_with_key(|list| {
                rows.extend(list.iter().copied());
                rows.len() - operations
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
    /// tiles under them; `runs` says whether a cycle follows that.
    pub(super) fn load_jobs(
        &mut self,
        slot: Slot,
        resident: &Resident,
        runs: bool,
        tiles: impl Iterator<Item = u32>,
        jobs: &mut Vec<(u32, LoadJob)>,
    ) {
        let first_collider = self.tables.orders.colliders.len();
        let (colliders, spans) = resident.collider_rows(slot, runs, self.tables.orders.spans.len());
        self.tables.orders.colliders.extend(colliders);
        self.tables.orders.spans.extend(spans);
        for tile in tiles {
            let first_load = self.tables.orders.loads.len();
            let ranks = resident.loads.get(&tile).map_or(&[][..], Vec::as_slice);
            self.tables.orders.loads.extend(ranks.iter().map(|rank| first_collider + rank));
            let job = LoadJob {
                tile: resident.lot.tiles.start + tile,
                first_load,
                loads: ranks.len() as u32,
                padding: 0,
            };
            jobs.push((resident.page(tile), job));
        }
    }
}

fn edit_pass() -> Pass {
    Pass { flags: AFTER_EDITS, ..Pass::default() }
}

/// Sorts jobs by the page of their tile.
fn by_page<T>(jobs: Vec<(u32, T)>) -> BTreeMap<u32, Vec<T>> {
    let mut pages: BTreeMap<u32, Vec<T>> = BTreeMap::new();
    for (page, job) in jobs {
        pages.entry(page).or_default().push(job);
    }
    pages
}

/// What a row says of snow that falls.
fn deposited(deposit: &Deposit) -> [u32; 4] {
    let Deposit { depth, mass, temperature, .. } = *deposit;
    // As in Column::deposit: the mass of a full cell of this snow.
    let share = (u64::from(mass) << 24) / u64::from(depth.max(1));
    let share = share.min(u64::from(u32::MAX)) as u32;
    [mass, depth, share, temperature.to_bits()]
}
