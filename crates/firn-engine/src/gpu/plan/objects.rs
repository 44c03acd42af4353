//! Objects that come, move and go, and the rows that tell kernels of them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use firn_snow::Contact;

use crate::frame::{Contents, Edit, Placement, Slot};
use crate::gpu::layout::{LoadJob, Tile};
use crate::gpu::resident::{Body, Resident, lowest};

use super::Planner;

impl Planner<'_> {
    /// Carries out an edit that lets no snow fall and clears none, but for what is written of it. Adds the tiles whose stress may be
    /// another then, and returns whether objects have come, moved or gone.
    pub(super) fn alter(
        &mut self,
        slot: Slot,
        resident: &mut Resident,
        edit: Edit,
        stressed: &mut BTreeSet<u32>,
    ) -> bool {
        match edit {
            Edit::PutCollider { id, collider, placed } => {
                let old = resident.bodies.remove(&id);
                stressed.extend(old.iter().flat_map(|old| old.tiles()));
                let same =
                    old.as_ref().filter(|old| old.rows() == collider.footprints.len() as u32);
                let kept = same.map(|old| (old.contact, placed || old.placed));
                if let Some(old) = old.filter(|_| kept.is_none()) {
                    self.tables.forget_bodies(std::iter::once(&old));
                }
                let (contact, placed) = kept.unwrap_or_else(|| {
                    let rows = collider.footprints.len() as u32;
                    (self.tables.take_contacts(self.device, rows), true)
                });
                let body = Body::new(collider, contact, placed, &resident.layout.grid);
                stressed.extend(body.tiles());
                resident.bodies.insert(id, body);
                true
            }
            Edit::RemoveCollider { id } => {
                let Some(body) = resident.bodies.remove(&id) else { return false };
                stressed.extend(body.tiles());
                self.tables.forget_bodies(std::iter::once(&body));
                true
            }
            Edit::SetGround(ground) => {
                resident.lowest = lowest(&resident.layout.grid, &ground);
                resident.layout.ground = ground;
                false
            }
            Edit::SetMaterial(material) => {
                resident.layout.material = material;
                resident.row = resident.row.with_material(&resident.layout.grid, &material);
                self.tables.set_session(self.device, slot, &resident.row);
                stressed.extend(0..resident.lot.places.len() as u32);
                false
            }
            Edit::Restore(contents) => {
                self.tables.forget_bodies(resident.bodies.values());
                resident.bodies = self.restore_bodies(resident, &contents);
                resident.unweighed.clear();
                resident.awake = None;
                true
            }
            Edit::Deposit(_)
            | Edit::Lay(_)
            | Edit::Clear { .. }
            | Edit::Strip { .. }
            | Edit::Stamp(_)
            | Edit::Weather(_) => false,
        }
    }

    /// Writes the contacts of saved objects, as they were.
    fn restore_bodies(
        &mut self,
        resident: &Resident,
        contents: &Contents,
    ) -> BTreeMap<Arc<str>, Body> {
        let body = |(id, placement, contact): &(Arc<str>, Arc<Placement>, Contact)| {
            let row = self.tables.take_contacts(self.device, placement.footprints.len() as u32);
            // The rows of its other footprints are evaluated before any stress is.
            self.tables.set_contact(self.device, row, contact);
            let body = Body::new(placement.clone(), row, false, &resident.layout.grid);
            (id.clone(), body)
        };
        contents.colliders.iter().map(body).collect()
    }

    /// Lists the objects on each tile anew, and tells the device which tiles they stand on.
    pub(super) fn mark_loaded(&mut self, slot: Slot, resident: &mut Resident) {
        for tile in resident.list_loads() {
            self.mark_tile(slot, resident, tile);
        }
    }

    /// Tells the device whether a tile is under an object.
    pub(super) fn mark_tile(&mut self, slot: Slot, resident: &Resident, tile: u32) {
        let place = resident.lot.places[tile as usize];
        let loaded = resident.loads.contains_key(&tile);
        let row = Tile::new(slot, place, &resident.layout.grid, tile, loaded);
        self.tables.tile_rows.push((resident.lot.tiles.start + tile, row));
    }

    /// Adds a snowpack's objects to the tables; `runs` says whether a cycle follows what they are for.
    /// Returns the row of the first.
    pub(super) fn collider_rows(&mut self, slot: Slot, resident: &Resident, runs: bool) -> u32 {
        let first = self.tables.orders.colliders.len();
        resident.collider_rows(slot, runs, &mut self.tables.orders);
        first
    }

    /// Adds jobs that evaluate the stress of some of a snowpack's tiles under its objects, the first of
    /// which has a row.
    pub(super) fn load_jobs(
        &mut self,
        first_collider: u32,
        resident: &Resident,
        tiles: impl Iterator<Item = u32>,
        jobs: &mut Vec<(u32, LoadJob)>,
    ) {
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
